//! Output of the commands: standard output, and files that are not replaced without `--force`.

use std::{
    fs,
    io::{self, Write},
    path::Path,
};

use anyhow::{Context, bail};

use crate::msg::printable;

/// Standard output, on which names from recordings are no commands to the terminal.
pub(in crate::cli) struct Printable<W> {
    out: W,
    /// Bytes of a character whose end has not been written yet.
    cut: Vec<u8>,
}

impl<W: Write> Printable<W> {
    pub(in crate::cli) const fn new(out: W) -> Self {
        Self { out, cut: Vec::new() }
    }
}

impl<W: Write> Write for Printable<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.cut.extend_from_slice(bytes);
        let mut rest = &*self.cut;
        loop {
            let (valid, error) = match str::from_utf8(rest) {
                Ok(text) => (text, None),
                Err(error) => {
                    let (valid, _) = rest.split_at(error.valid_up_to());
                    (str::from_utf8(valid).unwrap_or_default(), Some(error))
                }
            };
            self.out.write_all(printable::text(valid).as_bytes())?;
            rest = &rest[valid.len()..];
            let Some(length) = error.and_then(|error| error.error_len()) else { break };
            self.out.write_all(b"\\ufffd")?;
            rest = &rest[length..];
        }
        self.cut = rest.to_vec();
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

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
    // A link to nothing would be written through.
    if path.symlink_metadata().is_ok() {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn printed_in_parts(bytes: &[u8], size_bytes: usize) -> String {
        let mut out = Printable::new(Vec::new());
        bytes.chunks(size_bytes).for_each(|part| out.write_all(part).unwrap());
        String::from_utf8(out.out).unwrap()
    }

    #[test]
    fn characters_arrive_whole_and_harmless_however_they_are_cut() {
        for size_bytes in 1..8 {
            let shown = printed_in_parts("90 \u{b0}\n\u{9b}2J\u{1b}[0m 深".as_bytes(), size_bytes);
            assert_eq!(shown, "90 \u{b0}\n\\u009b2J\\u001b[0m 深", "{size_bytes}");
            assert_eq!(printed_in_parts(b"a\xff\x9bb", size_bytes), "a\\ufffd\\ufffdb");
        }
    }
}
