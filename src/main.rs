//! The `laser_profiler` executable: see `laser_profiler --help`. The only place that chooses exit codes.

use std::{
    io::{self, Write},
    process::ExitCode,
};

use laser_profiler::{
    cli::{self, Outcome, Usage},
    msg::printable,
};

const FAILED: u8 = 1;
const USAGE: u8 = 2;
const DATA_LOST: u8 = 3;

fn main() -> ExitCode {
    let error = match cli::run(std::env::args_os()) {
        Ok(Outcome::Done) => return ExitCode::SUCCESS,
        Ok(Outcome::DataLost) => return DATA_LOST.into(),
        Err(error) => error,
    };
    // Printing fails if the terminal is gone; there is nowhere to report that.
    if let Some(clap) = error.downcast_ref::<clap::Error>() {
        drop(clap.print());
        return if clap.use_stderr() { USAGE.into() } else { ExitCode::SUCCESS };
    }
    drop(writeln!(io::stderr(), "error: {}", printable::paragraph(&with_causes(&error))));
    if error.is::<Usage>() { USAGE.into() } else { FAILED.into() }
}

/// Returns the error and its causes, each once: some errors already quote their cause.
fn with_causes(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.contains(&cause) {
            // A list ends with a line of its own.
            text.push_str(if text.ends_with('\n') { "" } else { ": " });
            text.push_str(&cause);
        }
    }
    text
}
