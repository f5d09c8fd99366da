//! Status of recordings for diagnostics and services.

use std::path::PathBuf;

use crate::node::statistics::Failures;

/// Status of all recordings of a camera.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct RecordingStatus {
    /// Bag of the results.
    pub(crate) results: BagStatus,
    /// Bag of the raw images.
    pub(crate) images: BagStatus,
    /// Bags of the last snapshot, which may still be being written.
    pub(crate) snapshot: BagStatus,
    /// Recordings and snapshots that failed since the node started.
    pub(crate) failures: Failures,
}

impl RecordingStatus {
    /// True if anything except a snapshot is being recorded.
    pub(crate) const fn is_recording(&self) -> bool {
        self.results.is_recording || self.images.is_recording
    }
}

/// Status of the current or last bag.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BagStatus {
    /// True if it accepts messages.
    pub(crate) is_recording: bool,
    /// True if it has ended but its last messages or its index are not yet written.
    pub(crate) is_ending: bool,
    /// Directory; `None` before the first bag.
    pub(crate) directory: Option<PathBuf>,
    /// Size of the files, bytes; the last half second may be missing.
    pub(crate) bytes: u64,
    /// Number of messages in the bag.
    pub(crate) messages: u64,
    /// Number of messages dropped on their way into bags of this kind since the node started, because the disk was too
    /// slow or failed, or because their time cannot be stored. After a failure, all messages count until the recording
    /// is stopped or started again.
    pub dropped: u64,
    /// Error that prevented or ended the last recording; `None` again when one starts.
    pub last_error: Option<String>,
}
