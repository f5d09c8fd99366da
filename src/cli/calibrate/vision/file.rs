//! Reads and writes calibration files.

use std::{fs, path::Path};

use anyhow::{Context, bail};
use jiff::Timestamp;

use super::args::OutputArgs;
use crate::cli::output;

/// Longest accepted calibration file, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Refuses to overwrite existing files unless `--force` is given.
///
/// # Errors
/// The file exists.
pub(super) fn refuse_existing(args: &OutputArgs) -> anyhow::Result<()> {
    for path in [Some(&args.output), args.report.as_ref()].into_iter().flatten() {
        if !args.force {
            output::refuse_existing(path)?;
        }
    }
    Ok(())
}

/// Reads a calibration file's text.
///
/// # Errors
/// The file cannot be read, or is too long.
pub(super) fn read(path: &Path) -> anyhow::Result<String> {
    let context = || format!("cannot read {}", path.display());
    let length = fs::metadata(path).with_context(context)?.len();
    if length > MAX_BYTES {
        bail!("{}: {length} bytes: too large for a calibration file", path.display());
    }
    let bytes = fs::read(path).with_context(context)?;
    String::from_utf8(bytes)
        .with_context(|| format!("{} is no text, but a calibration is", path.display()))
}

/// Writes a calibration.
///
/// # Errors
/// The file cannot be written.
pub(super) fn write(args: &OutputArgs, text: &str) -> anyhow::Result<()> {
    output::write_file(&args.output, text)
}

/// Returns the current time in UTC, in whole seconds.
pub(super) fn now() -> String {
    Timestamp::now().strftime("%Y-%m-%dT%H:%M:%SZ").to_string()
}
