//! Loads the calibration that a parameter names.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use thiserror::Error;

pub(crate) use crate::scanner::calibration::{Calibration, CalibrationError};

const MAX_BYTES: u64 = 1 << 20;
const NO_TEXT: &str = "the file is no text, but a calibration is YAML";

/// The reason that a calibration cannot be loaded.
#[derive(Debug, Error)]
pub(crate) enum CalibrationFileError {
    /// It cannot be used.
    #[error("calibration_file {}: {source}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: CalibrationError,
    },
    /// It cannot be read.
    #[error("calibration_file {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The I/O error.
        source: io::Error,
    },
}

/// Reads a calibration and returns it with its text.
///
/// # Errors
/// The file is missing, too long, or not a calibration.
pub(crate) fn load(path: &Path) -> Result<(Calibration, String), CalibrationFileError> {
    let io = |source| CalibrationFileError::Io { path: path.to_owned(), source };
    let content = |source| CalibrationFileError::Content { path: path.to_owned(), source };
    let size = fs::metadata(path).map_err(io)?.len();
    if size > MAX_BYTES {
        let reason = format!("{size} bytes exceed the limit of {MAX_BYTES}");
        return Err(content(CalibrationError::Syntax(reason)));
    }
    let text = fs::read_to_string(path).map_err(|error| match error.kind() {
        io::ErrorKind::InvalidData => content(CalibrationError::Syntax(NO_TEXT.to_owned())),
        _ => io(error),
    })?;
    let calibration = Calibration::from_yaml(&text).map_err(content)?;
    Ok((calibration, text))
}
