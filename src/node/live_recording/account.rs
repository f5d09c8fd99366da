//! The losses of recordings since the node started.

use std::sync::{
    Mutex,
    atomic::{AtomicU64, Ordering},
};

use super::lock;
use crate::node::statistics::Failures;

/// Sums over all recordings of a kind.
#[derive(Debug, Default)]
pub(super) struct Account {
    dropped: AtomicU64,
    failures: Mutex<Failures>,
}

impl Account {
    /// Counts messages that are in no bag.
    pub(super) fn count_dropped(&self, num: u64) {
        self.dropped.fetch_add(num, Ordering::Relaxed);
    }

    /// Counts a failed recording.
    pub(super) fn count_failure(&self, reason: &str) {
        lock(&self.failures).add(&Failures { num: 1, first: Some(reason.to_owned()) });
    }

    pub(super) fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }

    pub(super) fn failures(&self) -> Failures {
        lock(&self.failures).clone()
    }
}
