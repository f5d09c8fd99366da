//! Live recording of the results and, on request, the raw images, each in a bag of its own.
//!
//! Every message of the node passes through the tap, which never blocks: it keeps the last seconds and the latched
//! messages, and pushes each message to the queue of the running recording. Each recording has a thread that writes its
//! queue to the disk. If the disk cannot keep up, the oldest queued messages are dropped and counted. If the disk
//! fails, the recording ends and reports the reason; the node continues.

pub(crate) mod params;
pub(crate) mod error;
pub(crate) mod status;
pub(crate) mod control;
mod account;
mod place;
mod ring;
mod space;
mod tap;
mod sync;
mod session;
mod writer;
mod snapshot;

pub use control::{LiveRecorder, RecordedTopics, RecordingControl};
pub(crate) use error::RecordingError;
pub use params::RecordingParams;
pub(crate) use place::free_bytes;
pub(crate) use status::{BagStatus, RecordingStatus};

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Locks a mutex even if a holder panicked: every change under these locks is complete, so the state stays valid.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;
