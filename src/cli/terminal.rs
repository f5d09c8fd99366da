//! The terminal: bars and status lines stay at its lower edge, log lines scroll above them.

use std::{
    io::{self, Write},
    sync::LazyLock,
};

use indicatif::{MultiProgress, ProgressBar};

/// All bars of the process, drawn on standard error if it is a terminal.
static BARS: LazyLock<MultiProgress> = LazyLock::new(MultiProgress::new);

/// Draws the bar below the existing ones.
pub(super) fn show(bar: ProgressBar) -> ProgressBar {
    BARS.add(bar)
}

/// Standard error for log lines. Hides the bars while it writes.
pub(super) struct LogLines;

impl Write for LogLines {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        BARS.suspend(|| io::stderr().write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}
