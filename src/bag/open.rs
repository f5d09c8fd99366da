//! Opens the files of a bag, compressed ones by their content.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::BagError;
use super::format::Source;
use super::kind::Kind;
use super::unpack::{Unpacked, unpack};

/// Opens files and keeps the content of the last compressed one, so that a bag of many of them takes the room of one.
#[derive(Debug)]
pub(super) struct Opener {
    limit_bytes: usize,
    last: Mutex<Option<(PathBuf, Unpacked)>>,
}

impl Opener {
    /// Opens files whose records are limited to `limit_bytes`.
    pub(super) fn new(limit_bytes: usize) -> Self {
        Self { limit_bytes, last: Mutex::new(None) }
    }

    /// Opens a file.
    ///
    /// # Errors
    /// It cannot be read; its content cannot be unpacked.
    pub(super) fn open(&self, path: &Path) -> Result<Source, BagError> {
        let io_error = |source| BagError::Io { path: path.into(), source };
        if !Kind::of(path).map_err(io_error)?.is_packed {
            return Source::open(path, self.limit_bytes);
        }
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let known = last.take().filter(|(known, _)| known == path);
        let (_, unpacked) = match known {
            Some(known) => last.insert(known),
            None => last.insert((path.into(), unpack(path)?)),
        };
        let file = unpacked.file.try_clone().map_err(io_error)?;
        let mut source = Source::of(file, path, self.limit_bytes)?;
        (source.is_packed, source.fault) = (true, unpacked.fault.clone());
        Ok(source)
    }
}
