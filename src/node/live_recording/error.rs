//! Errors that prevent or end a recording.

use std::{io, path::PathBuf};

use thiserror::Error;

use crate::bag::RecordError;

/// Error of a recording. The text names the file, the reason and the remedy.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// Writing failed.
    #[error(
        "recording failed: {0}; earlier messages stay readable; free the disk or set another recording.directory, \
         then record again"
    )]
    Write(#[from] RecordError),
    /// The disk is nearly full.
    #[error(
        "the disk is nearly full: {} has {free_bytes} bytes free; {needed_bytes} more would leave less than \
         recording.min_free_bytes {min_free_bytes}; existing recordings are complete; free some space or set another recording.directory, then \
         record again", directory.display()
    )]
    LowSpace {
        /// Directory of the recording.
        directory: PathBuf,
        /// Free space, bytes.
        free_bytes: u64,
        /// Space for the next message and for the end of the bag, bytes.
        needed_bytes: u64,
        /// Space that must stay free, bytes.
        min_free_bytes: u64,
    },
    /// Another operation of the system failed.
    #[error("recording into {}: {source}; set another recording.directory or record again", directory.display())]
    System {
        /// Directory of the recording.
        directory: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// The thread that writes has panicked.
    #[error(
        "recording into {}: its thread ended by a programming error; messages of the last second may be missing; record \
         again", .0.display()
    )]
    Panicked(PathBuf),
    /// The command is still in progress.
    #[error("{}: is still being written; wait and query the status", .0.display())]
    StillWriting(PathBuf),
    /// The snapshot buffer is off.
    #[error(
        "no snapshot: the snapshot buffer is off; set recording.snapshot_seconds and recording.snapshot_bytes above 0"
    )]
    SnapshotOff,
    /// The snapshot buffer is empty.
    #[error("no snapshot: nothing was sent in the last {0} seconds (recording.snapshot_seconds)")]
    SnapshotEmpty(u32),
}

impl RecordingError {
    /// True if data is lost; false if the command was refused or is still in progress.
    pub(super) const fn is_failure(&self) -> bool {
        match self {
            Self::Write(_) | Self::LowSpace { .. } | Self::System { .. } | Self::Panicked(_) => {
                true
            }
            Self::StillWriting(_) | Self::SnapshotOff | Self::SnapshotEmpty(_) => false,
        }
    }
}
