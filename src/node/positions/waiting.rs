//! A bounded queue of frames that wait for the next sample of the axis, in order of arrival.

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

use crate::node::unpack::Unpacked;

use super::Positions;

/// Upper bound of the memory of waiting messages, bytes.
const MAX_BYTES: usize = 256 << 20;
/// Tolerance for messages of two topics that overtake each other in transport, so that samples in time are not missed.
const OVERTAKING: Duration = Duration::from_millis(100);

/// A frame or a fault in order of arrival.
pub(in crate::node) enum Arrival {
    /// A frame.
    Frame(Unpacked),
    /// A message that the middleware could not deliver.
    Fault(String),
}

impl Arrival {
    /// Time of reception, nanoseconds; `None` for a fault.
    pub(in crate::node) fn received_ns(&self) -> Option<i64> {
        match self {
            Self::Frame(frame) => Some(frame.message.log_time_ns),
            Self::Fault(_) => None,
        }
    }
}

/// A waiting arrival.
pub(in crate::node) struct Held {
    /// The frame or fault.
    pub(in crate::node) arrival: Arrival,
    /// Frames that a full queue dropped before it.
    pub(in crate::node) num_dropped: u32,
    /// Stamp, nanoseconds; `None`: it cannot have a position.
    pub(in crate::node) stamp_ns: Option<i64>,
    /// Time of reception, nanoseconds.
    pub(in crate::node) received_ns: i64,
    /// Time of reception by a monotonic clock.
    pub(in crate::node) since: Instant,
}

/// The current time, by which waiting frames are released.
#[derive(Clone, Copy, Debug)]
pub(in crate::node) enum Now {
    /// A message was received at that time, nanoseconds.
    Received(i64),
    /// Time passed without a message.
    Tick(Instant),
    /// No more messages will arrive.
    End,
}

/// The queue of waiting arrivals.
#[derive(Default)]
pub(in crate::node) struct Waiting {
    held: VecDeque<Held>,
    num_bytes: usize,
}

impl Held {
    /// Size of the message, bytes.
    pub(in crate::node) fn num_bytes(&self) -> usize {
        match &self.arrival {
            Arrival::Frame(frame) => frame.message.data.len(),
            Arrival::Fault(what) => what.len(),
        }
    }

    /// Time since its reception; `None` if no more messages will arrive.
    pub(in crate::node) fn waited(&self, now: Now) -> Option<Duration> {
        match now {
            Now::Received(now_ns) => {
                let waited_ns = now_ns.saturating_sub(self.received_ns);
                Some(Duration::from_nanos(u64::try_from(waited_ns).unwrap_or(0)))
            }
            Now::Tick(now) => Some(now.saturating_duration_since(self.since)),
            Now::End => None,
        }
    }

    fn is_given_up(&self, positions: &Positions, now: Now) -> bool {
        let Some(waited) = self.waited(now) else { return true };
        positions.timeout_ns().is_some_and(|timeout_ns| {
            let timeout = Duration::from_nanos(timeout_ns.unsigned_abs());
            waited > timeout.saturating_add(OVERTAKING)
        })
    }
}

impl Waiting {
    /// Appends an arrival.
    pub(in crate::node) fn push(&mut self, held: Held) {
        self.num_bytes += held.num_bytes();
        self.held.push_back(held);
    }

    /// Number of waiting arrivals.
    pub(in crate::node) fn len(&self) -> usize {
        self.held.len()
    }

    /// Removes and returns the first arrival if it need not or must not wait any longer.
    pub(in crate::node) fn next(&mut self, positions: &Positions, now: Now) -> Option<Held> {
        let first = self.held.front()?;
        let is_full = self.held.len() > positions.max_wait_frames() || self.num_bytes > MAX_BYTES;
        let is_known = first.stamp_ns.is_none_or(|stamp_ns| positions.has_reached(stamp_ns));
        if !(is_known || is_full || first.is_given_up(positions, now)) {
            return None;
        }
        let first = self.held.pop_front()?;
        self.num_bytes -= first.num_bytes();
        Some(first)
    }
}
