//! Places of a recording that cannot be read, as `info` and `recover` report them.

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use super::BagError;
use super::unpack::size_bytes;

/// A range of a file that was skipped.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct DamagedRange {
    /// The file.
    pub(crate) file: PathBuf,
    /// Start, bytes from the start of the file.
    pub(crate) offset: u64,
    /// End (exclusive), bytes from the start of the file.
    pub(crate) end: u64,
    /// Description of the damage.
    pub(crate) what: String,
}

impl DamagedRange {
    /// Returns the damaged range that an error reports; `None` for any other error.
    pub(super) fn of(error: &BagError) -> Option<Self> {
        let (file, offset, end, what) = match error {
            BagError::Damaged { path, offset, end, what } => (path, *offset, *end, what),
            BagError::Lost { path, why } | BagError::Picture { path, why } => {
                (path, 0, size_bytes(path), why)
            }
            _ => return None,
        };
        Some(Self { file: file.clone(), offset, end, what: what.clone() })
    }
}

impl fmt::Display for DamagedRange {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, offset, end, what } = self;
        let file = file.display();
        if end > offset && *offset > 0 {
            write!(out, "{file}: bytes {offset} to {end}: {what}")
        } else if *offset > 0 {
            write!(out, "{file}: byte {offset}: {what}")
        } else {
            write!(out, "{file}: {what}")
        }
    }
}
