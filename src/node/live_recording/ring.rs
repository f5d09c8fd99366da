//! Ring buffer of the last seconds of all messages, for snapshots.

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

use super::tap::Tapped;

/// Messages of the last seconds, also bounded in bytes.
#[derive(Debug, Default)]
pub(super) struct Ring {
    duration: Duration,
    max_bytes: usize,
    messages: VecDeque<(Instant, Tapped)>,
    bytes: usize,
}

impl Ring {
    /// Changes the bounds and discards messages beyond them.
    pub(super) fn set_bounds(&mut self, seconds: u32, max_bytes: usize) {
        self.duration = Duration::from_secs(seconds.into());
        // A zero duration or size turns the buffer off, so that not even empty messages are kept.
        self.max_bytes = if self.duration.is_zero() { 0 } else { max_bytes };
        self.make_room(0);
    }

    /// True if the buffer never stores a message.
    pub(super) const fn is_off(&self) -> bool {
        self.max_bytes == 0
    }

    /// Keeps a message sent at `now`.
    pub(super) fn push(&mut self, now: Instant, message: Tapped) {
        self.discard_old(now);
        let bytes = message.message.data.len();
        if self.is_off() || bytes > self.max_bytes {
            return;
        }
        self.make_room(bytes);
        self.bytes += bytes;
        self.messages.push_back((now, message));
    }

    /// Returns the messages of the last seconds in order. The bytes are shared.
    pub(super) fn messages(&mut self, now: Instant) -> Vec<Tapped> {
        self.discard_old(now);
        self.messages.iter().map(|(_, message)| message.clone()).collect()
    }

    fn discard_old(&mut self, now: Instant) {
        let duration = self.duration;
        let is_old = |&(sent, _): &(Instant, _)| now.duration_since(sent) > duration;
        while self.messages.front().is_some_and(is_old) {
            self.discard_oldest();
        }
    }

    /// Discards the oldest messages until `bytes` more fit.
    fn make_room(&mut self, bytes: usize) {
        let is_full =
            |ring: &Self| ring.is_off() || ring.bytes.saturating_add(bytes) > ring.max_bytes;
        while !self.messages.is_empty() && is_full(self) {
            self.discard_oldest();
        }
    }

    fn discard_oldest(&mut self) {
        if let Some((_, oldest)) = self.messages.pop_front() {
            self.bytes -= oldest.message.data.len();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::live_recording::tests::tapped;

    fn sequences(ring: &mut Ring, now: Instant) -> Vec<u32> {
        ring.messages(now).iter().map(|message| message.message.sequence).collect()
    }

    #[test]
    fn keeps_the_last_seconds() {
        let mut ring = Ring::default();
        ring.set_bounds(2, 1000);
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        for (sequence, ms) in [(1, 0), (2, 900), (3, 1800), (4, 2600)] {
            ring.push(at(ms), tapped(0, sequence, 10));
        }
        assert_eq!(sequences(&mut ring, at(2600)), [2, 3, 4]);
        assert_eq!(sequences(&mut ring, at(4000)), [4], "time passes without messages, too");
    }

    #[test]
    fn keeps_no_more_bytes_than_allowed() {
        let mut ring = Ring::default();
        ring.set_bounds(60, 100);
        let now = Instant::now();
        for sequence in 1..=4 {
            ring.push(now, tapped(0, sequence, 40));
        }
        ring.push(now, tapped(0, 5, 101));
        assert_eq!(
            sequences(&mut ring, now),
            [3, 4],
            "a message that never fits displaces nothing"
        );
        ring.set_bounds(60, 79);
        assert_eq!(sequences(&mut ring, now), [4]);
        ring.set_bounds(0, 100);
        ring.push(now, tapped(0, 6, 1));
        assert!(ring.is_off());
        assert_eq!(sequences(&mut ring, now), [0; 0]);
    }
}
