//! ROS 2 over DDS: RustDDS carries raw CDR bytes; ros2-client provides names and the messages of the graph.
//!
//! Endpoints are those of RustDDS, because ros2-client's are typed: bytes pass through undecoded in both directions.
//!
//! Memory of RustDDS: a reader stores `depth + 1` messages, and for ten seconds up to 128 incomplete messages per
//! publisher. On a network that loses fragments, a best-effort subscription to images of 5 MB can take 700 MB; a
//! reliable one has fragments sent again and stays below 150 MB. RustDDS allocates the length stated in a fragment
//! before this module sees it: `limit_bytes` of a subscription applies to complete messages only. A reliable writer
//! stores sent messages for about six seconds.
//!
//! RustDDS orders the messages of a best-effort subscription by the machine's clock: if that is set back, nothing
//! arrives until it has caught up. Reliable subscriptions are ordered by sequence number.

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

/// Largest reliably delivered message, bytes. RustDDS sends fragments of 256 bytes without pacing, so larger messages
/// overrun the default socket buffers of a Fast DDS reader (measured: 96 KiB always arrive, two thirds of 256 KiB are
/// lost).
const MAX_RELIABLE_BYTES: usize = 96 * 1024;

/// A node in a DDS domain. Leaves the domain when it and all its endpoints are dropped.
pub struct DdsTransport {
    participant: Arc<Participant>,
    service_mapping: ServiceMapping,
}

impl DdsTransport {
    /// Joins the domain as `node`.
    ///
    /// # Errors
    /// An invalid setting, or a domain that cannot be joined; states the remedy.
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
