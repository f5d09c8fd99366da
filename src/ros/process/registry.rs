//! The node's endpoints, kept outside the middleware process so that the next one can offer them again.

use std::{
    collections::{BTreeMap, VecDeque},
    sync::{
        Arc, Mutex,
        atomic::{AtomicUsize, Ordering},
        mpsc::SyncSender,
    },
};

use super::{
    lock,
    orders::{Order, Service, Topic},
    outbox::{Kind, Outbox},
    wire::Payload,
};
use crate::{
    msg::qos::Durability,
    ros::transport::{OnArrival, ServiceEndpoint, TopicEndpoint, TransportError},
};

/// Messages that were not published and have not been reported yet, at most; further ones are not counted.
const MAX_UNSENT: usize = 10_000;

/// Orders for a middleware process.
pub(super) type Orders = Outbox<Order>;

/// A request, and the process that waits for its answer.
pub(super) struct Request {
    pub(super) call: u64,
    pub(super) data: Vec<u8>,
    pub(super) asker: Arc<Orders>,
}

/// An endpoint of the node.
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) num_matched: AtomicUsize,
    pub(super) role: Role,
    unsent: Mutex<VecDeque<TransportError>>,
}

pub(super) enum Role {
    Publisher { topic: Topic, latched: Option<Latched> },
    Subscriber { topic: Topic, limit_bytes: usize, on_arrival: Mutex<OnArrival> },
    Server { service: Service, requests: SyncSender<Request> },
}

/// The last messages of a latched topic, oldest first.
pub(super) struct Latched {
    depth: usize,
    messages: Mutex<VecDeque<(Arc<[u8]>, i64)>>,
}

impl Entry {
    pub(super) fn publisher(topic: &TopicEndpoint) -> Self {
        let is_latched = topic.qos.durability == Durability::TransientLocal;
        let depth = usize::try_from(topic.qos.depth).unwrap_or(usize::MAX).max(1);
        let latched = is_latched.then(|| Latched { depth, messages: Mutex::default() });
        Self::of(&topic.name, Role::Publisher { topic: topic.into(), latched })
    }

    pub(super) fn subscriber(
        topic: &TopicEndpoint,
        limit_bytes: usize,
        on_arrival: OnArrival,
    ) -> Self {
        let on_arrival = Mutex::new(on_arrival);
        Self::of(&topic.name, Role::Subscriber { topic: topic.into(), limit_bytes, on_arrival })
    }

    pub(super) fn server(service: &ServiceEndpoint, requests: SyncSender<Request>) -> Self {
        Self::of(&service.name, Role::Server { service: service.into(), requests })
    }

    fn of(name: &str, role: Role) -> Self {
        let (num_matched, unsent) = (AtomicUsize::new(0), Mutex::default());
        Self { name: name.to_owned(), num_matched, role, unsent }
    }

    /// Notes that a message was not published.
    pub(super) fn note_unsent(&self, error: TransportError) {
        let mut unsent = lock(&self.unsent);
        if unsent.len() < MAX_UNSENT {
            unsent.push_back(error);
        }
    }

    /// Takes the reason for the oldest message that was not published.
    pub(super) fn take_unsent(&self) -> Option<TransportError> {
        lock(&self.unsent).pop_front()
    }

    /// Keeps a message if the topic is latched; returns true if it did.
    pub(super) fn keep(&self, data: &Arc<[u8]>, source_time_ns: i64) -> bool {
        let Role::Publisher { latched: Some(latched), .. } = &self.role else { return false };
        let mut messages = lock(&latched.messages);
        messages.push_back((Arc::clone(data), source_time_ns));
        while messages.len() > latched.depth {
            messages.pop_front();
        }
        true
    }

    fn order(&self, id: u64) -> Order {
        match &self.role {
            Role::Publisher { topic, .. } => Order::Advertise { id, topic: topic.clone() },
            Role::Subscriber { topic, limit_bytes, .. } => {
                Order::Subscribe { id, topic: topic.clone(), limit_bytes: *limit_bytes }
            }
            Role::Server { service, .. } => Order::Serve { id, service: service.clone() },
        }
    }

    /// Orders the endpoint, and publishes what a latched topic holds.
    fn order_again(&self, id: u64, orders: &Orders) {
        orders.push(Kind::Control, self.order(id), Payload::None);
        let Role::Publisher { latched: Some(latched), .. } = &self.role else { return };
        for (data, source_time_ns) in lock(&latched.messages).iter() {
            let publish = Order::Publish { id, source_time_ns: *source_time_ns };
            orders.push(Kind::Control, publish, Payload::Shared(Arc::clone(data)));
        }
    }
}

/// The outcome of creating an endpoint.
type Created = Option<TransportError>;

/// All endpoints, and the process that offers them now.
#[derive(Default)]
pub(super) struct Registry(Mutex<State>);

#[derive(Default)]
struct State {
    num_made: u64,
    entries: BTreeMap<u64, Arc<Entry>>,
    /// Absent while there is no process.
    orders: Option<Arc<Orders>>,
    /// Callers that wait for an endpoint's creation.
    waiting: BTreeMap<u64, SyncSender<Created>>,
}

impl Registry {
    /// Adds an endpoint and orders it; the outcome goes to `created`, which is dropped if the process ends first: the
    /// next one offers the endpoint.
    pub(super) fn add(&self, entry: &Arc<Entry>, created: SyncSender<Created>) -> u64 {
        let mut state = lock(&self.0);
        state.num_made += 1;
        let id = state.num_made;
        state.entries.insert(id, Arc::clone(entry));
        if let Some(orders) = &state.orders {
            orders.push(Kind::Control, entry.order(id), Payload::None);
            state.waiting.insert(id, created);
        }
        id
    }

    /// Removes an endpoint.
    pub(super) fn remove(&self, id: u64) {
        let mut state = lock(&self.0);
        let removed = state.entries.remove(&id);
        if let Some(orders) = &state.orders {
            orders.push(Kind::Control, Order::Remove { id }, Payload::None);
        }
        // Dropped after unlocking: a callback may own endpoints.
        drop(state);
        drop(removed);
    }

    /// Returns an endpoint, unless it has been removed.
    pub(super) fn entry(&self, id: u64) -> Option<Arc<Entry>> {
        lock(&self.0).entries.get(&id).cloned()
    }

    /// Returns the current process, if there is one.
    pub(super) fn orders(&self) -> Option<Arc<Orders>> {
        lock(&self.0).orders.clone()
    }

    /// Passes on the outcome of an endpoint's creation; returns it if nobody waits for it.
    pub(super) fn created(&self, id: u64, outcome: Created) -> Created {
        match lock(&self.0).waiting.remove(&id) {
            Some(waiting) => {
                drop(waiting.try_send(outcome));
                None
            }
            None => outcome,
        }
    }

    /// Offers all endpoints through a process that has joined.
    pub(super) fn attach(&self, orders: &Arc<Orders>) {
        let mut state = lock(&self.0);
        for (id, entry) in &state.entries {
            entry.order_again(*id, orders);
        }
        state.orders = Some(Arc::clone(orders));
    }

    /// Notes that the process is gone, and its matches with it.
    pub(super) fn detach(&self) {
        let mut state = lock(&self.0);
        state.orders = None;
        state.waiting.clear();
        for entry in state.entries.values() {
            entry.num_matched.store(0, Ordering::Relaxed);
        }
    }
}
