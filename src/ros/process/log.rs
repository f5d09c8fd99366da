//! Log lines of the middleware process, which the node logs as its own.

use std::fmt::{self, Write};

use tracing::{
    Event as Logged, Subscriber,
    field::{Field, Visit},
};
use tracing_subscriber::layer::{Context, Layer};

use super::{
    host::Events,
    orders::{Event, Level},
    wire::Payload,
};

/// Target of the log lines of the middleware itself.
pub(crate) const MIDDLEWARE: &str = "middleware";
/// Target of our own log lines in its process.
const OWN: &str = "laser_profiler";
/// Longest line, bytes.
const MAX_TEXT_BYTES: usize = 4096;

/// Logging layer of the middleware process: passes lines to the node.
pub(crate) struct LogToNode(pub(crate) Events);

impl<S: Subscriber> Layer<S> for LogToNode {
    fn on_event(&self, logged: &Logged<'_>, _context: Context<'_, S>) {
        let mut text = Text(String::new());
        logged.record(&mut text);
        let level = match *logged.metadata().level() {
            tracing::Level::ERROR => Level::Error,
            tracing::Level::WARN => Level::Warn,
            tracing::Level::INFO => Level::Info,
            tracing::Level::DEBUG => Level::Debug,
            tracing::Level::TRACE => Level::Trace,
        };
        let target = logged.metadata().target().to_owned();
        // A node that does not read loses lines, not memory.
        self.0.deliver(Event::Log { level, target, text: text.0 }, Payload::None);
    }
}

/// The message, then the fields.
struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        if self.0.len() > MAX_TEXT_BYTES || field.name().starts_with("log.") {
            return;
        }
        // Writing to a string cannot fail.
        _ = match field.name() {
            "message" => write!(self.0, "{value:?}"),
            name => write!(self.0, " {name}={value:?}"),
        };
    }
}

/// Logs a line of the middleware process in this one.
pub(super) fn log(level: Level, target: &str, text: &str) {
    macro_rules! at {
        ($target:expr) => {
            match level {
                Level::Error => tracing::error!(target: $target, "{text}"),
                Level::Warn => tracing::warn!(target: $target, "{text}"),
                Level::Info => tracing::info!(target: $target, "{text}"),
                Level::Debug => tracing::debug!(target: $target, "{text}"),
                Level::Trace => tracing::trace!(target: $target, "{text}"),
            }
        };
    }
    if target == OWN || target.starts_with("laser_profiler::") {
        at!(OWN);
    } else {
        at!(MIDDLEWARE);
    }
}
