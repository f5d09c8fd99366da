//! The interface to the middleware: raw CDR bytes and their metadata.
//!
//! Everything visible to ROS users is implemented once, above this interface; a middleware implements only the traits
//! here. Bytes are CDR with the four-byte header, in both directions.

use std::sync::{Arc, mpsc::sync_channel};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::msg::{
    qos::QosProfile,
    schema::{MessageType, ServiceType},
};

/// One side of a topic: offered by a publisher or requested by a subscriber.
#[derive(Clone, Debug)]
pub struct TopicEndpoint {
    /// Absolute name, such as `/camera/image_raw`.
    pub name: String,
    /// Type of the messages.
    pub kind: &'static MessageType,
    /// Quality of service.
    pub qos: QosProfile,
}

/// A service that the node offers.
#[derive(Clone, Debug)]
pub struct ServiceEndpoint {
    /// Absolute name, such as `/laser_profiler/start_scan`.
    pub name: String,
    /// Type of the service.
    pub kind: &'static ServiceType,
}

/// Identity of a node in the graph.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NodeIdentity {
    /// Name without the namespace.
    pub name: String,
    /// Namespace, `/` for none.
    pub namespace: String,
}

/// A received message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// CDR bytes with their header.
    pub data: Vec<u8>,
    /// Identity of the publisher; each has its own sequence.
    pub publisher: [u8; 16],
    /// Sequence number of the publisher; `None` if the middleware has none.
    pub sequence: Option<i64>,
    /// Time of sending by the sender's clock, nanoseconds since the epoch; 0: unknown.
    pub source_time_ns: i64,
    /// Time of reception by this machine's clock, nanoseconds since the epoch.
    pub receive_time_ns: i64,
}

/// A received message that cannot be delivered. It is counted and reported, without further effects.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Error)]
pub enum Fault {
    /// Larger than the subscription allows.
    #[error(
        "a message of {bytes} bytes exceeds the limit of {limit_bytes} bytes (max_frame_bytes)"
    )]
    TooLarge {
        /// Length of the message, bytes.
        bytes: usize,
        /// Limit of the subscription, bytes.
        limit_bytes: usize,
    },
    /// Its metadata on the wire are not those of this middleware's ROS nodes.
    #[error("{0}")]
    Foreign(String),
}

/// Callback for received messages, called on a thread of the transport. Must return without blocking.
pub(crate) type OnArrival = Box<dyn FnMut(Result<Arrival, Fault>) + Send>;

/// Callback that returns the CDR bytes of the response to a request; `None` if the request is malformed, which sends no
/// response. Called on a thread that only serves requests, so it may block briefly.
pub type OnRequest = Box<dyn FnMut(&[u8]) -> Option<Vec<u8>> + Send>;

/// Sends the response to one request, at once or later, from any thread. Dropping it sends none.
pub struct Responder(Box<dyn FnOnce(Option<Vec<u8>>) + Send>);

impl Responder {
    /// `respond` gets the CDR bytes of the response, or `None` if there is none.
    pub(crate) fn new(respond: impl FnOnce(Option<Vec<u8>>) + Send + 'static) -> Self {
        Self(Box::new(respond))
    }

    /// Sends the response; `None` if the request is malformed.
    pub(crate) fn respond(self, response: Option<Vec<u8>>) {
        (self.0)(response);
    }
}

/// Callback for a request whose response may take long. It must not wait for it.
pub type OnLateRequest = Box<dyn FnMut(&[u8], Responder) + Send>;

/// Returns a callback that responds at once.
pub(crate) fn at_once(mut on_request: OnRequest) -> OnLateRequest {
    Box::new(move |request, responder| responder.respond(on_request(request)))
}

/// Errors of the middleware.
#[derive(Debug, Serialize, Deserialize, Error)]
pub enum TransportError {
    /// An invalid setting from the environment, a file or a parameter; the reason states valid values.
    #[error("{setting}: {reason}")]
    Setting {
        /// Name of the setting, such as `ROS_DOMAIN_ID`.
        setting: String,
        /// Problem and valid values.
        reason: String,
    },
    /// The network cannot be joined, for example because a router or port is missing. States a remedy.
    #[error("{0}")]
    Unreachable(String),
    /// Error of one topic or service.
    #[error("{name}: {reason}")]
    Endpoint {
        /// Name of the topic or service.
        name: String,
        /// Reason given by the middleware.
        reason: String,
    },
}

/// A topic of the graph, of this node or others.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct GraphTopic {
    /// Absolute name.
    pub name: String,
    /// Full type name, such as `sensor_msgs/msg/Image`.
    pub type_name: String,
    /// Number of publishers in all nodes.
    pub num_publishers: usize,
    /// Number of subscribers in all nodes.
    pub num_subscribers: usize,
}

/// A publisher. Dropping it removes it from the graph.
pub trait Publication: Send {
    /// Sends CDR bytes. `source_time_ns`: time of sending, nanoseconds since the epoch, transmitted if the middleware
    /// supports it.
    ///
    /// # Errors
    /// The middleware rejects the message; later ones may succeed.
    fn publish(&mut self, data: &Arc<[u8]>, source_time_ns: i64) -> Result<(), TransportError>;

    /// Returns the number of matched subscribers.
    fn num_matched(&self) -> usize;
}

/// A subscriber. Dropping it removes it from the graph; nothing is delivered afterwards.
pub trait Subscription: Send {
    /// Returns the number of matched publishers.
    fn num_matched(&self) -> usize;
}

/// A running service. Dropping it removes it from the graph.
pub trait Server: Send {}

/// A node in the graph of one middleware.
pub trait Transport: Send + Sync {
    /// Returns the name of the middleware, as in `--transport`.
    fn name(&self) -> &'static str;

    /// Returns the largest message that reaches every peer with default settings, bytes; `None`: unlimited.
    fn max_reliable_bytes(&self) -> Option<usize>;

    /// Creates a publisher.
    ///
    /// # Errors
    /// The middleware rejects it.
    fn advertise(&self, topic: &TopicEndpoint) -> Result<Box<dyn Publication>, TransportError>;

    /// Creates a subscriber. Messages above `limit_bytes` are reported as faults, without allocating memory for them if
    /// the middleware reveals their size in time.
    ///
    /// # Errors
    /// The middleware rejects it.
    fn subscribe(
        &self,
        topic: &TopicEndpoint,
        limit_bytes: usize,
        on_arrival: OnArrival,
    ) -> Result<Box<dyn Subscription>, TransportError>;

    /// Offers a service.
    ///
    /// # Errors
    /// The middleware rejects it.
    fn serve(
        &self,
        service: &ServiceEndpoint,
        on_request: OnRequest,
    ) -> Result<Box<dyn Server>, TransportError>;

    /// Offers a service whose responses may take long, such as the result of an action. By default, the thread that
    /// serves this service waits for each response; so a middleware with one thread for all services must override it.
    ///
    /// # Errors
    /// The middleware rejects it.
    fn serve_late(
        &self,
        service: &ServiceEndpoint,
        mut on_request: OnLateRequest,
    ) -> Result<Box<dyn Server>, TransportError> {
        let wait = move |request: &[u8]| {
            let (sender, response) = sync_channel(1);
            // The receiver outlives the responder, or nobody waits any more.
            on_request(request, Responder::new(move |response| drop(sender.send(response))));
            response.recv().ok().flatten()
        };
        self.serve(service, Box::new(wait))
    }

    /// Returns the discovered topics of the graph, by name and type.
    fn topics(&self) -> Vec<GraphTopic>;

    /// Returns the reason why this transport no longer works and must be opened again; `None` while it works.
    fn failure(&self) -> Option<String> {
        None
    }

    /// Returns the state of a middleware that runs in a process of its own.
    fn health(&self) -> Health {
        Health::default()
    }
}

/// State of a middleware in a process of its own.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Health {
    /// Number of times that the process was replaced.
    pub num_restarts: u64,
    /// Reason for the last replacement.
    pub last_failure: Option<String>,
    /// Received messages that the node was too slow to take.
    pub num_overrun: u64,
    /// Resident memory of the process, bytes; 0: unknown, or no such process.
    pub resident_bytes: u64,
}
