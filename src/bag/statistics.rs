//! Counts, rates and gaps of one topic, from its message times in order.

/// Statistics of a topic's messages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Statistics {
    /// Number of messages.
    pub(crate) count: u64,
    /// Times of the first and last message, nanoseconds since the epoch.
    pub(crate) bounds_ns: Option<(i64, i64)>,
    /// Longest time between two consecutive messages, nanoseconds, and its start, nanoseconds since the epoch.
    pub(crate) largest_gap_ns: Option<(i64, i64)>,
    /// Sequence numbers that the writer skipped.
    pub(crate) num_skipped: u64,
    /// Size of all messages, bytes.
    pub(crate) bytes: u64,
    sequence: Option<u32>,
}

impl Statistics {
    /// Counts a message by its time alone, nanoseconds since the epoch.
    pub(crate) fn add_time(&mut self, time_ns: i64) {
        self.count += 1;
        let (first_ns, last_ns) = *self.bounds_ns.get_or_insert((time_ns, time_ns));
        if self.count > 1 {
            let gap_ns = time_ns.saturating_sub(last_ns);
            if self.largest_gap_ns.is_none_or(|(largest_ns, _)| gap_ns > largest_ns) {
                self.largest_gap_ns = Some((gap_ns.max(0), last_ns));
            }
        }
        self.bounds_ns = Some((first_ns.min(time_ns), last_ns.max(time_ns)));
    }

    /// Counts a message by its time, sequence number and size. Constant or decreasing sequence numbers skip nothing:
    /// the writer does not count or was restarted.
    pub(crate) fn add_message(&mut self, time_ns: i64, sequence: u32, bytes: usize) {
        self.add_time(time_ns);
        self.bytes += bytes as u64;
        if let Some(previous) = self.sequence {
            self.num_skipped += u64::from(sequence.saturating_sub(previous).saturating_sub(1));
        }
        self.sequence = Some(sequence);
    }

    /// Message rate, hertz; `None` for fewer than two messages or if all have the same time.
    pub(crate) fn rate_hz(&self) -> Option<f64> {
        let (first_ns, last_ns) = self.bounds_ns?;
        rate_hz(self.count, first_ns, last_ns)
    }
}

/// Rate of `count` events from the first to the last, hertz; `None` for fewer than two or if time does not advance.
pub(super) fn rate_hz(count: u64, first_ns: i64, last_ns: i64) -> Option<f64> {
    let span_ns = i128::from(last_ns) - i128::from(first_ns);
    (count > 1 && span_ns > 0).then(|| (count - 1) as f64 * 1e9 / span_ns as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rate_and_gaps_of_an_irregular_camera() {
        let mut statistics = Statistics::default();
        for (time_ms, sequence) in [(1000, 7), (1100, 8), (1500, 12), (1600, 13), (2000, 1)] {
            statistics.add_message(time_ms * 1_000_000, sequence, 10);
        }
        assert_eq!((statistics.count, statistics.bytes, statistics.num_skipped), (5, 50, 3));
        assert_eq!(statistics.rate_hz(), Some(4.0));
        assert_eq!(statistics.largest_gap_ns, Some((400_000_000, 1_100_000_000)));
    }

    #[test]
    fn one_message_has_neither_rate_nor_gap() {
        let mut statistics = Statistics::default();
        assert_eq!(statistics.rate_hz(), None);
        statistics.add_time(5);
        assert_eq!(
            (statistics.rate_hz(), statistics.largest_gap_ns, statistics.bounds_ns),
            (None, None, Some((5, 5)))
        );
    }
}
