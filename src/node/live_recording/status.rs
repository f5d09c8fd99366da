//! Status of recordings for diagnostics and services.

use std::path::PathBuf;

/// All recordings of the node.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct RecordingStatus {
    /// The results' bag.
    pub(crate) results: BagStatus,
    /// The raw images' bag.
    pub(crate) images: BagStatus,
    /// The snapshot: the one that is being written, or the last.
    pub(crate) snapshot: BagStatus,
}

impl RecordingStatus {
    /// True if anything except a snapshot is being recorded.
    pub(crate) const fn is_recording(&self) -> bool {
        self.results.is_recording || self.images.is_recording
    }
}

/// A bag that is being recorded, or was the last one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BagStatus {
    /// True if it accepts messages.
    pub(crate) is_recording: bool,
    /// True if it has ended but its last messages or its index are not yet written.
    pub(crate) is_ending: bool,
    /// Its directory; `None` before the first one.
    pub(crate) directory: Option<PathBuf>,
    /// Length of its files, bytes; the last half second may be missing.
    pub(crate) bytes: u64,
    /// Messages in it.
    pub(crate) messages: u64,
    /// Messages that were lost on their way into a bag of this kind since the node started: the disk was too slow, it
    /// failed, or their time cannot be stored.
    pub dropped: u64,
    /// Why the last recording ended unasked, or did not begin; `None` again when one begins.
    pub last_error: Option<String>,
}
