//! ROS 2 over DDS: RustDDS carries raw CDR bytes; ros2-client provides names and the messages of the graph.
//!
//! Endpoints are those of RustDDS, because ros2-client's are typed: bytes pass through undecoded in both directions.
//!
//! With the feature `cyclone`, topics are Cyclone's (`cyclone/`), and RustDDS has only the services.

mod settings;
mod names;
mod qos;
mod raw;
mod endpoints;
mod vitals;
mod stream;
mod loopback_only;
mod announcer;
mod listener;
mod rtps;
mod second_copies;
mod first_requests;
mod static_peers;
mod participant;
#[cfg_attr(feature = "cyclone", expect(dead_code, reason = "topics are Cyclone's"))]
mod reader;
#[cfg_attr(feature = "cyclone", expect(dead_code, reason = "topics are Cyclone's"))]
mod writer;
mod rpc;
mod service;
#[cfg(feature = "cyclone")]
mod cyclone;
#[cfg(not(feature = "cyclone"))]
mod rust_topics;

use std::sync::Arc;

pub use settings::{DdsSettings, DiscoveryRange};

#[cfg(feature = "cyclone")]
use self::cyclone::Topics;
#[cfg(not(feature = "cyclone"))]
use self::rust_topics::Topics;
use self::{participant::Participant, service::Service, vitals::Vitals};
use super::{
    node_params::ServiceMapping,
    transport::{
        GraphTopic, NodeIdentity, OnArrival, OnRequest, Publication, Server, ServiceEndpoint,
        Subscription, TopicEndpoint, Transport, TransportError,
    },
};

/// A node in a DDS domain. Leaves the domain when it and all its endpoints are dropped.
pub struct DdsTransport {
    topics: Topics,
    /// `None` if nobody can be found who calls services.
    services: Option<Arc<Participant>>,
    vitals: Vitals,
    service_mapping: ServiceMapping,
}

impl DdsTransport {
    /// Joins the domain as `node`.
    ///
    /// # Errors
    /// An invalid setting, or a domain that cannot be joined; states the remedy.
    pub fn open(settings: &DdsSettings, node: &NodeIdentity) -> Result<Self, TransportError> {
        let topics = Topics::join(settings, node)?;
        let services = topics.services(settings)?;
        let (vitals, service_mapping) = (Vitals::of_participant(), settings.service_mapping);
        Ok(Self { topics, services, vitals, service_mapping })
    }
}

/// A service without callers.
struct Uncalled;

impl Server for Uncalled {}

impl Transport for DdsTransport {
    fn name(&self) -> &'static str {
        "dds"
    }

    fn max_reliable_bytes(&self) -> Option<usize> {
        Topics::MAX_RELIABLE_BYTES
    }

    fn advertise(&self, topic: &TopicEndpoint) -> Result<Box<dyn Publication>, TransportError> {
        self.topics.advertise(topic)
    }

    fn subscribe(
        &self,
        topic: &TopicEndpoint,
        limit_bytes: usize,
        on_arrival: OnArrival,
    ) -> Result<Box<dyn Subscription>, TransportError> {
        self.topics.subscribe(topic, limit_bytes, on_arrival)
    }

    fn serve(
        &self,
        service: &ServiceEndpoint,
        on_request: OnRequest,
    ) -> Result<Box<dyn Server>, TransportError> {
        let Some(participant) = &self.services else { return Ok(Box::new(Uncalled)) };
        Ok(Box::new(Service::open(participant, service, self.service_mapping, on_request)?))
    }

    fn topics(&self) -> Vec<GraphTopic> {
        self.topics.topics()
    }

    fn failure(&self) -> Option<String> {
        let participant = self.services.as_ref()?;
        if self.vitals.has_dead_event_loop() {
            return Some("an event loop of RustDDS has ended".to_owned());
        }
        participant.endpoints.failure().or_else(|| self.topics.failure())
    }
}

/// Opens bytes as a request in every mapping, and answers it.
#[cfg(fuzzing)]
pub(crate) fn fuzz(data: &[u8]) {
    rpc::fuzz(data);
}
