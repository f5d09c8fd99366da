//! Why a recording does not begin, or ended before it was asked to.

use std::{io, path::PathBuf};

use thiserror::Error;

use crate::bag::RecordError;

/// The reason that recording failed. The text names the file, the reason and the remedy.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The disk refuses.
    #[error(
        "recording failed: {0}; what was written before can be read: free the disk or set another recording.directory, \
         then record again"
    )]
    Write(#[from] RecordError),
    /// The disk is nearly full.
    #[error(
        "no recording onto a nearly full disk: {} has {free_bytes} bytes free, less than recording.min_free_bytes \
         {min_free_bytes}; what was recorded is whole: free some space or set another recording.directory, then record \
         again", directory.display()
    )]
    LowSpace {
        /// Where it records.
        directory: PathBuf,
        /// Free space, bytes.
        free_bytes: u64,
        /// Space that must stay free, bytes.
        min_free_bytes: u64,
    },
    /// The operating system refuses something else.
    #[error("recording into {}: {source}; set another recording.directory or record again", directory.display())]
    System {
        /// Where it records.
        directory: PathBuf,
        /// Its reason.
        source: io::Error,
    },
    /// The command is still in progress.
    #[error("{}: is still being written; ask for the status and wait", .0.display())]
    StillWriting(PathBuf),
    /// Nothing is kept for a snapshot.
    #[error(
        "no snapshot: nothing is kept for one; set recording.snapshot_seconds and recording.snapshot_bytes above 0"
    )]
    SnapshotOff,
    /// Nothing came yet.
    #[error("no snapshot: nothing was sent in the last {0} seconds (recording.snapshot_seconds)")]
    SnapshotEmpty(u32),
}
