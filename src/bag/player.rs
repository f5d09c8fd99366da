//! Pacing of playback: the wait before each message. The caller supplies the time; nothing here sleeps.

use std::time::Duration;

use thiserror::Error;

/// An invalid playback rate.
#[derive(Debug, Error, PartialEq)]
#[error("rate {0}: must be a number above 0 (1 is the speed of the recording)")]
pub(crate) struct RateError(f64);

/// Paces messages: the first message is due at once, every later one after its time difference from the first, divided
/// by the rate.
#[derive(Debug)]
pub(crate) struct Pacer {
    rate: f64,
    /// Message time and clock time of the first message.
    start_ns: Option<(i64, i64)>,
}

impl Pacer {
    /// Returns a pacer at `rate` times the speed of the recording.
    ///
    /// # Errors
    /// The rate is not a positive finite number.
    pub(crate) fn new(rate: f64) -> Result<Self, RateError> {
        if rate.is_finite() && rate > 0.0 {
            Ok(Self { rate, start_ns: None })
        } else {
            Err(RateError(rate))
        }
    }

    /// Returns the wait from `now_ns` (any monotonic clock) until the message of `message_time_ns` is due; `None` if it
    /// is due. A late message does not delay later ones; a message out of order is due at once.
    pub(crate) fn wait(&mut self, message_time_ns: i64, now_ns: i64) -> Option<Duration> {
        let (first_ns, start_ns) = *self.start_ns.get_or_insert((message_time_ns, now_ns));
        let recorded_ns = i128::from(message_time_ns) - i128::from(first_ns);
        let due_ns = recorded_ns as f64 / self.rate;
        let elapsed_ns = i128::from(now_ns) - i128::from(start_ns);
        let wait_ns = due_ns - elapsed_ns as f64;
        if wait_ns < 1.0 { None } else { Some(Duration::from_nanos(wait_ns as u64)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    #[test]
    fn every_message_waits_for_its_time_after_the_first() {
        let mut pacer = Pacer::new(2.0).unwrap();
        let waits: Vec<_> =
            [(5_000, 100), (5_040, 100), (5_040, 120), (5_100, 130), (5_060, 140), (5_300, 500)]
                .iter()
                .map(|&(message_ms, now_ms)| {
                    pacer.wait(message_ms * MS, now_ms * MS).map(|wait| wait.as_millis())
                })
                .collect();
        assert_eq!(waits, [None, Some(20), None, Some(20), None, None]);
    }

    #[test]
    fn extreme_times_do_not_overflow() {
        let mut pacer = Pacer::new(1e-3).unwrap();
        assert_eq!(pacer.wait(i64::MIN, i64::MAX), None);
        assert!(pacer.wait(i64::MAX, i64::MIN).is_some());
    }

    #[test]
    fn a_rate_is_a_positive_number() {
        for rate in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Pacer::new(rate).unwrap_err().to_string().contains("must be a number above 0"));
        }
    }
}
