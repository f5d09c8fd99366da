//! The messages between the node and its middleware process.

use std::{collections::BTreeMap, sync::Mutex, sync::PoisonError};

use serde::{Deserialize, Serialize};

use crate::{
    msg::{
        qos::QosProfile,
        schema::{MessageType, ServiceType},
    },
    ros::{
        middleware::JoinRequest,
        transport::{Fault, GraphTopic, ServiceEndpoint, TopicEndpoint, TransportError},
    },
};

/// From the node to the process. `id` is the node's number of an endpoint.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Order {
    /// Join the network; the first order.
    Join(JoinRequest),
    /// Create a publisher.
    Advertise { id: u64, topic: Topic },
    /// Publish the payload.
    Publish { id: u64, source_time_ns: i64 },
    /// Create a subscriber.
    Subscribe { id: u64, topic: Topic, limit_bytes: usize },
    /// Offer a service.
    Serve { id: u64, service: Service },
    /// Answer a request with the payload, or not at all.
    Answer { call: u64, is_answered: bool },
    /// Remove an endpoint.
    Remove { id: u64 },
    /// List the graph's topics.
    ListTopics,
}

/// From the process to the node.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Event {
    /// The network is joined.
    Joined { max_reliable_bytes: Option<usize> },
    /// The network cannot be joined; the process ends.
    NotJoined(TransportError),
    /// An endpoint exists, or was rejected.
    Created { id: u64, error: Option<TransportError> },
    /// The payload arrived at a subscriber.
    Arrived { id: u64, origin: Origin },
    /// A message that cannot be delivered.
    Faulty { id: u64, fault: Fault },
    /// The node was too slow for messages.
    Overrun { num_messages: u64 },
    /// The payload is a request to a service.
    Requested { id: u64, call: u64 },
    /// The number of matched endpoints changed.
    Matched { id: u64, num_matched: usize },
    /// A message was not published.
    Unsent { id: u64, error: TransportError },
    /// The graph's topics.
    Topics(Vec<GraphTopic>),
    /// The middleware no longer works; the process must be replaced.
    Failed { reason: String },
    /// A line of the log.
    Log { level: Level, target: String, text: String },
    /// Orders are carried out.
    Alive,
}

/// Origin of a message, as in [`Arrival`](crate::ros::transport::Arrival).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Origin {
    pub(super) publisher: [u8; 16],
    pub(super) sequence: Option<i64>,
    pub(super) source_time_ns: i64,
    pub(super) receive_time_ns: i64,
}

/// Level of a log line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Level {
    Error,
    Warn,
    Info,
    Debug,
    Trace,
}

/// A [`TopicEndpoint`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Topic {
    name: String,
    kind: Kind,
    qos: QosProfile,
}

/// A [`ServiceEndpoint`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Service {
    name: String,
    kind: Kind,
}

/// Name and hash of a type. Middleware needs no definition.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
struct Kind {
    name: String,
    hash: String,
}

impl From<&TopicEndpoint> for Topic {
    fn from(TopicEndpoint { name, kind, qos }: &TopicEndpoint) -> Self {
        let kind = Kind { name: kind.name.to_owned(), hash: kind.hash.to_owned() };
        Self { name: name.clone(), kind, qos: *qos }
    }
}

impl From<&ServiceEndpoint> for Service {
    fn from(ServiceEndpoint { name, kind }: &ServiceEndpoint) -> Self {
        let kind = Kind { name: kind.name.to_owned(), hash: kind.hash.to_owned() };
        Self { name: name.clone(), kind }
    }
}

/// The types of endpoints, each kept for the life of the process: [`TopicEndpoint`] refers to the program's own.
#[derive(Default)]
pub(super) struct Types {
    messages: Mutex<BTreeMap<Kind, &'static MessageType>>,
    services: Mutex<BTreeMap<Kind, &'static ServiceType>>,
}

impl Types {
    pub(super) fn topic(&self, Topic { name, kind, qos }: Topic) -> TopicEndpoint {
        let mut known = self.messages.lock().unwrap_or_else(PoisonError::into_inner);
        let kind = *known.entry(kind).or_insert_with_key(|Kind { name, hash }| {
            let (name, hash) = (leak(name), leak(hash));
            Box::leak(Box::new(MessageType { name, text: "", dependencies: &[], hash }))
        });
        TopicEndpoint { name, kind, qos }
    }

    pub(super) fn service(&self, Service { name, kind }: Service) -> ServiceEndpoint {
        let mut known = self.services.lock().unwrap_or_else(PoisonError::into_inner);
        let kind = *known.entry(kind).or_insert_with_key(|Kind { name, hash }| {
            let (name, hash) = (leak(name), leak(hash));
            Box::leak(Box::new(ServiceType { name, text: "", hash }))
        });
        ServiceEndpoint { name, kind }
    }
}

fn leak(text: &str) -> &'static str {
    Box::leak(text.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msg::{
        schema::Message,
        sensor_msgs::Image,
        std_srvs::{self},
    };

    #[test]
    fn endpoints_keep_name_type_hash_and_qos() {
        let qos = QosProfile::latched(3);
        let sent = TopicEndpoint { name: "/image_raw".to_owned(), kind: Image::TYPE, qos };
        let text = serde_json::to_string(&Topic::from(&sent)).unwrap();
        let types = Types::default();
        let [first, second] = [0, 1].map(|_| types.topic(serde_json::from_str(&text).unwrap()));
        assert_eq!((&first.name, first.qos), (&sent.name, sent.qos));
        assert_eq!((first.kind.name, first.kind.hash), (Image::TYPE.name, Image::TYPE.hash));
        assert!(std::ptr::eq(first.kind, second.kind), "kept once");
        let sent = ServiceEndpoint { name: "/reset".to_owned(), kind: &std_srvs::TRIGGER };
        let service = types.service(Service::from(&sent));
        assert_eq!((service.kind.name, service.kind.hash), (sent.kind.name, sent.kind.hash));
    }
}
