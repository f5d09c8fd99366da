//! The seam to the middleware: raw CDR bytes, and what the middleware knows about them.
//!
//! Whatever ROS users see of a node stands above this seam and is written once; a middleware implements the traits
//! here and nothing else. Bytes are CDR with their four bytes of header, in both directions.

use std::sync::Arc;

use thiserror::Error;

use crate::msg::{
    qos::QosProfile,
    schema::{MessageType, ServiceType},
};

/// One side of a topic: what a publisher offers, or a subscriber asks for.
#[derive(Clone, Debug)]
pub struct TopicEndpoint {
    /// Absolute name, as in `/camera/image_raw`.
    pub name: String,
    /// Type of the messages.
    pub kind: &'static MessageType,
    /// Quality of service.
    pub qos: QosProfile,
}

/// A service that the node offers.
#[derive(Clone, Debug)]
pub struct ServiceEndpoint {
    /// Absolute name, as in `/laser_profiler/start_scan`.
    pub name: String,
    /// Its type.
    pub kind: &'static ServiceType,
}

/// Who a node is in the graph.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeIdentity {
    /// Its name without its namespace.
    pub name: String,
    /// Its namespace, `/` for none.
    pub namespace: String,
}

/// A message that arrived.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// CDR bytes with their header.
    pub data: Vec<u8>,
    /// Identity of the publisher; another one counts anew.
    pub publisher: [u8; 16],
    /// The publisher's counter; `None` where the middleware has none.
    pub sequence: Option<i64>,
    /// When it was sent, nanoseconds since the epoch by the sender's clock; 0 where unknown.
    pub source_time_ns: i64,
    /// When it arrived, nanoseconds since the epoch by this machine's clock.
    pub receive_time_ns: i64,
}

/// A message that arrived and cannot be handed on. It is counted and told, and nothing else happens.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Fault {
    /// Larger than the subscription allows.
    #[error(
        "a message of {bytes} bytes is larger than the {limit_bytes} bytes allowed (max_frame_bytes)"
    )]
    TooLarge {
        /// Its length.
        bytes: usize,
        /// What the subscription allows.
        limit_bytes: usize,
    },
    /// What stands beside the message on the wire is not what this middleware's ROS nodes send.
    #[error("{0}")]
    Foreign(String),
}

/// Takes what arrives, on a thread of the transport: hands it on and returns at once.
pub(crate) type OnArrival = Box<dyn FnMut(Result<Arrival, Fault>) + Send>;

/// Answers a request with the CDR bytes of the response. `None`: the request is malformed and gets no answer. Called on
/// a thread that serves requests and nothing else: it may take a moment.
pub type OnRequest = Box<dyn FnMut(&[u8]) -> Option<Vec<u8>> + Send>;

/// Why the middleware cannot do what it is asked for.
#[derive(Debug, Error)]
pub enum TransportError {
    /// A setting, from the environment, a file or a parameter, that cannot be followed; says what would be right.
    #[error("{setting}: {reason}")]
    Setting {
        /// Its name, as in `ROS_DOMAIN_ID`.
        setting: String,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// The middleware cannot be joined: no router, no port. Says what to do.
    #[error("{0}")]
    Unreachable(String),
    /// One topic or service.
    #[error("{name}: {reason}")]
    Endpoint {
        /// Topic or service.
        name: String,
        /// What the middleware says.
        reason: String,
    },
}

/// A topic of the graph, of this node or of others.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct GraphTopic {
    /// Absolute name.
    pub name: String,
    /// Full type name, as in `sensor_msgs/msg/Image`.
    pub type_name: String,
    /// Publishers, in all nodes.
    pub num_publishers: usize,
    /// Subscribers, in all nodes.
    pub num_subscribers: usize,
}

/// A publisher. Dropping it takes it out of the graph.
pub trait Publication: Send {
    /// Sends CDR bytes. `source_time_ns`: nanoseconds since the epoch, told to subscribers where the middleware can.
    ///
    /// # Errors
    /// The middleware refuses them; the next message may go through.
    fn publish(&mut self, data: &Arc<[u8]>, source_time_ns: i64) -> Result<(), TransportError>;

    /// Subscribers that it reaches now.
    fn num_matched(&self) -> usize;
}

/// A subscriber. Dropping it takes it out of the graph; nothing arrives after that.
pub trait Subscription: Send {
    /// Publishers that reach it now.
    fn num_matched(&self) -> usize;
}

/// A service that answers. Dropping it takes it out of the graph.
pub trait Server: Send {}

/// A node in the graph of one middleware.
pub trait Transport: Send + Sync {
    /// Its name, as in `--transport`.
    fn name(&self) -> &'static str;

    /// Largest message that reaches every peer with stock settings, bytes; `None`: any.
    fn max_reliable_bytes(&self) -> Option<usize>;

    /// Makes a publisher.
    ///
    /// # Errors
    /// The middleware refuses it.
    fn advertise(&self, topic: &TopicEndpoint) -> Result<Box<dyn Publication>, TransportError>;

    /// Makes a subscriber. Messages above `limit_bytes` are faults, and no memory is taken for them where the
    /// middleware allows that to be seen.
    ///
    /// # Errors
    /// The middleware refuses it.
    fn subscribe(
        &self,
        topic: &TopicEndpoint,
        limit_bytes: usize,
        on_arrival: OnArrival,
    ) -> Result<Box<dyn Subscription>, TransportError>;

    /// Offers a service.
    ///
    /// # Errors
    /// The middleware refuses it.
    fn serve(
        &self,
        service: &ServiceEndpoint,
        on_request: OnRequest,
    ) -> Result<Box<dyn Server>, TransportError>;

    /// The topics of the graph, by name and type, as far as they are known now.
    fn topics(&self) -> Vec<GraphTopic>;
}
