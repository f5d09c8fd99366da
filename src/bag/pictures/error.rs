//! Errors of reading pictures as a recording.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use crate::msg::convert::file_kind::KINDS;

/// The reason that pictures cannot be read as a recording.
#[derive(Debug, Error)]
pub enum PictureError {
    /// Input failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// File or directory.
        path: PathBuf,
        /// Cause.
        source: io::Error,
    },
    /// A folder has neither a recording nor pictures.
    #[error("{}: holds neither metadata.yaml nor an .mcap file, nor pictures ({KINDS}){others}", folder.display())]
    NoPictures {
        /// The folder.
        folder: PathBuf,
        /// Its content.
        others: String,
    },
    /// No picture can be read.
    #[error("none of the pictures can be read ({num}); {}: {why}", first.display())]
    NoneReadable {
        /// How many there are.
        num: usize,
        /// The first one.
        first: PathBuf,
        /// Why that one cannot be read.
        why: String,
    },
    /// No file matches a pattern.
    #[error("{0}: no file has such a name")]
    NoMatch(String),
    /// A pattern matches several inputs where one is read.
    #[error("{pattern}: matches {matches}; name one of them")]
    SeveralMatches {
        /// The pattern.
        pattern: String,
        /// Their number and the first of them.
        matches: String,
    },
    /// A pattern cannot be understood.
    #[error("{pattern}: {why}")]
    Pattern {
        /// The pattern.
        pattern: String,
        /// Reason.
        why: String,
    },
    /// The table of stamps and positions is wrong.
    #[error("{}, line {line}: {what}", path.display())]
    Table {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// Description of the fault.
        what: String,
    },
    /// A video cannot be read.
    #[error("{}: {why}", path.display())]
    Video {
        /// The file.
        path: PathBuf,
        /// Reason.
        why: String,
    },
    /// The program that reads videos is missing.
    #[error(
        "{}: videos are read through the programs ffmpeg and ffprobe, which are not installed; install them with \
         `sudo apt install ffmpeg` (Debian, Ubuntu), `sudo dnf install ffmpeg-free` (Fedora) or `brew install ffmpeg` (macOS)",
        path.display()
    )]
    NoFfmpeg {
        /// The video.
        path: PathBuf,
    },
    /// A table was given for a video, whose frames have no names.
    #[error(
        "{}: --positions names pictures, and the frames of a video have no names; make pictures of it with \
         `ffmpeg -i VIDEO FOLDER/%06d.png`",
        .0.display()
    )]
    TableOfVideo(PathBuf),
    /// A frame rate or a table was given, but there are no pictures.
    #[error(
        "--frame-rate and --positions are for pictures, but the inputs are recordings, which have stamps of their own"
    )]
    NotPictures,
    /// One table was given for several series of pictures.
    #[error(
        "--positions belongs to one series of pictures, but there are {0}: take them one by one"
    )]
    SeveralSeries(usize),
}

impl PictureError {
    /// True if the request is wrong, rather than a file.
    pub(crate) const fn is_usage(&self) -> bool {
        matches!(
            self,
            Self::NotPictures
                | Self::SeveralSeries(_)
                | Self::TableOfVideo(_)
                | Self::SeveralMatches { .. }
                | Self::Pattern { .. }
        )
    }
}
