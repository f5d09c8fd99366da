//! Determines a frame's place in its stream, the frames missing before it, and whether its stamp is valid.

/// Source of a frame's number, as in `FrameTrace.frame_number_source`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NumberSource {
    /// The sequence number of the publication.
    Transport,
    /// Counted by this node.
    Host,
}

/// A frame's place in the order of arrival.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    /// Number of the frame, including lost frames.
    pub(crate) frame_number: u64,
    /// Source of that number.
    pub(crate) source: NumberSource,
    /// Frames missing directly before this one; `None` if unknown.
    pub(crate) missing: Option<u32>,
}

/// Numbers frames by the publisher's sequence number if it advances. Many publishers leave it constant; then gaps are
/// unknown.
#[derive(Debug, Default)]
pub(crate) struct Sequence {
    last: Option<u32>,
    num_taken: u64,
    /// Frames that arrived after the last one and were dropped before they were read.
    num_dropped: u32,
}

/// A larger step means a restart or damage, not a loss: it exceeds an hour of frames.
const MAX_GAP: u32 = 100_000;

impl Sequence {
    /// Reserves numbers for frames that arrived but were dropped before their sequence numbers were read. They do not
    /// count as missing.
    pub(crate) fn skip(&mut self, num_dropped: u32) {
        self.num_dropped = self.num_dropped.saturating_add(num_dropped);
    }

    /// Returns the place of the next message from its sequence number.
    pub(crate) fn take(&mut self, sequence: u32) -> Place {
        let step = self.step(sequence);
        let num_dropped = std::mem::take(&mut self.num_dropped);
        let num_absent = step.map_or(num_dropped, |step| num_dropped.max(step - 1));
        let frame_number = self.num_taken + u64::from(num_absent);
        self.last = Some(sequence);
        self.num_taken = frame_number + 1;
        Place {
            frame_number,
            source: step.map_or(NumberSource::Host, |_| NumberSource::Transport),
            missing: step.map(|step| (step - 1).saturating_sub(num_dropped)),
        }
    }

    /// Processes the sequence number of a repeated or late frame. The frame gets a number only if the publisher's
    /// counter advanced. Returns the frames missing before it.
    pub(crate) fn take_repeated(&mut self, sequence: u32) -> u32 {
        match self.step(sequence) {
            Some(_) => self.take(sequence).missing.unwrap_or(0),
            None => 0,
        }
    }

    /// Notes that the publisher changes: the next gap is unknown.
    pub(crate) fn restart(&mut self) {
        self.last = None;
    }

    /// Returns the step of the publisher's counter; `None` if it did not advance or the step is implausible.
    fn step(&self, sequence: u32) -> Option<u32> {
        let step = sequence.wrapping_sub(self.last?);
        (1..=MAX_GAP + 1).contains(&step).then_some(step)
    }
}

/// The reason to reject a frame's stamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StampFault {
    /// Equal to the previous stamp.
    Duplicate,
    /// Earlier than the previous stamp.
    OutOfOrder,
}

/// Relation of a stamp to the preceding stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StampStep {
    /// The stamp ascends.
    Forward,
    /// The clock was set back: positions before and after are not comparable.
    ClockSetBack,
    /// The stamps begin again where they began: a recording is played in a loop.
    BeginsAgain,
}

/// Number of consecutive ascending frames before the last stamp after which the clock counts as set back. Fewer are
/// late frames. Without this limit, one false stamp far in the future would reject the rest of the stream.
const STRAGGLERS: u32 = 3;

/// Frames that a stamp must be older than before the stream can begin again: more than a network reorders.
const REORDERED: usize = 8;
/// Shortest stream that can begin again, nanoseconds.
const SHORTEST_LOOP_NS: i64 = 1_000_000_000;
/// Largest difference between the stream's length and the step back with which it begins again, as a part of the
/// length: frames at either end may be lost.
const LOOP_TOLERANCE: i64 = 10;

/// The stamps since the stream began.
#[derive(Debug)]
struct Stretch {
    first_ns: i64,
    /// The last stamps, the oldest at `num % REORDERED`.
    recent_ns: [i64; REORDERED],
    num: usize,
}

impl Stretch {
    const fn begin(first_ns: i64) -> Self {
        Self { first_ns, recent_ns: [first_ns; REORDERED], num: 0 }
    }

    const fn push(&mut self, stamp_ns: i64) {
        self.recent_ns[self.num % REORDERED] = stamp_ns;
        self.num += 1;
    }

    /// True if the stream began at about this stamp, long enough ago that the frame is not a late one.
    fn begins_again_at(&self, stamp_ns: i64, last_ns: i64) -> bool {
        let length_ns = last_ns.saturating_sub(self.first_ns);
        let back_ns = last_ns.saturating_sub(stamp_ns);
        self.num > REORDERED
            && self.recent_ns.iter().all(|recent_ns| stamp_ns < *recent_ns)
            && length_ns >= SHORTEST_LOOP_NS
            && (back_ns - length_ns).abs() <= length_ns / LOOP_TOLERANCE
    }
}

/// Checks that stamps ascend. Accepts stamps of zero, which drivers without a clock send.
#[derive(Debug, Default)]
pub(crate) struct StampOrder {
    last_ns: Option<i64>,
    stretch: Option<Stretch>,
    /// The last rejected stamp, and the number of ascending stamps up to it.
    behind: Option<(i64, u32)>,
}

impl StampOrder {
    /// Checks the stamp of the next frame.
    ///
    /// # Errors
    /// The stamp equals the last one or is earlier.
    pub(crate) fn take(&mut self, stamp_ns: i64) -> Result<StampStep, StampFault> {
        if stamp_ns == 0 {
            return Ok(StampStep::Forward);
        }
        let Some(last_ns) = self.last_ns else {
            self.accept(stamp_ns);
            return Ok(StampStep::Forward);
        };
        if stamp_ns == last_ns {
            return Err(StampFault::Duplicate);
        }
        if self.stretch.as_ref().is_some_and(|seen| seen.begins_again_at(stamp_ns, last_ns)) {
            self.begin(stamp_ns);
            return Ok(StampStep::BeginsAgain);
        }
        if stamp_ns > last_ns {
            self.accept(stamp_ns);
            return Ok(StampStep::Forward);
        }
        let num_behind = match self.behind {
            Some((behind_ns, num)) if stamp_ns > behind_ns => num + 1,
            _ => 1,
        };
        if num_behind > STRAGGLERS {
            self.begin(stamp_ns);
            return Ok(StampStep::ClockSetBack);
        }
        self.behind = Some((stamp_ns, num_behind));
        Err(StampFault::OutOfOrder)
    }

    fn begin(&mut self, stamp_ns: i64) {
        self.stretch = None;
        self.accept(stamp_ns);
    }

    fn accept(&mut self, stamp_ns: i64) {
        self.stretch.get_or_insert(Stretch::begin(stamp_ns)).push(stamp_ns);
        self.last_ns = Some(stamp_ns);
        self.behind = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(sequences: &[u32]) -> Vec<(u64, Option<u32>)> {
        let mut sequence = Sequence::default();
        sequences.iter().map(|&s| sequence.take(s)).map(|p| (p.frame_number, p.missing)).collect()
    }

    #[test]
    fn gaps_of_a_counting_publisher_are_detected() {
        let expected = [(0, None), (1, Some(0)), (4, Some(2)), (5, Some(0))];
        assert_eq!(places(&[7, 8, 11, 12]), expected);
        assert_eq!(places(&[u32::MAX, 0, 2]), [(0, None), (1, Some(0)), (3, Some(1))]);
    }

    #[test]
    fn a_constant_or_restarted_counter_leaves_gaps_unknown() {
        assert_eq!(places(&[0, 0, 0]), [(0, None), (1, None), (2, None)]);
        assert_eq!(places(&[5, 6, 1, 2]), [(0, None), (1, Some(0)), (2, None), (3, Some(0))]);
        let far = places(&[1, 2, 3_000_000_000, 3_000_000_001]);
        assert_eq!(far, [(0, None), (1, Some(0)), (2, None), (3, Some(0))], "damage is not a loss");
        let mut sequence = Sequence::default();
        sequence.take(0);
        assert_eq!(sequence.take(0).source, NumberSource::Host);
        assert_eq!(sequence.take(1).source, NumberSource::Transport);
    }

    #[test]
    fn a_late_frame_is_counted_missing_once() {
        let mut sequence = Sequence::default();
        assert_eq!([1, 2, 4].map(|s| sequence.take(s).missing), [None, Some(0), Some(1)]);
        assert_eq!(sequence.take_repeated(3), 0);
        assert_eq!(sequence.take_repeated(4), 0);
        assert_eq!(sequence.take(5).frame_number, 4);
        assert_eq!(sequence.take_repeated(8), 2, "repeated, but with its own sequence number");
        sequence.restart();
        assert_eq!(sequence.take(20).missing, None);
    }

    #[test]
    fn dropped_frames_have_numbers_but_are_not_missing() {
        for counts in [true, false] {
            let mut sequence = Sequence::default();
            let mut take = |number: u32, num_dropped| {
                sequence.skip(num_dropped);
                let place = sequence.take(if counts { number } else { 0 });
                (place.frame_number, place.missing)
            };
            let known = |missing| counts.then_some(missing);
            assert_eq!(take(10, 0), (0, None));
            assert_eq!(take(14, 3), (4, known(0)));
            assert_eq!(take(15, 0), (5, known(0)));
            let lost = u64::from(counts);
            assert_eq!(take(18, 1), (7 + lost, known(1)), "one dropped; one lost if detectable");
        }
    }

    fn judged(stamps: &[i64]) -> String {
        let mut order = StampOrder::default();
        let letter = |&stamp: &i64| match order.take(stamp) {
            Ok(StampStep::Forward) => '+',
            Ok(StampStep::ClockSetBack) => '<',
            Ok(StampStep::BeginsAgain) => '@',
            Err(StampFault::Duplicate) => '=',
            Err(StampFault::OutOfOrder) => '-',
        };
        stamps.iter().map(letter).collect()
    }

    #[test]
    fn stamps_must_ascend() {
        assert_eq!(judged(&[10, 20, 20, 15, 30, 5, 4, 40]), "++=-+--+");
    }

    #[test]
    fn zero_stamps_are_not_duplicates() {
        assert_eq!(judged(&[0, 0, 10, 0, 10, 20]), "++++=+");
    }

    /// Stamps of these frames of a recording at 10 Hz.
    fn recorded(frames: impl IntoIterator<Item = i64>) -> Vec<i64> {
        frames.into_iter().map(|frame| 1_000_000_000_000 + frame * 100_000_000).collect()
    }

    #[test]
    fn a_recording_in_a_loop_begins_again_without_a_rejected_frame() {
        let looped = recorded((0..20).chain(0..20).chain(0..20));
        let once = "+".repeat(19);
        assert_eq!(judged(&looped), format!("+{once}@{once}@{once}"));
        let lossy = recorded((0..30).chain(2..29).chain(1..30));
        assert_eq!(judged(&lossy).matches('@').count(), 2, "frames at either end are lost");
        assert_eq!(judged(&lossy).matches('-').count(), 0);
    }

    #[test]
    fn late_and_false_stamps_are_not_a_loop() {
        // From the middle of the first round: the later rounds are recognised.
        let joined = judged(&recorded((30..60).chain(0..60).chain(0..60)));
        assert_eq!((joined.matches('-').count(), joined.matches('@').count()), (3, 1), "{joined}");
        assert_eq!(judged(&recorded((0..9).chain(0..3))), "+++++++++---", "too short to tell");
        for late in 2..=REORDERED as i64 {
            let stamps = recorded((0..12).chain([12 - late, 12, 13]));
            assert_eq!(judged(&stamps), format!("{}-++", "+".repeat(12)), "{late} frames late");
        }
        let mut stamps = recorded(0..40);
        stamps.insert(30, 1);
        assert_eq!(judged(&stamps).matches('-').count(), 1, "far before the first");
        stamps = recorded(0..40);
        stamps.insert(30, i64::MAX);
        assert_eq!(judged(&stamps).matches('@').count(), 0, "far ahead");
        stamps[30] = i64::MIN;
        assert_eq!(judged(&stamps).matches('-').count(), 1);
    }

    #[test]
    fn a_false_stamp_far_ahead_rejects_only_three_frames() {
        assert_eq!(judged(&[1, 2, 1_000_000, 3, 4, 5, 6, 7]), "+++---<+");
        assert_eq!(
            judged(&[90, 80, 70, 60, 50, 40]),
            "+-----",
            "descending stamps are not a clock"
        );
    }
}
