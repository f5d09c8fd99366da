//! Handles the events of the middleware process in the node.

use std::{
    cell::Cell,
    sync::{
        Arc, Mutex,
        atomic::Ordering,
        mpsc::{SyncSender, TrySendError},
    },
    time::Instant,
};

use super::{
    lock, log,
    orders::{Event, Order},
    outbox::Kind,
    registry::{Orders, Registry, Request, Role},
    remote::Shared,
    wire::Payload,
};
use crate::ros::transport::{Arrival, Fault, TransportError};

thread_local! {
    /// True while this thread delivers messages.
    static IS_DELIVERING: Cell<bool> = const { Cell::new(false) };
}

/// Outcome of joining: the transport's `max_reliable_bytes`.
pub(super) type Joined = Result<Option<usize>, TransportError>;

/// State that one process has reported about itself.
pub(super) struct Progress {
    pub(super) joined: SyncSender<Joined>,
    pub(super) last_alive: Mutex<Instant>,
    pub(super) failure: Mutex<Option<String>>,
}

impl Progress {
    pub(super) fn new(joined: SyncSender<Joined>) -> Self {
        Self { joined, last_alive: Mutex::new(Instant::now()), failure: Mutex::new(None) }
    }
}

/// Takes the events of one process.
pub(super) struct Inbox {
    pub(super) shared: Arc<Shared>,
    pub(super) progress: Arc<Progress>,
    /// Orders to the process, for answers.
    pub(super) orders: Arc<Orders>,
}

impl Inbox {
    /// True on a thread that is delivering messages.
    pub(super) fn is_delivering() -> bool {
        IS_DELIVERING.get()
    }

    /// Acts on an event.
    pub(super) fn take(&self, event: Event, payload: Vec<u8>) {
        IS_DELIVERING.set(true);
        match event {
            Event::Joined { max_reliable_bytes } => {
                drop(self.progress.joined.try_send(Ok(max_reliable_bytes)));
            }
            Event::NotJoined(error) => drop(self.progress.joined.try_send(Err(error))),
            Event::Created { id, error } => {
                if let Some(error) = self.shared.registry.created(id, error) {
                    tracing::error!("the new middleware process rejects an endpoint: {error}");
                }
            }
            Event::Arrived { id, origin } => {
                let arrival = Arrival {
                    data: payload,
                    publisher: origin.publisher,
                    sequence: origin.sequence,
                    source_time_ns: origin.source_time_ns,
                    receive_time_ns: origin.receive_time_ns,
                };
                self.deliver(id, Ok(arrival));
            }
            Event::Faulty { id, fault } => self.deliver(id, Err(fault)),
            Event::Overrun { num_messages } => {
                lock(&self.shared.health).num_overrun += num_messages;
            }
            Event::Requested { id, call } => self.request(id, call, payload),
            Event::Matched { id, num_matched } => {
                if let Some(entry) = self.shared.registry.entry(id) {
                    entry.num_matched.store(num_matched, Ordering::Relaxed);
                }
            }
            Event::Unsent { id, error } => {
                if let Some(entry) = self.shared.registry.entry(id) {
                    entry.note_unsent(error);
                }
            }
            Event::Topics(topics) => {
                let mut known = lock(&self.shared.topics);
                *known = (topics, known.1 + 1);
                drop(known);
                self.shared.listed.notify_all();
            }
            Event::Failed { reason } => *lock(&self.progress.failure) = Some(reason),
            Event::Log { level, target, text } => log::log(level, &target, &text),
            Event::Alive => *lock(&self.progress.last_alive) = Instant::now(),
        }
    }

    fn deliver(&self, id: u64, arrival: Result<Arrival, Fault>) {
        let Some(entry) = self.shared.registry.entry(id) else { return };
        let Role::Subscriber { limit_bytes, on_arrival, .. } = &entry.role else { return };
        let (limit_bytes, bytes) = (*limit_bytes, arrival.as_ref().map_or(0, |a| a.data.len()));
        let fault = Fault::TooLarge { bytes, limit_bytes };
        let arrival = if bytes > limit_bytes { Err(fault) } else { arrival };
        (*lock(on_arrival))(arrival);
    }

    fn request(&self, id: u64, call: u64, data: Vec<u8>) {
        let refuse = |why: &str| {
            tracing::warn!("a request gets no response: {why}");
            let order = Order::Answer { call, is_answered: false };
            self.orders.push(Kind::Control, order, Payload::None);
        };
        let Some(entry) = self.shared.registry.entry(id) else {
            return refuse("its service is gone");
        };
        let Role::Server { requests, .. } = &entry.role else { return };
        let request = Request { call, data, asker: Arc::clone(&self.orders) };
        match requests.try_send(request) {
            Ok(()) => {}
            Err(TrySendError::Full(_)) => refuse(&format!("{}: too many at once", entry.name)),
            Err(TrySendError::Disconnected(_)) => refuse(&format!("{} has ended", entry.name)),
        }
    }
}

/// Notes messages that made room in the queue to the process.
pub(super) fn note_dropped(registry: &Registry, dropped: &[Order]) {
    for order in dropped {
        let Order::Publish { id, .. } = order else { continue };
        let Some(entry) = registry.entry(*id) else { continue };
        let (name, reason) = (entry.name.clone(), "the middleware is too slow".to_owned());
        entry.note_unsent(TransportError::Endpoint { name, reason });
    }
}
