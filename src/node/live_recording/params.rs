//! Parameters of a live recording.

use std::path::PathBuf;

use crate::bag::{Compression, SplitLimits};

const MIB: u64 = 1 << 20;

/// Recording parameters of the live node. Changes of the file limits, the minimum free space and the snapshot take
/// effect at once, all others with the next bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordingParams {
    /// Parent directory of the bags; created if missing.
    pub directory: PathBuf,
    /// True if the raw images are also recorded, in a separate bag.
    pub images: bool,
    /// Compression of the results.
    pub compression: Compression,
    /// Compression of the raw images.
    pub image_compression: Compression,
    /// Size at which the next file of a bag is started, bytes; `None` for no limit.
    pub split_bytes: Option<u64>,
    /// Duration after which the next file of a bag is started, seconds; `None` for no limit.
    pub split_seconds: Option<u32>,
    /// Minimum free space, bytes. Below it, running recordings are closed and no recording starts.
    pub min_free_bytes: u64,
    /// Maximum queue for the disk, bytes per recording. Beyond it, the oldest messages are dropped and counted.
    pub queue_bytes: usize,
    /// Duration of a snapshot, seconds; `None` for no snapshot buffer.
    pub snapshot_seconds: Option<u32>,
    /// Maximum size of the snapshot buffer, bytes; 0 for no snapshot buffer.
    pub snapshot_bytes: usize,
}

impl RecordingParams {
    pub(super) fn split_limits(&self) -> SplitLimits {
        SplitLimits {
            bytes: self.split_bytes,
            duration_ns: self.split_seconds.map(|seconds| u64::from(seconds) * 1_000_000_000),
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
            split_bytes: Some(4096 * MIB),
            split_seconds: Some(3600),
            min_free_bytes: 1024 * MIB,
            queue_bytes: 64 << 20,
            snapshot_seconds: Some(10),
            snapshot_bytes: 64 << 20,
        }
    }
}
