//! Output of the commands: standard output, and files that are not replaced without `--force`.

use std::{
    fs,
    io::{self, Write},
    path::Path,
};

use anyhow::{Context, bail};

/// Returns the result of printing. A closed pipe, as after `| head`, is not an error.
///
/// # Errors
/// Standard output cannot be written.
pub(in crate::cli) fn printed(result: io::Result<()>) -> anyhow::Result<()> {
    match result {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        result => result.context("standard output"),
    }
}

/// Prints a text.
///
/// # Errors
/// Standard output cannot be written.
pub(in crate::cli) fn print(out: &mut dyn Write, text: &str) -> anyhow::Result<()> {
    printed(out.write_all(text.as_bytes()))
}

/// Returns an error if the file exists.
///
/// # Errors
/// The file exists.
pub(in crate::cli) fn refuse_existing(path: &Path) -> anyhow::Result<()> {
    if path.exists() {
        bail!("{} exists already: --force replaces it", path.display());
    }
    Ok(())
}

/// Writes a file; the error names it.
///
/// # Errors
/// The file cannot be written.
pub(in crate::cli) fn write_file(path: &Path, content: impl AsRef<[u8]>) -> anyhow::Result<()> {
    fs::write(path, content).with_context(|| format!("cannot write {}", path.display()))
}
