//! Frames that wait for a sample behind them. Bounded; in the order in which they came.

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

use crate::node::unpack::Unpacked;

use super::Positions;

/// What waits takes no more memory than this, bytes.
const MAX_BYTES: usize = 256 << 20;
/// Messages of two topics may overtake one another on their way by so much: what came in time is not given up.
const OVERTAKING: Duration = Duration::from_millis(100);

/// What waits.
pub(in crate::node) enum Arrival {
    /// A frame.
    Frame(Unpacked),
    /// What the middleware could not hand on.
    Fault(String),
}

/// Something that waits, and what is known of it.
pub(in crate::node) struct Held {
    /// The frame.
    pub(in crate::node) arrival: Arrival,
    /// Frames that a full queue dropped before it.
    pub(in crate::node) num_dropped: u32,
    /// Its stamp, nanoseconds; `None`: it can have no position.
    pub(in crate::node) stamp_ns: Option<i64>,
    /// When it was received, nanoseconds.
    pub(in crate::node) received_ns: i64,
    /// The same by a clock that never jumps.
    pub(in crate::node) since: Instant,
}

/// What time it is for those that wait.
#[derive(Clone, Copy, Debug)]
pub(in crate::node) enum Now {
    /// A message was received at that time, nanoseconds.
    Received(i64),
    /// Nothing has come.
    Tick(Instant),
    /// Nothing more will come.
    End,
}

/// Those that wait.
#[derive(Default)]
pub(in crate::node) struct Waiting {
    held: VecDeque<Held>,
    num_bytes: usize,
}

impl Held {
    fn num_bytes(&self) -> usize {
        match &self.arrival {
            Arrival::Frame(frame) => frame.message.data.len(),
            Arrival::Fault(what) => what.len(),
        }
    }

    fn is_given_up(&self, positions: &Positions, now: Now) -> bool {
        let Some(patience_ns) = positions.patience_ns() else {
            return matches!(now, Now::End);
        };
        let patience = Duration::from_nanos(patience_ns.unsigned_abs()).saturating_add(OVERTAKING);
        match now {
            Now::Received(now_ns) => {
                let waited_ns = now_ns.saturating_sub(self.received_ns);
                u64::try_from(waited_ns).is_ok_and(|ns| Duration::from_nanos(ns) > patience)
            }
            Now::Tick(now) => now.saturating_duration_since(self.since) > patience,
            Now::End => true,
        }
    }
}

impl Waiting {
    /// Lets something wait behind the others.
    pub(in crate::node) fn push(&mut self, held: Held) {
        self.num_bytes += held.num_bytes();
        self.held.push_back(held);
    }

    /// How many wait.
    pub(in crate::node) fn len(&self) -> usize {
        self.held.len()
    }

    /// The first one, when it need not or must not wait any longer.
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
