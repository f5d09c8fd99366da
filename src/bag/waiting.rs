//! Items that wait for their turn in the order of time.

use std::cmp::Ordering;

use super::{BagError, RawMessage};

/// Position of an item in the output order. The fields are compared one after another.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Turn {
    /// Nanoseconds since the epoch.
    pub(super) time: u64,
    /// Start of the part, bytes from the start of the file.
    pub(super) offset: u64,
    /// Number within the part.
    pub(super) number: u64,
}

impl Turn {
    /// The first item of the part at `offset`.
    pub(super) const fn first(time: u64, offset: u64) -> Self {
        Self { time, offset, number: 0 }
    }
}

/// A buffered item: a message as the file holds it and its channel, or an error in the place of missing messages.
pub(super) struct Waiting {
    pub(super) turn: Turn,
    pub(super) item: Result<(u16, RawMessage), BagError>,
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.turn == other.turn
    }
}
impl Eq for Waiting {}
impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        self.turn.cmp(&other.turn)
    }
}
