//! Errors of reading and of writing recordings.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use super::pictures::PictureError;

/// Error of reading a recording or a part of it.
#[derive(Debug, Error)]
pub enum BagError {
    /// Input or output failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// File or directory.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// The file is not an MCAP file.
    #[error("{}: {why}", path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// Reason.
        why: String,
    },
    /// The directory holds no recording.
    #[error("{}: holds neither metadata.yaml nor an .mcap file; if it holds pictures, replay them first", .0.display())]
    NoBag(PathBuf),
    /// No file of the recording can be read.
    #[error("{}: none of its files can be read: {why}", path.display())]
    NothingReadable {
        /// The directory.
        path: PathBuf,
        /// The files with their reasons, and the command that converts them if there is one.
        why: String,
    },
    /// A file of the recording is missing or unreadable; reading continues with the next one.
    #[error("{}: {why}", path.display())]
    Lost {
        /// The file.
        path: PathBuf,
        /// Reason.
        why: String,
    },
    /// A part of the recording is unreadable; reading continues after it.
    #[error("{}: damaged at byte {offset}: {what}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Start of the damage, bytes from the start of the file.
        offset: u64,
        /// Position at which reading continues, bytes from the start of the file.
        end: u64,
        /// Description of the damage.
        what: String,
    },
    /// The index contradicts the file. The whole file is read without it.
    #[error("{}: the index is wrong, reading without it: {what}", path.display())]
    Index {
        /// The file.
        path: PathBuf,
        /// Description of the contradiction.
        what: String,
    },
    /// Chunks overlap so much in time that sorting them would take unbounded memory.
    #[error("{}: messages from byte {offset} on are not in time order: chunks overlap by more than {limit_bytes} bytes", path.display())]
    Unsorted {
        /// The file.
        path: PathBuf,
        /// Start of the first chunk that is read too late, bytes from the start of the file.
        offset: u64,
        /// Limit on the size of the buffered messages, bytes.
        limit_bytes: usize,
    },
    /// A picture of a series cannot be used; the series continues after it.
    #[error("{}: {why}", path.display())]
    Picture {
        /// The file.
        path: PathBuf,
        /// Reason.
        why: String,
    },
    /// Pictures cannot be read as a recording.
    #[error(transparent)]
    Pictures(#[from] PictureError),
    /// The messages are not encoded as ROS 2 encodes them.
    #[error("{topic}: messages are encoded as {encoding:?}, not as \"cdr\" (ROS 2)")]
    Encoding {
        /// The topic.
        topic: String,
        /// Encoding stated by the recording.
        encoding: String,
    },
}

impl BagError {
    /// True if messages are lost. A wrong index alone loses none.
    pub(crate) fn is_loss(&self) -> bool {
        !matches!(self, Self::Index { .. } | Self::Unsorted { .. })
    }
}

/// Reason why a place in a file cannot be used.
pub(super) enum Fault {
    /// The operating system reports an error.
    Io(BagError),
    /// The content is malformed.
    Malformed(String),
}

impl From<BagError> for Fault {
    fn from(error: BagError) -> Self {
        Self::Io(error)
    }
}

impl From<String> for Fault {
    fn from(what: String) -> Self {
        Self::Malformed(what)
    }
}

/// Error of writing a bag.
#[derive(Debug, Error)]
pub enum RecordError {
    /// The output exists already.
    #[error("{}: exists already; --force replaces a bag", .0.display())]
    Exists(PathBuf),
    /// The output exists and is not a bag of this program, so it is never replaced.
    #[error("{}: exists and is not a bag of this program; choose another output", .0.display())]
    NotABag(PathBuf),
    /// The output's last component cannot name a bag.
    #[error("{}: the last component of the path is not a usable bag name", .0.display())]
    NoName(PathBuf),
    /// Input or output failed. Flushed messages stay readable.
    #[error("{}: {source}", path.display())]
    Io {
        /// File or directory.
        path: PathBuf,
        /// Its reason.
        source: io::Error,
    },
    /// An earlier call failed; the recorder writes nothing more.
    #[error("{}: nothing more is written after an error", .0.display())]
    Stopped(PathBuf),
    /// A topic name is used with two types.
    #[error("{topic}: is recorded as {recorded}, so {refused} is rejected")]
    TopicConflict {
        /// The name.
        topic: String,
        /// Recorded type.
        recorded: String,
        /// Rejected type.
        refused: String,
    },
    /// A time is before the epoch; MCAP cannot represent it.
    #[error("{what}: time {time_ns} ns is before 1970")]
    NegativeTime {
        /// Topic or attachment.
        what: String,
        /// The time, nanoseconds since the epoch.
        time_ns: i64,
    },
    /// The content cannot be represented in the format (for example more than 65534 topics).
    #[error("{}: {what}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Description of the problem.
        what: String,
    },
}
