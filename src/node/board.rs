//! The last report of a worker, for readers in the same process.

use std::sync::{Arc, Mutex, PoisonError};

use super::{statistics::Counts, status::Load};

/// The last report of a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Reported {
    /// Counters since the node started.
    pub(crate) counts: Counts,
    /// Frames received per second, over the last interval.
    pub(crate) rate_hz: f32,
    /// Latency and queue over the last interval.
    pub(crate) load: Load,
}

/// Holds the last report. Clones share it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Board(Arc<Mutex<Reported>>);

impl Board {
    /// Replaces the report.
    pub(crate) fn write(&self, reported: &Reported) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = *reported;
    }

    /// Returns the last report; all zero before the first one.
    pub(crate) fn read(&self) -> Reported {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
