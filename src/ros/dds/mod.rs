//! ROS 2 over DDS: RustDDS carries raw CDR bytes, ros2-client knows names and the messages of the graph.
//!
//! Endpoints are RustDDS's own and not ros2-client's, whose are typed: bytes pass unread in both directions.
//!
//! What RustDDS holds in memory: a reader keeps `depth + 1` messages, and up to 128 of a publisher whose fragments have
//! not all arrived, for ten seconds. Where a network loses fragments, a best-effort subscription to images of 5 MB comes
//! to 700 MB so; a reliable one has them sent again and stays below 150 MB. A fragment states its message's length, and
//! RustDDS allocates that before it is seen here: a subscription's `limit_bytes` judges messages that are complete. A
//! reliable writer keeps what it sent for some six seconds.
//!
//! RustDDS orders what a best-effort subscription receives by the machine's clock: when that is set back, nothing
//! arrives until it has caught up. Reliable subscriptions are ordered by number.

mod settings;
mod names;
mod qos;
mod raw;
mod endpoints;
mod announcer;
mod listener;
mod participant;
mod static_peers;
mod reader;
mod writer;
mod rpc;
mod service;

use std::sync::Arc;

pub use settings::{DdsSettings, DiscoveryRange};

use self::{participant::Participant, reader::Reader, service::Service, writer::Writer};
use super::{
    node_params::ServiceMapping,
    transport::{
        GraphTopic, NodeIdentity, OnArrival, OnRequest, Publication, Server, ServiceEndpoint,
        Subscription, TopicEndpoint, Transport, TransportError,
    },
};

/// RustDDS sends fragments of 256 bytes without pacing: what is larger overruns the stock socket buffers of a
/// Fast DDS reader (measured: 96 KiB arrive always, 256 KiB lose two thirds).
const MAX_RELIABLE_BYTES: usize = 96 * 1024;

/// A node in a DDS domain. The domain is left when it and everything made by it is dropped.
pub struct DdsTransport {
    participant: Arc<Participant>,
    service_mapping: ServiceMapping,
}

impl DdsTransport {
    /// Joins the domain as the node.
    ///
    /// # Errors
    /// A setting that cannot be followed; a domain that cannot be joined, and what to do.
    pub fn open(settings: &DdsSettings, node: &NodeIdentity) -> Result<Self, TransportError> {
        let participant = Arc::new(Participant::join(settings, node)?);
        Ok(Self { participant, service_mapping: settings.service_mapping })
    }
}

impl Transport for DdsTransport {
    fn name(&self) -> &'static str {
        "dds"
    }

    fn max_reliable_bytes(&self) -> Option<usize> {
        Some(MAX_RELIABLE_BYTES)
    }

    fn advertise(&self, topic: &TopicEndpoint) -> Result<Box<dyn Publication>, TransportError> {
        Ok(Box::new(Writer::open(&self.participant, topic)?))
    }

    fn subscribe(
        &self,
        topic: &TopicEndpoint,
        limit_bytes: usize,
        on_arrival: OnArrival,
    ) -> Result<Box<dyn Subscription>, TransportError> {
        Ok(Box::new(Reader::open(&self.participant, topic, limit_bytes, on_arrival)?))
    }

    fn serve(
        &self,
        service: &ServiceEndpoint,
        on_request: OnRequest,
    ) -> Result<Box<dyn Server>, TransportError> {
        Ok(Box::new(Service::open(&self.participant, service, self.service_mapping, on_request)?))
    }

    fn topics(&self) -> Vec<GraphTopic> {
        self.participant.topics()
    }
}
