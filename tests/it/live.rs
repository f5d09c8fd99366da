//! The live node as a process, started and ended by a test.

use std::{
    io::{BufRead, BufReader, Read},
    path::Path,
    process::{Child, ChildStdout, Command, Stdio},
    sync::mpsc::{Receiver, sync_channel},
    thread,
    time::{Duration, Instant},
};

use laser_profiler::bag::{BagReader, Filter, ReadOptions};
use serde_json::Value as Json;

use crate::program::laser_profiler;

/// A loaded machine takes its time.
pub(crate) const DEADLINE: Duration = Duration::from_mins(1);

/// A node that runs. Dropping it ends it at once.
pub(crate) struct Node {
    child: Child,
    stdout: ChildStdout,
    lines: Receiver<String>,
}

impl Node {
    /// Starts the node and waits until it is on the network.
    pub(crate) fn start(arguments: &[&str], environment: &[(&str, String)]) -> Self {
        let mut command = laser_profiler(&["run", "--json"]);
        command.args(arguments).envs(environment.iter().map(|(name, value)| (name, value)));
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let (stdout, stderr) = (child.stdout.take().unwrap(), child.stderr.take().unwrap());
        let (sender, lines) = sync_channel(10_000);
        thread::spawn(move || {
            for line in BufReader::new(stderr).lines().map_while(Result::ok) {
                // The pipe is drained even if nothing reads the lines.
                drop(sender.try_send(line));
            }
        });
        let node = Self { child, stdout, lines };
        node.wait_for(" is on ");
        node
    }

    /// The next log line with that text.
    pub(crate) fn wait_for(&self, text: &str) -> String {
        let end = Instant::now() + DEADLINE;
        let mut seen = Vec::new();
        loop {
            let left = end.saturating_duration_since(Instant::now());
            match self.lines.recv_timeout(left) {
                Ok(line) if line.contains(text) => return line,
                Ok(line) => seen.push(line),
                Err(error) => panic!("{error}: the node never logged {text:?}, only {seen:#?}"),
            }
        }
    }

    /// Ends it by SIGTERM; returns its exit code, its last line and the time it took.
    pub(crate) fn end(mut self) -> (i32, Json, Duration) {
        let started = Instant::now();
        let killed = Command::new("kill").arg(self.child.id().to_string()).status().unwrap();
        assert!(killed.success());
        let mut words = String::new();
        self.stdout.read_to_string(&mut words).unwrap();
        let code = self.child.wait().unwrap().code().unwrap();
        let took = started.elapsed();
        let words = serde_json::from_str(&words)
            .unwrap_or_else(|error| panic!("{error}: {words:?}, exit code {code}"));
        (code, words, took)
    }

    /// Ends it as `kill -9` does.
    pub(crate) fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        // It may have ended by itself.
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

/// Returns the counters of the summary: received, processed, rejected, dropped, lost. They must add up.
pub(crate) fn frames(words: &Json) -> [u64; 5] {
    let of = |bin: &str| words["frames"][bin].as_u64().unwrap();
    let bins = ["received", "processed", "rejected", "dropped", "lost"].map(of);
    assert_eq!(bins[0], bins[1] + bins[2] + bins[3], "{words}");
    bins
}

/// The log times of a topic in the bag of a directory; `None` before there is one.
pub(crate) fn recorded_ns(directory: &Path, topic: &str) -> Option<Vec<i64>> {
    let bag = std::fs::read_dir(directory).unwrap().next()?.unwrap().path();
    let bag = BagReader::open(&bag, &ReadOptions::default()).ok()?;
    let messages = bag.messages(&Filter::topics([topic]));
    Some(messages.flatten().map(|message| message.log_time_ns).collect())
}
