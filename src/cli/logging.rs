//! Log lines go to standard error: standard output carries results only.

use std::io::{self, IsTerminal};

use ros2args::LogLevel;
use tracing::level_filters::LevelFilter;

/// Starts logging at that level, `info` when none is given. A second call changes nothing.
pub(super) fn start(level: Option<LogLevel>) {
    let level = match level.unwrap_or(LogLevel::Info) {
        LogLevel::Debug => LevelFilter::DEBUG,
        LogLevel::Info => LevelFilter::INFO,
        LogLevel::Warn => LevelFilter::WARN,
        LogLevel::Error | LogLevel::Fatal => LevelFilter::ERROR,
    };
    let subscriber = tracing_subscriber::fmt()
        .with_max_level(level)
        .with_target(false)
        .without_time()
        .with_ansi(io::stderr().is_terminal())
        .with_writer(io::stderr)
        // It would print its own failure to standard error, and panic where that is what fails.
        .log_internal_errors(false)
        .finish();
    // Fails only when a subscriber is there already, as in tests.
    drop(tracing::subscriber::set_global_default(subscriber));
}
