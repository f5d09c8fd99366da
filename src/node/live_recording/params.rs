//! Parameters of a live recording.

use std::path::PathBuf;

use crate::bag::{Compression, SplitLimits};

const MIB: u64 = 1 << 20;

/// How the live node records. A change holds from the next bag on, but for the limits of a file, the free space and
/// the snapshot, which hold at once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordingParams {
    /// Where bags are put; made when it is missing.
    pub directory: PathBuf,
    /// True if the raw images are also recorded, in a separate bag.
    pub images: bool,
    /// Compression of the results.
    pub compression: Compression,
    /// Compression of the raw images.
    pub image_compression: Compression,
    /// Length of a file after which the next one of the bag begins, bytes; 0: no limit.
    pub split_bytes: u64,
    /// Time that a file spans before the next one begins, seconds; 0: no limit.
    pub split_seconds: u32,
    /// Free space at which a recording ends in good order, and below which none begins, bytes.
    pub min_free_bytes: u64,
    /// Maximum queue for the disk, bytes per recording. Beyond it, the oldest messages are dropped and counted.
    pub queue_bytes: usize,
    /// Duration of a snapshot, seconds; 0: no snapshot buffer.
    pub snapshot_seconds: u32,
    /// Maximum size of the snapshot buffer, bytes; 0: no snapshot buffer.
    pub snapshot_bytes: usize,
}

impl RecordingParams {
    pub(super) const fn split_limits(&self) -> SplitLimits {
        SplitLimits {
            bytes: self.split_bytes,
            duration_ns: self.split_seconds as u64 * 1_000_000_000,
        }
    }
}

impl Default for RecordingParams {
    fn default() -> Self {
        Self {
            directory: PathBuf::from("."),
            images: false,
            compression: Compression::Zstd,
            image_compression: Compression::None,
            split_bytes: 4096 * MIB,
            split_seconds: 3600,
            min_free_bytes: 1024 * MIB,
            queue_bytes: 64 << 20,
            snapshot_seconds: 10,
            snapshot_bytes: 64 << 20,
        }
    }
}
