//! The live node as a process, started and ended by a test.

use std::{
    fs,
    io::{BufRead, BufReader, Read},
    path::Path,
    process::{Child, ChildStdout, Command, Stdio},
    sync::mpsc::{Receiver, sync_channel},
    thread,
    time::{Duration, Instant},
};

use serde_json::Value as Json;

use crate::program::laser_profiler;

/// A loaded machine takes its time.
pub(crate) const DEADLINE: Duration = Duration::from_mins(1);

/// Sends a signal, such as `STOP`, to a process.
#[cfg(feature = "dds")]
pub(crate) fn signal(child: &Child, name: &str) {
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-s", name, &id]).status().unwrap().success());
}

/// A node that runs. Dropping it ends it at once.
pub(crate) struct Node {
    child: Child,
    stdout: ChildStdout,
    lines: Receiver<String>,
}

impl Node {
    /// Starts the node and waits until it is on the network.
    pub(crate) fn start(arguments: &[&str], environment: &[(&str, String)]) -> Self {
        Self::start_by(&mut laser_profiler(&["run", "--json"]), arguments, environment)
    }

    /// The same by a command that runs the node.
    pub(crate) fn start_by(
        command: &mut Command,
        arguments: &[&str],
        environment: &[(&str, String)],
    ) -> Self {
        let node = Self::spawn_by(command, arguments, environment);
        node.wait_for(" is on ");
        node
    }

    /// Starts the node.
    #[cfg(feature = "zenoh")]
    pub(crate) fn spawn(arguments: &[&str], environment: &[(&str, String)]) -> Self {
        Self::spawn_by(&mut laser_profiler(&["run", "--json"]), arguments, environment)
    }

    fn spawn_by(command: &mut Command, arguments: &[&str], environment: &[(&str, String)]) -> Self {
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
        Self { child, stdout, lines }
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

    /// Sends it a signal, such as `STOP`.
    #[cfg(feature = "cyclone")]
    pub(crate) fn signal(&self, name: &str) {
        signal(&self.child, name);
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

    /// Resident memory of the node and its middleware process, bytes.
    pub(crate) fn resident_bytes(&self) -> u64 {
        let of = |id: u32| {
            // A process that is being replaced may be gone.
            let status = fs::read_to_string(format!("/proc/{id}/status")).unwrap_or_default();
            let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
            line.map_or(0, |line| line.trim_end_matches("kB").trim().parse().unwrap())
        };
        let kilobytes: u64 = of(self.child.id()) + self.children().into_iter().map(of).sum::<u64>();
        kilobytes << 10
    }

    fn children(&self) -> Vec<u32> {
        let tasks = fs::read_dir(format!("/proc/{}/task", self.child.id())).unwrap().flatten();
        // A thread may end meanwhile.
        let children =
            tasks.filter_map(|task| fs::read_to_string(task.path().join("children")).ok());
        let children = children.collect::<String>();
        children.split_whitespace().map(|id| id.parse().unwrap()).collect()
    }

    /// The process that runs its middleware.
    pub(crate) fn middleware(&self) -> Middleware {
        let children = self.children();
        let [id] = children[..] else { panic!("one middleware process, not {children:?}") };
        Middleware { id }
    }
}

/// The process that runs the middleware of a node.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Middleware {
    id: u32,
}

impl Middleware {
    /// Sends it a signal.
    pub(crate) fn signal(&self, name: &str) {
        let sent = Command::new("kill").args(["-s", name, &self.id.to_string()]).status().unwrap();
        assert!(sent.success());
    }

    /// True while it runs.
    pub(crate) fn is_there(&self) -> bool {
        Path::new(&format!("/proc/{}/stat", self.id)).exists()
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        // It may have ended by itself.
        drop(self.child.kill());
        drop(self.child.wait());
        if thread::panicking() {
            eprintln!("the rest of the node's log:");
            // A process that it started may still have its standard error, so there may be no end.
            let end = Instant::now() + Duration::from_secs(1);
            let left = || end.saturating_duration_since(Instant::now());
            while let Ok(line) = self.lines.recv_timeout(left()) {
                eprintln!("{line}");
            }
        }
    }
}

/// Returns the counters of the summary: received, processed, rejected, dropped, lost. They must add up.
pub(crate) fn frames(words: &Json) -> [u64; 5] {
    let of = |bin: &str| words["frames"][bin].as_u64().unwrap();
    let bins = ["received", "processed", "rejected", "dropped", "lost"].map(of);
    assert_eq!(bins[0], bins[1] + bins[2] + bins[3], "{words}");
    bins
}
