//! One log line: created from an event, converted to a message.

use std::{
    fmt::{self, Write},
    time::SystemTime,
};

use tracing::{
    Event, Level,
    field::{Field, Visit},
};

use crate::msg::{builtin_interfaces::Time, printable, rosout::Log};

/// Maximum size of a text, bytes. Longer texts are truncated, so that the queue takes bounded memory.
const MAX_TEXT_BYTES: usize = 4096;
const CUT: &str = " [...]";

/// A log line that waits to be published.
pub(super) struct Line {
    /// System time, nanoseconds since the epoch. It is used even if the node has simulated time, as in rcl.
    pub(super) stamp_ns: i64,
    level: u8,
    text: Text,
    file: &'static str,
    module: &'static str,
    row: u32,
}

impl Line {
    pub(super) fn of(event: &Event<'_>) -> Self {
        let metadata = event.metadata();
        let mut text = Text::default();
        event.record(&mut text);
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        Self {
            stamp_ns: i64::try_from(since.as_nanos()).unwrap_or(i64::MAX),
            level: level(*metadata.level()),
            text,
            file: metadata.file().unwrap_or_default(),
            module: metadata.module_path().unwrap_or_default(),
            row: metadata.line().unwrap_or_default(),
        }
    }

    /// Returns the warning that follows this line if `num_lines` lines did not fit into the queue.
    pub(super) fn about_loss(&self, num_lines: u64) -> Self {
        let text = Text(format!(
            "{num_lines} log lines were dropped because the queue of /rosout was full"
        ));
        Self {
            stamp_ns: self.stamp_ns,
            level: Log::WARN,
            text,
            file: file!(),
            module: module_path!(),
            row: line!(),
        }
    }

    pub(super) fn message<'a>(&'a self, name: &'a str) -> Log<'a> {
        Log {
            stamp: Time::from_ns(self.stamp_ns),
            level: self.level,
            name: name.into(),
            msg: self.text.0.as_str().into(),
            file: self.file.into(),
            // The module is the closest that is known.
            function: self.module.into(),
            line: self.row,
        }
    }
}

fn level(level: Level) -> u8 {
    match level {
        Level::ERROR => Log::ERROR,
        Level::WARN => Log::WARN,
        Level::INFO => Log::INFO,
        _ => Log::DEBUG,
    }
}

/// An event's message, followed by its other fields as `key=value`.
#[derive(Default)]
struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        // Writing to a text never fails.
        if field.name() == "message" {
            let rest = std::mem::take(&mut self.0);
            write!(self, "{value:?}{rest}").unwrap_or_default();
        } else {
            write!(self, " {field}={value:?}").unwrap_or_default();
        }
    }
}

impl Write for Text {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        if self.0.ends_with(CUT) {
            return Ok(());
        }
        self.0.push_str(&printable::line(text));
        if self.0.len() > MAX_TEXT_BYTES {
            self.0.truncate(self.0.floor_char_boundary(MAX_TEXT_BYTES - CUT.len()));
            self.0.push_str(CUT);
        }
        Ok(())
    }
}
