//! Recording while live: the results, and the raw images when asked, each in a bag of its own.
//!
//! What the node sends passes the tap, which never waits: it remembers the last seconds and the latched messages, and
//! hands each message to the queue of the recording that is on. Behind that queue a thread of each recording waits for
//! the disk. When it cannot keep up, the oldest waiting messages are dropped and counted; when the disk fails, that
//! recording ends and says why, and the node goes on.

pub(crate) mod params;
pub(crate) mod error;
pub(crate) mod status;
pub(crate) mod control;
mod place;
mod ring;
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

/// Every change under these locks is complete in itself, so the state of a panicked holder is sound.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;
