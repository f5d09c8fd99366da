//! A middleware within the process, for tests of everything above [`Transport`]: every message arrives before `publish`
//! returns, and late subscribers of a latched topic receive the last message.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use super::transport::{
    Arrival, Fault, GraphTopic, OnArrival, OnRequest, Publication, Server, ServiceEndpoint,
    Subscription, TopicEndpoint, Transport, TransportError,
};
use crate::msg::qos::{Durability, QosProfile};

type Shared<T> = Arc<Mutex<T>>;

#[derive(Default)]
struct Topic {
    type_name: String,
    subscribers: BTreeMap<u64, Shared<OnArrival>>,
    num_publishers: usize,
    latched: Option<Arrival>,
    qos: Vec<QosProfile>,
}

#[derive(Default)]
struct Network {
    topics: BTreeMap<String, Topic>,
    services: BTreeMap<String, Shared<OnRequest>>,
    num_made: u64,
    max_reliable_bytes: Option<usize>,
}

/// A network; clones share it.
#[derive(Clone, Default)]
pub(crate) struct Loopback(Shared<Network>);

impl Loopback {
    /// Calls a service like a client. Returns `None` if it does not exist or sends no response.
    pub(crate) fn call(&self, service: &str, request: &[u8]) -> Option<Vec<u8>> {
        let on_request = Arc::clone(lock(&self.0).services.get(service)?);
        lock(&on_request)(request)
    }

    /// Creates a network that carries messages of at most `max_bytes`.
    pub(crate) fn carrying(max_bytes: usize) -> Self {
        let network = Self::default();
        lock(&network.0).max_reliable_bytes = Some(max_bytes);
        network
    }

    /// Delivers a message or fault to the subscribers of a topic, as from a remote publisher.
    pub(crate) fn deliver(&self, topic: &str, arrival: &Result<Arrival, Fault>) {
        let network = lock(&self.0);
        let topic = network.topics.get(topic);
        let subscribers: Vec<_> =
            topic.iter().flat_map(|topic| topic.subscribers.values().cloned()).collect();
        drop(network);
        for subscriber in subscribers {
            lock(&subscriber)(arrival.clone());
        }
    }

    /// Returns the quality of service of all endpoints created on a topic.
    pub(crate) fn qos(&self, topic: &str) -> Vec<QosProfile> {
        lock(&self.0).topics.get(topic).map(|topic| topic.qos.clone()).unwrap_or_default()
    }

    /// Returns the names of all services.
    pub(crate) fn services(&self) -> Vec<String> {
        lock(&self.0).services.keys().cloned().collect()
    }
}

fn lock<T>(shared: &Shared<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

struct Writer {
    network: Loopback,
    topic: TopicEndpoint,
    id: u64,
    sequence: i64,
}

impl Publication for Writer {
    fn publish(&mut self, data: &Arc<[u8]>, source_time_ns: i64) -> Result<(), TransportError> {
        self.sequence += 1;
        let mut publisher = [0; 16];
        publisher[..8].copy_from_slice(&self.id.to_le_bytes());
        let arrival = Arrival {
            data: data.to_vec(),
            publisher,
            sequence: Some(self.sequence),
            source_time_ns,
            receive_time_ns: source_time_ns,
        };
        let mut network = lock(&self.network.0);
        let topic = network.topics.entry(self.topic.name.clone()).or_default();
        if self.topic.qos.durability == Durability::TransientLocal {
            topic.latched = Some(arrival.clone());
        }
        let subscribers: Vec<_> = topic.subscribers.values().cloned().collect();
        drop(network);
        for subscriber in subscribers {
            lock(&subscriber)(Ok(arrival.clone()));
        }
        Ok(())
    }

    fn num_matched(&self) -> usize {
        lock(&self.network.0).topics.get(&self.topic.name).map_or(0, |t| t.subscribers.len())
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        if let Some(topic) = lock(&self.network.0).topics.get_mut(&self.topic.name) {
            topic.num_publishers -= 1;
        }
    }
}

struct Reader {
    network: Loopback,
    topic: String,
    id: u64,
}

impl Subscription for Reader {
    fn num_matched(&self) -> usize {
        lock(&self.network.0).topics.get(&self.topic).map_or(0, |topic| topic.num_publishers)
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        let mut network = lock(&self.network.0);
        let topic = network.topics.get_mut(&self.topic);
        let removed = topic.and_then(|topic| topic.subscribers.remove(&self.id));
        // Dropped after unlocking: it may own a publisher, which takes the lock.
        drop(network);
        drop(removed);
    }
}

struct Offered {
    network: Loopback,
    name: String,
}

impl Server for Offered {}

impl Drop for Offered {
    fn drop(&mut self) {
        let removed = lock(&self.network.0).services.remove(&self.name);
        // Dropped after unlocking: it may own a publisher, which takes the lock.
        drop(removed);
    }
}

impl Transport for Loopback {
    fn name(&self) -> &'static str {
        "loopback"
    }

    fn max_reliable_bytes(&self) -> Option<usize> {
        lock(&self.0).max_reliable_bytes
    }

    fn advertise(&self, topic: &TopicEndpoint) -> Result<Box<dyn Publication>, TransportError> {
        let mut network = lock(&self.0);
        network.num_made += 1;
        let id = network.num_made;
        let entry = network.topics.entry(topic.name.clone()).or_default();
        entry.num_publishers += 1;
        entry.qos.push(topic.qos);
        topic.kind.name.clone_into(&mut entry.type_name);
        Ok(Box::new(Writer { network: self.clone(), topic: topic.clone(), id, sequence: 0 }))
    }

    fn subscribe(
        &self,
        topic: &TopicEndpoint,
        _limit_bytes: usize,
        on_arrival: OnArrival,
    ) -> Result<Box<dyn Subscription>, TransportError> {
        let mut network = lock(&self.0);
        network.num_made += 1;
        let id = network.num_made;
        let entry = network.topics.entry(topic.name.clone()).or_default();
        topic.kind.name.clone_into(&mut entry.type_name);
        entry.qos.push(topic.qos);
        let wants_latched = topic.qos.durability == Durability::TransientLocal;
        let latched = entry.latched.clone().filter(|_| wants_latched);
        let on_arrival = Arc::new(Mutex::new(on_arrival));
        entry.subscribers.insert(id, Arc::clone(&on_arrival));
        drop(network);
        if let Some(arrival) = latched {
            lock(&on_arrival)(Ok(arrival));
        }
        Ok(Box::new(Reader { network: self.clone(), topic: topic.name.clone(), id }))
    }

    fn serve(
        &self,
        service: &ServiceEndpoint,
        on_request: OnRequest,
    ) -> Result<Box<dyn Server>, TransportError> {
        let mut network = lock(&self.0);
        if network.services.contains_key(&service.name) {
            let (name, reason) = (service.name.clone(), "is already offered".to_owned());
            return Err(TransportError::Endpoint { name, reason });
        }
        network.services.insert(service.name.clone(), Arc::new(Mutex::new(on_request)));
        Ok(Box::new(Offered { network: self.clone(), name: service.name.clone() }))
    }

    fn topics(&self) -> Vec<GraphTopic> {
        let network = lock(&self.0);
        let topic = |(name, topic): (&String, &Topic)| GraphTopic {
            name: name.clone(),
            type_name: topic.type_name.clone(),
            num_publishers: topic.num_publishers,
            num_subscribers: topic.subscribers.len(),
        };
        network.topics.iter().map(topic).collect()
    }
}
