//! Loads the calibration that a parameter names.

use std::{
    io,
    path::{Path, PathBuf},
};

use thiserror::Error;

use super::named_file;
pub(crate) use crate::scanner::calibration::{Calibration, CalibrationError};

const MAX_BYTES: u64 = 1 << 20;
const NO_TEXT: &str = "the file is no text, but a calibration is YAML";
const NO_TYPE: &str = "no line says `type: camera_and_plane`, `type: vertical_incidence` or `type: projective`, which \
                       every calibration has";
/// How the types of calibrations begin, so that a misspelt one is still known as ours.
const TYPES: [&str; 3] = ["camera", "vertical", "projective"];

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
/// The file is missing, no regular file, too long, or not a calibration. Of a file that is none, nothing is quoted: peers
/// name files, and read the errors.
pub(crate) fn load(path: &Path) -> Result<(Calibration, String), CalibrationFileError> {
    let io = |source| CalibrationFileError::Io { path: path.to_owned(), source };
    let content = |source| CalibrationFileError::Content { path: path.to_owned(), source };
    let text = String::from_utf8(named_file::read(path, MAX_BYTES).map_err(io)?)
        .map_err(|_binary| content(CalibrationError::Syntax(NO_TEXT.to_owned())))?;
    let calibration = Calibration::from_yaml(&text).map_err(|error| {
        let is_foreign = !matches!(error, CalibrationError::CameraOnly { .. }) && !is_ours(&text);
        content(if is_foreign { CalibrationError::Syntax(NO_TYPE.to_owned()) } else { error })
    })?;
    Ok((calibration, text))
}

/// True if a text was meant to be a calibration of this program.
fn is_ours(text: &str) -> bool {
    let mut parts =
        text.split(['\n', '{', ',']).map(|part| part.trim_start_matches(['\u{feff}', ' ']));
    parts.any(|part| {
        let part = part.strip_prefix("type:").or_else(|| part.strip_prefix("\"type\":"));
        let value = part.map(|value| value.trim_start_matches([' ', '"', '\'']));
        value.is_some_and(|value| TYPES.iter().any(|kind| value.starts_with(kind)))
    })
}

#[cfg(test)]
mod tests {
    use std::{fmt::Write as _, fs};

    use super::*;

    fn error(text: &str) -> String {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("c.yaml");
        fs::write(&path, text).unwrap();
        load(&path).unwrap_err().to_string()
    }

    #[test]
    fn nothing_is_quoted_of_a_file_that_is_no_calibration() {
        for secret in [
            "root:x:0:0:hunter2:/root:/bin/bash\n",
            "hunter2",
            "password: hunter2\n",
            "type: hunter2\n",
            "- hunter2\n",
            "{hunter2: 1, camera_name: 2}",
            "id: [hunter2]\n",
            "a: &hunter2 [*hunter2, *other]\n",
            "\"hunter2",
            "hunter2: 1\nhunter2: 2\n",
        ] {
            let error = error(secret);
            assert!(!error.contains("hunter2") && error.contains("`type:"), "{secret}: {error}");
        }
    }

    #[test]
    fn a_calibration_with_a_mistake_is_explained() {
        for (text, words) in [
            ("type: camera_and_planes\n", "camera_and_planes"),
            ("{\"type\": \"projective\", \"bogus\": 1}", "bogus"),
            ("type: vertical_incidence\nframe_ID: laser\n", "did you mean `frame_id`"),
        ] {
            let error = error(text);
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn a_small_file_takes_little_memory_however_it_refers_to_itself() {
        // A billion laughs.
        let mut bomb = "type: projective\na0: &a0 [x, x, x, x, x, x, x, x, x]\n".to_owned();
        for level in 1..12 {
            let list = vec![format!("*a{}", level - 1); 9].join(", ");
            writeln!(bomb, "a{level}: &a{level} [{list}]").unwrap();
        }
        let deep = format!("type: projective\na: {}\n", "[".repeat(100_000));
        for text in [bomb, deep] {
            let (_, info) = allocation(|| error(&text));
            assert!(info < 64 << 20, "{info} bytes");
        }
    }

    /// Largest memory at once of a call, bytes.
    fn allocation<T>(act: impl FnOnce() -> T) -> (T, u64) {
        let mut result = None;
        let info = allocation_counter::measure(|| result = Some(act()));
        (result.unwrap(), info.bytes_max)
    }
}
