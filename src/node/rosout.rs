//! Publishes the program's log on `/rosout`, as every ROS node does.
//!
//! [`layer`] is created when logging starts, before there is a node; [`Rosout::start`] connects it to one. Log lines
//! pass through a bounded queue to a separate thread, so that logging never waits for the network.

mod line;

use std::{
    cell::Cell,
    io,
    sync::{
        Arc, PoisonError, RwLock,
        atomic::{AtomicU64, Ordering},
        mpsc::{Receiver, SyncSender, TrySendError, sync_channel},
    },
    thread::{self, JoinHandle},
};

use thiserror::Error;
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::layer::{Context, Layer};

use self::line::Line;
use super::{endpoints, watch::Watch};
use crate::{
    msg::{
        qos::{QosProfile, QosTime},
        rosout::Log,
    },
    ros::{
        names::NodeNames,
        transport::{Publication, Transport, TransportError},
    },
};

/// Maximum number of queued log lines, and number of lines kept for late subscribers, as in rcl.
const DEPTH: usize = 1000;
const LIFESPAN: QosTime = QosTime { sec: 10, nsec: 0 };
/// Root of this crate's modules. Log lines of other crates go only to standard error.
const OWN_TARGET: &str = "laser_profiler";

thread_local! {
    /// True on the publishing thread, whose own log lines would recurse: the transport logs them about a log line.
    static IS_PUBLISHING: Cell<bool> = const { Cell::new(false) };
}

/// Connection between the layer and the node.
#[derive(Clone, Default)]
pub(crate) struct RosoutSlot(Arc<Slot>);

#[derive(Default)]
struct Slot {
    queue: RwLock<Option<SyncSender<Line>>>,
    num_dropped: AtomicU64,
}

impl RosoutSlot {
    /// Number of log lines dropped because the queue was full.
    pub(crate) fn num_dropped(&self) -> u64 {
        self.0.num_dropped.load(Ordering::Relaxed)
    }

    fn set(&self, queue: Option<SyncSender<Line>>) {
        *self.0.queue.write().unwrap_or_else(PoisonError::into_inner) = queue;
    }

    fn push(&self, event: &Event<'_>) {
        let connected = self.0.queue.read().unwrap_or_else(PoisonError::into_inner).clone();
        let Some(queue) = connected else { return };
        // If the publishing thread has ended, the line only goes to standard error.
        if let Err(TrySendError::Full(_)) = queue.try_send(Line::of(event)) {
            self.0.num_dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// Logging layer that passes this program's events to the node connected to the slot.
pub(crate) struct RosoutLayer(RosoutSlot);

/// Returns a layer and its slot.
pub(crate) fn layer() -> (RosoutLayer, RosoutSlot) {
    let slot = RosoutSlot::default();
    (RosoutLayer(slot.clone()), slot)
}

impl<S: Subscriber> Layer<S> for RosoutLayer {
    fn on_event(&self, event: &Event<'_>, _context: Context<'_, S>) {
        let is_own = is_own(event.metadata().target());
        if is_own && *event.metadata().level() <= Level::DEBUG && !IS_PUBLISHING.get() {
            self.0.push(event);
        }
    }
}

fn is_own(target: &str) -> bool {
    target.strip_prefix(OWN_TARGET).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
}

/// Error of starting `/rosout`.
#[derive(Debug, Error)]
pub(crate) enum RosoutError {
    /// The middleware rejects the topic.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// The thread cannot be started.
    #[error("/rosout: cannot start the thread: {0}")]
    Thread(#[from] io::Error),
}

/// The node's log on `/rosout`. Dropping it publishes the queued lines and disconnects.
pub(crate) struct Rosout {
    slot: RosoutSlot,
    thread: Option<JoinHandle<()>>,
}

impl Rosout {
    /// Starts publishing the events of the slot's layer under the node's logger name. `watch` notes a panic of the thread.
    ///
    /// # Errors
    /// The middleware rejects the topic, or the thread cannot be started.
    pub(crate) fn start(
        transport: &dyn Transport,
        names: &NodeNames,
        slot: RosoutSlot,
        watch: Watch,
    ) -> Result<Self, RosoutError> {
        let qos = QosProfile { lifespan: LIFESPAN, ..QosProfile::latched(DEPTH as u64) };
        let publication = endpoints::advertise::<Log<'_>>(transport, names, "/rosout", qos)?;
        let (sender, receiver) = sync_channel(DEPTH);
        let (name, counted, num_reported) = (names.logger(), slot.clone(), slot.num_dropped());
        let run = move || {
            let _guard = watch.guard("the thread of /rosout");
            publish_all(&receiver, publication, &name, &counted, num_reported);
        };
        let thread = Some(thread::Builder::new().name("rosout".to_owned()).spawn(run)?);
        slot.set(Some(sender));
        Ok(Self { slot, thread })
    }
}

impl Drop for Rosout {
    fn drop(&mut self) {
        self.slot.set(None);
        if let Some(thread) = self.thread.take() {
            // A thread that panicked has reported it already.
            drop(thread.join());
        }
    }
}

fn publish_all(
    lines: &Receiver<Line>,
    mut publication: Box<dyn Publication>,
    name: &str,
    slot: &RosoutSlot,
    mut num_reported: u64,
) {
    IS_PUBLISHING.set(true);
    let mut publish = |line: &Line| {
        let log = line.message(name);
        // Logging this failure would recurse; standard error has the line itself.
        drop(endpoints::send(&mut *publication, &log, line.stamp_ns));
    };
    for line in lines {
        publish(&line);
        let num_dropped = slot.num_dropped();
        if num_dropped > num_reported {
            publish(&line.about_loss(num_dropped - num_reported));
            num_reported = num_dropped;
        }
    }
}

#[cfg(test)]
mod tests;
