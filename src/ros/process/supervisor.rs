//! Watches the middleware process and replaces it when it fails.

use std::{
    sync::{
        Arc, Condvar, Mutex, OnceLock, PoisonError,
        mpsc::{Receiver, sync_channel},
    },
    time::{Duration, Instant},
};

use super::{
    events::{Inbox, Joined, Progress},
    link::{Link, WorkerCommand},
    lock,
    orders::Order,
    outbox::Kind,
    remote::{Shared, no_thread},
    wire::Payload,
};
use crate::ros::{
    middleware::{JoinRequest, Middleware},
    transport::TransportError,
};

/// Period of the checks: a hostile datagram can make a middleware take half a gigabyte a second.
const PERIOD: Duration = Duration::from_millis(20);
/// Longest silence of a process, also on a busy machine.
const MAX_SILENCE: Duration = Duration::from_secs(10);
/// Longest time for joining a DDS domain, which takes some milliseconds.
const MAX_JOIN: Duration = Duration::from_secs(30);
/// A check that comes this late shows that the node itself was stopped, or starved: the process is not to blame.
const LATE: Duration = Duration::from_secs(2);
/// Waits before the next start, for a process that fails again and again.
const WAITS: [Duration; 6] = [
    Duration::ZERO,
    Duration::from_millis(100),
    Duration::from_millis(300),
    Duration::from_secs(1),
    Duration::from_secs(2),
    Duration::from_secs(5),
];
/// A process that ran for this long has recovered.
const STEADY: Duration = Duration::from_secs(10);

/// Ends the supervision.
#[derive(Default)]
pub(super) struct Stopper {
    is_stopped: Mutex<bool>,
    changed: Condvar,
}

impl Stopper {
    pub(super) fn stop(&self) {
        *lock(&self.is_stopped) = true;
        self.changed.notify_all();
    }

    /// Waits for `time`; returns true at once when stopped.
    fn wait(&self, time: Duration) -> bool {
        let waited =
            self.changed.wait_timeout_while(lock(&self.is_stopped), time, |stopped| !*stopped);
        *waited.unwrap_or_else(PoisonError::into_inner).0
    }
}

/// A process that has joined.
struct Running {
    link: Link,
    progress: Arc<Progress>,
    since: Instant,
    /// True if its events had ended at the last check. Its exit status, which says more, may come a moment later.
    was_silent: bool,
}

/// Starts processes, one after another.
pub(super) struct Supervisor {
    command: WorkerCommand,
    request: JoinRequest,
    shared: Arc<Shared>,
    stopper: Arc<Stopper>,
    running: Option<Running>,
}

impl Supervisor {
    /// Starts the first process; returns what the transport states as its `max_reliable_bytes`.
    ///
    /// # Errors
    /// The process cannot be started, or cannot join the network.
    pub(super) fn start(
        command: WorkerCommand,
        request: JoinRequest,
        shared: Arc<Shared>,
        stopper: Arc<Stopper>,
    ) -> Result<(Self, Option<usize>), TransportError> {
        let mut supervisor = Self { command, request, shared, stopper, running: None };
        let (running, max_reliable_bytes) = supervisor.join()?;
        supervisor.attach(running);
        Ok((supervisor, max_reliable_bytes))
    }

    fn attach(&mut self, running: Running) {
        self.shared.registry.attach(&running.link.orders);
        self.running = Some(running);
    }

    /// Runs until stopped.
    pub(super) fn run(mut self) {
        let mut num_in_a_row = 0;
        while let Some(mut running) = self.running.take() {
            let reason = self.watch(&mut running);
            self.shared.registry.detach();
            let Some(reason) = reason else { return };
            running.link.kill();
            let was_steady = running.since.elapsed() > STEADY;
            drop(running);
            num_in_a_row = if was_steady { 0 } else { num_in_a_row + 1 };
            self.restart(&reason, num_in_a_row);
        }
    }

    /// Waits for the end of the process; returns the reason, or `None` if the supervision is to end.
    fn watch(&self, running: &mut Running) -> Option<String> {
        let mut last_check = Instant::now();
        loop {
            if self.stopper.wait(PERIOD) {
                return None;
            }
            let now = Instant::now();
            if now - last_check > LATE {
                *lock(&running.progress.last_alive) = now;
            }
            last_check = now;
            if let Some(reason) = self.failure(running) {
                return Some(reason);
            }
        }
    }

    fn failure(&self, running: &mut Running) -> Option<String> {
        if let Some(how) = running.link.ended() {
            return Some(format!("it ended ({how})"));
        }
        if std::mem::replace(&mut running.was_silent, running.link.is_silent()) {
            return Some("its events cannot be read".to_owned());
        }
        if let Some(reason) = lock(&running.progress.failure).clone() {
            return Some(reason);
        }
        if lock(&running.progress.last_alive).elapsed() > MAX_SILENCE {
            return Some(format!("it did not report for {} s", MAX_SILENCE.as_secs()));
        }
        self.excess(&running.link)
    }

    /// Returns the reason to end a process that takes too much memory.
    fn excess(&self, link: &Link) -> Option<String> {
        let resident_bytes = link.resident_bytes()?;
        lock(&self.shared.health).resident_bytes = resident_bytes;
        let limit_bytes = self.request.max_memory_bytes;
        (resident_bytes > limit_bytes).then(|| {
            format!(
                "it took {} MB of memory (middleware.max_memory_bytes: {} MB)",
                resident_bytes >> 20,
                limit_bytes >> 20
            )
        })
    }

    /// Starts processes until one has joined, or the supervision ends.
    fn restart(&mut self, reason: &str, num_in_a_row: usize) {
        let failed = Instant::now();
        tracing::error!("the middleware process is replaced: {reason}");
        {
            let mut health = lock(&self.shared.health);
            health.num_restarts += 1;
            health.last_failure = Some(reason.to_owned());
        }
        let mut attempt = num_in_a_row.saturating_sub(1);
        while !self.stopper.wait(WAITS[attempt.min(WAITS.len() - 1)]) {
            match self.join() {
                Ok((running, _)) => {
                    let took = failed.elapsed().as_millis();
                    self.attach(running);
                    return tracing::warn!("the new middleware process joined after {took} ms");
                }
                Err(error) => tracing::error!("the middleware process: {error}"),
            }
            attempt += 1;
        }
    }

    fn join(&self) -> Result<(Running, Option<usize>), TransportError> {
        let (joined, outcome) = sync_channel(1);
        let progress = Arc::new(Progress::new(joined));
        // Events can arrive before `start` returns the link they answer to.
        let inbox = Arc::new(OnceLock::<Inbox>::new());
        let taken = Arc::clone(&inbox);
        let mut link = Link::start(&self.command, move |event, payload| {
            taken.wait().take(event, payload);
        })
        .map_err(|error| no_thread(&error))?;
        let (shared, orders) = (Arc::clone(&self.shared), Arc::clone(&link.orders));
        let (of_link, join) = (Arc::clone(&progress), Order::Join(self.request.clone()));
        link.orders.push(Kind::Control, join, Payload::None);
        _ = inbox.set(Inbox { shared, progress: of_link, orders });
        let max_reliable_bytes = self.wait_for(&outcome, &mut link)?;
        *lock(&progress.last_alive) = Instant::now();
        let running = Running { link, progress, since: Instant::now(), was_silent: false };
        Ok((running, max_reliable_bytes))
    }

    /// Waits until the process has joined: on Zenoh without limit, since a node may wait for its router.
    fn wait_for(&self, outcome: &Receiver<Joined>, link: &mut Link) -> Joined {
        let started = Instant::now();
        loop {
            if let Ok(joined) = outcome.recv_timeout(PERIOD) {
                return joined;
            }
            if let Some(how) = link.ended() {
                return outcome.try_recv().unwrap_or_else(|_| Err(ended(&how)));
            }
            if let Some(reason) = self.excess(link) {
                return Err(ended(&reason));
            }
            if link.is_silent() {
                return Err(ended("its events cannot be read"));
            }
            if self.request.middleware == Middleware::Dds && started.elapsed() > MAX_JOIN {
                return Err(ended("it took more than 30 s"));
            }
            if self.stopper.wait(Duration::ZERO) {
                return Err(ended("the node ended"));
            }
        }
    }
}

fn ended(how: &str) -> TransportError {
    TransportError::Unreachable(format!("it ended before it had joined the network: {how}"))
}
