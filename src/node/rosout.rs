//! The program's log on `/rosout`, as every ROS node has it.
//!
//! [`layer`] is made where logging starts, before there is a node; [`Rosout::start`] connects it to one. Log lines wait
//! in a bounded queue for a thread of their own: whoever logs never waits for the network.

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
use super::endpoints;
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

/// Log lines that can wait; as many are kept for late subscribers, as in rcl.
const DEPTH: usize = 1000;
const LIFESPAN: QosTime = QosTime { sec: 10, nsec: 0 };
/// The root of this crate's modules: what others log stays on standard error.
const OWN_TARGET: &str = "laser_profiler";

thread_local! {
    /// Set on the thread that publishes: what that thread logs, the transport logs about a log line.
    static IS_PUBLISHING: Cell<bool> = const { Cell::new(false) };
}

/// Where the layer finds its way to the node.
#[derive(Clone, Default)]
pub(crate) struct RosoutSlot(Arc<Slot>);

#[derive(Default)]
struct Slot {
    queue: RwLock<Option<SyncSender<Line>>>,
    num_dropped: AtomicU64,
}

impl RosoutSlot {
    /// Log lines that did not fit into the queue.
    pub(crate) fn num_dropped(&self) -> u64 {
        self.0.num_dropped.load(Ordering::Relaxed)
    }

    fn set(&self, queue: Option<SyncSender<Line>>) {
        *self.0.queue.write().unwrap_or_else(PoisonError::into_inner) = queue;
    }

    fn push(&self, event: &Event<'_>) {
        let connected = self.0.queue.read().unwrap_or_else(PoisonError::into_inner).clone();
        let Some(queue) = connected else { return };
        // If the reader has ended, the line only goes to standard error.
        if let Err(TrySendError::Full(_)) = queue.try_send(Line::of(event)) {
            self.0.num_dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// Takes part in logging: hands this program's events to whatever node the slot is connected to.
pub(crate) struct RosoutLayer(RosoutSlot);

/// The layer and its slot.
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

/// The reason that `/rosout` cannot be started.
#[derive(Debug, Error)]
pub(crate) enum RosoutError {
    /// The middleware refuses the topic.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// The system refuses a thread.
    #[error("/rosout: no thread: {0}")]
    Thread(#[from] io::Error),
}

/// The node's log on `/rosout`. Dropping it sends what waits, and disconnects.
pub(crate) struct Rosout {
    slot: RosoutSlot,
    thread: Option<JoinHandle<()>>,
}

impl Rosout {
    /// Publishes from now on what the layer of `slot` sees, under the node's logger name.
    ///
    /// # Errors
    /// The middleware refuses the topic, or the system a thread.
    pub(crate) fn start(
        transport: &dyn Transport,
        names: &NodeNames,
        slot: RosoutSlot,
    ) -> Result<Self, RosoutError> {
        let qos = QosProfile { lifespan: LIFESPAN, ..QosProfile::latched(DEPTH as u64) };
        let publication = endpoints::advertise::<Log<'_>>(transport, names, "/rosout", qos)?;
        let (sender, receiver) = sync_channel(DEPTH);
        let (name, counted, num_told) = (names.logger(), slot.clone(), slot.num_dropped());
        let run = move || publish_all(&receiver, publication, &name, &counted, num_told);
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
    mut num_told: u64,
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
        if num_dropped > num_told {
            publish(&line.about_loss(num_dropped - num_told));
            num_told = num_dropped;
        }
    }
}

#[cfg(test)]
mod tests;
