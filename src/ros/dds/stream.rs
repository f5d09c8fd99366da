//! A stream of messages that stops although its publisher is matched.
//!
//! A publisher that was stopped for longer than the node's lease (a suspended machine, a debugger) forgets the node. When
//! it continues, it discovers the node anew, but RustDDS 0.15.1 does not introduce its readers again: they stay matched
//! here and receive nothing. Nothing distinguishes that from a camera that pauses, so a stream that stops is a reason to
//! join anew, once: while no messages come, that costs none.

use std::{
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

/// Largest interval between the messages of a stream.
const MAX_INTERVAL: Duration = Duration::from_secs(1);
/// Messages at such intervals that make a stream.
const MIN_MESSAGES: u32 = 10;
/// Silence after which a stream has stopped.
const SILENCE: Duration = Duration::from_secs(10);

/// The arrivals of one subscription.
#[derive(Default)]
pub(super) struct Stream(Mutex<Option<Arrivals>>);

struct Arrivals {
    last: Instant,
    /// Messages so far without a longer interval.
    num_steady: u32,
}

impl Stream {
    /// Notes a message that arrived at `now`.
    pub(super) fn note(&self, now: Instant) {
        let mut arrivals = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let num_steady = match &*arrivals {
            Some(before) if now.duration_since(before.last) <= MAX_INTERVAL => {
                before.num_steady.saturating_add(1)
            }
            _ => 1,
        };
        *arrivals = Some(Arrivals { last: now, num_steady });
    }

    /// True if messages came steadily, and none came for a while before `now`.
    pub(super) fn has_stopped(&self, now: Instant) -> bool {
        let arrivals = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        arrivals.as_ref().is_some_and(|arrivals| {
            arrivals.num_steady >= MIN_MESSAGES && now.duration_since(arrivals.last) > SILENCE
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_steady_stream_stops() {
        let start = Instant::now();
        let stream = Stream::default();
        assert!(!stream.has_stopped(start + SILENCE * 2), "nothing ever came");
        for seconds in 0..20 {
            stream.note(start + Duration::from_secs(2 * seconds));
        }
        let last = start + Duration::from_secs(38);
        assert!(!stream.has_stopped(last + SILENCE * 2), "a triggered camera");
        for step in 1..MIN_MESSAGES {
            assert!(!stream.has_stopped(last + SILENCE * 2), "{step} messages");
            stream.note(last + MAX_INTERVAL * step);
        }
        let last = last + MAX_INTERVAL * (MIN_MESSAGES - 1);
        assert!(!stream.has_stopped(last + SILENCE));
        assert!(stream.has_stopped(last + SILENCE + Duration::from_millis(1)));
    }
}
