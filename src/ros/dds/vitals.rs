//! Signs that RustDDS 0.15.1 no longer works: it ends its event loops on errors, and says so only in its log.

use std::{fs, path::PathBuf};

/// Start of the names of RustDDS's threads. Linux keeps 15 bytes of a name.
const THREAD: &str = "RustDDS";
/// Threads of a participant, which run once it has been created: its event loop and its discovery.
const NUM_EVENT_LOOPS: usize = 2;

/// The event loops of the participant of this process.
pub(super) struct Vitals {
    /// Their entries among the system's threads; `None` where it does not list threads.
    event_loops: Option<Vec<PathBuf>>,
}

impl Vitals {
    /// Finds the event loops of a participant that has just been created.
    pub(super) fn of_participant() -> Self {
        Self { event_loops: threads(THREAD) }
    }

    /// True if one of them has ended.
    pub(super) fn has_dead_event_loop(&self) -> bool {
        self.event_loops.as_ref().is_some_and(|event_loops| {
            event_loops.len() < NUM_EVENT_LOOPS || event_loops.iter().any(|task| !task.exists())
        })
    }
}

/// Returns the threads of this process with names that begin so; `None` where the system does not list them.
fn threads(start: &str) -> Option<Vec<PathBuf>> {
    let tasks = fs::read_dir("/proc/self/task").ok()?.flatten().map(|task| task.path());
    let has_name = |task: &PathBuf| {
        fs::read_to_string(task.join("comm")).is_ok_and(|name| name.starts_with(start))
    };
    Some(tasks.filter(has_name).collect())
}

#[cfg(test)]
mod tests {
    use std::{
        sync::mpsc::{SyncSender, sync_channel},
        thread::{self, JoinHandle},
    };

    use super::*;

    /// Starts a thread and waits until it has its name. It ends with the returned sender.
    fn event_loop(name: &str) -> (SyncSender<()>, JoinHandle<()>) {
        let (running, runs) = sync_channel(0);
        let (end, ended) = sync_channel::<()>(0);
        let event_loop = thread::Builder::new().name(name.to_owned());
        let event_loop = event_loop.spawn(move || {
            running.send(()).unwrap();
            _ = ended.recv();
        });
        runs.recv().unwrap();
        (end, event_loop.unwrap())
    }

    #[test]
    fn an_event_loop_that_ends_is_noticed() {
        let [(_end, _loop), (end, last)] = ["vitals A", "vitals B"].map(event_loop);
        let vitals = Vitals { event_loops: threads("vitals ") };
        assert!(!vitals.has_dead_event_loop());
        drop(end);
        last.join().unwrap();
        // The kernel removes the thread from its list a moment after `join`.
        while !vitals.has_dead_event_loop() {
            thread::yield_now();
        }
        // Also if it ended before anybody looked.
        assert!(Vitals { event_loops: threads("vitals ") }.has_dead_event_loop());
    }
}
