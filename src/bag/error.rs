//! Errors of reading and of writing recordings.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

/// Why a recording, or a part of it, cannot be read.
#[derive(Debug, Error)]
pub enum BagError {
    /// The operating system refuses.
    #[error("{}: {source}", path.display())]
    Io {
        /// File or directory.
        path: PathBuf,
        /// Its reason.
        source: io::Error,
    },
    /// Some other kind of file.
    #[error("{}: not an MCAP file: {why}", path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// What is there instead.
        why: String,
    },
    /// A directory without a recording.
    #[error("{}: holds neither metadata.yaml nor an .mcap file", .0.display())]
    NoBag(PathBuf),
    /// A recording of another kind.
    #[error("{}: {what}; convert it to uncompressed-file MCAP with `ros2 bag convert`", path.display())]
    Unsupported {
        /// The metadata file.
        path: PathBuf,
        /// Its kind.
        what: String,
    },
    /// A path that would leave the bag's directory.
    #[error("{}: relative_file_paths names {entry:?}; only files inside the directory are read", path.display())]
    PathEscapes {
        /// The metadata file.
        path: PathBuf,
        /// The entry.
        entry: String,
    },
    /// A part of the recording is unreadable; reading goes on behind it.
    #[error("{}: damaged at byte {offset}: {what}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where the damage begins, bytes from the start of the file.
        offset: u64,
        /// Where reading goes on, bytes from the start of the file.
        end: u64,
        /// What is wrong.
        what: String,
    },
    /// The index does not fit the file. Everything has been or will be read without it.
    #[error("{}: the index is wrong, reading without it: {what}", path.display())]
    Index {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        what: String,
    },
    /// Chunks overlap so much in time that sorting them would take unbounded memory.
    #[error("{}: from byte {offset} on the messages are not in order of time: chunks overlap by more than {limit_bytes} bytes", path.display())]
    Unsorted {
        /// The file.
        path: PathBuf,
        /// The first chunk that had to wait, bytes from the start of the file.
        offset: u64,
        /// What may wait.
        limit_bytes: usize,
    },
    /// Messages that are not ROS 2's.
    #[error("{topic}: messages are encoded as {encoding:?}, not as \"cdr\" (ROS 2)")]
    Encoding {
        /// The topic.
        topic: String,
        /// What the recording says.
        encoding: String,
    },
}

impl BagError {
    /// True if messages are lost (a wrong index alone loses none).
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

/// Why a bag cannot be written.
#[derive(Debug, Error)]
pub enum RecordError {
    /// The output is there already.
    #[error("{}: exists already; --force replaces a bag", .0.display())]
    Exists(PathBuf),
    /// The output is something that is never replaced.
    #[error("{}: is there and is not a bag; choose another output", .0.display())]
    NotABag(PathBuf),
    /// The output's last component cannot name a bag.
    #[error("{}: does not end in a name for the bag", .0.display())]
    NoName(PathBuf),
    /// The operating system refuses. What was flushed before stays readable.
    #[error("{}: {source}", path.display())]
    Io {
        /// File or directory.
        path: PathBuf,
        /// Its reason.
        source: io::Error,
    },
    /// An earlier call failed; nothing is written any more.
    #[error("{}: nothing more is written after an error", .0.display())]
    Stopped(PathBuf),
    /// One name, two types.
    #[error("{topic}: is recorded as {recorded} and cannot also be {refused}")]
    TopicConflict {
        /// The name.
        topic: String,
        /// Type it has.
        recorded: String,
        /// Type it was to have.
        refused: String,
    },
    /// A time before the epoch, which MCAP cannot represent.
    #[error("{what}: time {time_ns} ns is before 1970")]
    NegativeTime {
        /// Topic or attachment.
        what: String,
        /// The time, nanoseconds since the epoch.
        time_ns: i64,
    },
    /// The format's own limits: 65534 topics.
    #[error("{}: {what}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// What went over them.
        what: String,
    },
}
