//! A Python process that prints each event as a line of JSON.

use std::{
    io::{BufRead, BufReader, Write},
    path::Path,
    process::{Child, ChildStdin, Command, Stdio},
    sync::mpsc::{Receiver, sync_channel},
    thread,
    time::{Duration, Instant},
};

use serde_json::Value as Json;

/// Deadline for any event, with a margin for busy machines.
pub(super) const DEADLINE: Duration = Duration::from_mins(1);

/// Ended with the test.
pub(super) struct Peer {
    process: Child,
    stdin: ChildStdin,
    events: Receiver<Json>,
}

impl Peer {
    pub(super) fn start(python: &Path, script: &str, arguments: &[&str]) -> Self {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers").join(script);
        let mut command = Command::new(python);
        command.arg("-B").arg(script).args(arguments);
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut process = command.spawn().unwrap();
        let (stdin, stdout) = (process.stdin.take().unwrap(), process.stdout.take().unwrap());
        let (sender, events) = sync_channel(1000);
        thread::spawn(move || {
            for line in BufReader::new(stdout).lines().map_while(Result::ok) {
                let event = serde_json::from_str(&line).unwrap_or(Json::String(line));
                if sender.send(event).is_err() {
                    return;
                }
            }
        });
        Self { process, stdin, events }
    }

    /// Returns the next event, which must have this name.
    pub(super) fn event(&self, name: &str) -> Json {
        let event = self.any_event();
        assert_eq!(event["event"], name, "{event}");
        event
    }

    /// The next event.
    pub(super) fn any_event(&self) -> Json {
        self.events.recv_timeout(DEADLINE).unwrap()
    }

    /// The next event if there is one now.
    pub(super) fn try_event(&self) -> Option<Json> {
        self.events.try_recv().ok()
    }

    /// Sends a line to its standard input.
    pub(super) fn send_line(&mut self, line: &str) {
        writeln!(self.stdin, "{line}").unwrap();
    }

    /// Ends it as `kill -9` does.
    pub(super) fn kill(&mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It may have ended by itself.
        if self.process.kill().is_ok() {
            self.process.wait().unwrap();
        }
    }
}

/// Waits until `condition` holds; panics with `what` at the deadline.
pub(super) fn wait_until(what: &str, mut condition: impl FnMut() -> bool) {
    let deadline = Instant::now() + DEADLINE;
    while !condition() {
        assert!(Instant::now() < deadline, "not within {DEADLINE:?}: {what}");
        thread::sleep(Duration::from_millis(5));
    }
}
