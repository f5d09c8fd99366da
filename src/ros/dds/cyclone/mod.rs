//! Topics over Cyclone DDS. Services stay on RustDDS, because Cyclone cannot answer those of Fast DDS.
//!
//! The node then has two participants. One announcement lists the endpoints of both, so that others see one node.

mod settings;
mod qos;
mod peers;
mod graph;
mod publication;
mod subscription;

use std::sync::Arc;

use cyclone_topics::Domain;
use ros2_client::{
    NodeName,
    builtin_topics::ros_discovery::{TOPIC_NAME, TYPE_NAME},
};

use self::{graph::Graph, publication::CyclonePublication, subscription::CycloneSubscription};
use super::{
    announcer::Announcer,
    names,
    participant::{Participant, ros_topics, unreachable},
    qos::Side,
    settings::{DdsSettings, DiscoveryRange},
};
use crate::{
    msg::qos::QosProfile,
    ros::transport::{
        GraphTopic, NodeIdentity, OnArrival, Publication, Subscription, TopicEndpoint,
        TransportError,
    },
};

/// User data of rmw's participants: ROS 2 without security has one enclave.
const USER_DATA: &[u8] = b"enclave=/;";
/// Hash of `rmw_dds_common/msg/ParticipantEntitiesInfo` since ROS 2 Jazzy.
const ANNOUNCEMENT_HASH: &str =
    "RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e";

/// The node's participant for topics.
pub(super) struct Topics {
    shared: Arc<Shared>,
}

/// State shared by the endpoints. Fields are dropped in this order.
struct Shared {
    announcer: Arc<Announcer>,
    domain: Domain,
    graph: Arc<Graph>,
    node: NodeName,
}

impl Topics {
    /// Largest reliably delivered message, bytes: clouds of 5 MB reach Cyclone and Fast DDS.
    pub(super) const MAX_RELIABLE_BYTES: Option<usize> = None;

    /// Joins a domain and announces the node there.
    ///
    /// # Errors
    /// An invalid setting; Cyclone's reason if it cannot join.
    pub(super) fn join(
        settings: &DdsSettings,
        identity: &NodeIdentity,
    ) -> Result<Self, TransportError> {
        let node = names::node_name(identity)?;
        let config = settings::config(settings)?;
        let graph = Arc::new(Graph::default());
        let follower = Arc::clone(&graph);
        let domain = Domain::join(&config, USER_DATA, move |change| follower.apply(change));
        let failed =
            |error: cyclone_topics::Error| unreachable(settings.domain_id, &error.to_string());
        let domain = domain.map_err(failed)?;
        settings::report_buffer(&domain, config.receive_buffer_bytes);
        let latched = qos::convert(&QosProfile::latched(1), Side::Writer, ANNOUNCEMENT_HASH);
        let writer = domain.writer(TOPIC_NAME, TYPE_NAME, &latched).map_err(failed)?;
        let send = Box::new(move |body: Vec<u8>| {
            let message = [&[0, 1, 0, 0][..], &body].concat();
            writer
                .write(&Arc::from(message), publication::now_ns())
                .map_err(|error| error.to_string())
        });
        let announcer = Arc::new(Announcer::open(node.clone(), domain.guid(), send));
        Ok(Self { shared: Arc::new(Shared { announcer, domain, graph, node }) })
    }

    /// Returns the participant for services, whose endpoints are announced here, too; `None` if nobody is to be found.
    ///
    /// # Errors
    /// An invalid setting; no free port or no network.
    pub(super) fn services(
        &self,
        settings: &DdsSettings,
    ) -> Result<Option<Arc<Participant>>, TransportError> {
        if settings.range == DiscoveryRange::Off {
            return Ok(None);
        }
        let (node, announcer) = (self.shared.node.clone(), Arc::clone(&self.shared.announcer));
        let joined = Participant::join(settings, node, |_, _| Ok(announcer))?;
        Ok(Some(Arc::new(joined)))
    }

    pub(super) fn advertise(
        &self,
        topic: &TopicEndpoint,
    ) -> Result<Box<dyn Publication>, TransportError> {
        Ok(Box::new(CyclonePublication::open(&self.shared, topic)?))
    }

    pub(super) fn subscribe(
        &self,
        topic: &TopicEndpoint,
        limit_bytes: usize,
        on_arrival: OnArrival,
    ) -> Result<Box<dyn Subscription>, TransportError> {
        Ok(Box::new(CycloneSubscription::open(&self.shared, topic, limit_bytes, on_arrival)?))
    }

    /// Returns the reason why Cyclone no longer works with a peer.
    pub(super) fn failure(&self) -> Option<String> {
        self.shared.graph.failure()
    }

    /// Returns the topics of the graph.
    pub(super) fn topics(&self) -> Vec<GraphTopic> {
        let others = self.shared.domain.endpoints().into_iter().map(|endpoint| {
            let side = match endpoint.side {
                cyclone_topics::Side::Writer => Side::Writer,
                cyclone_topics::Side::Reader => Side::Reader,
            };
            (side, endpoint.topic, endpoint.type_name)
        });
        ros_topics(self.shared.graph.own().into_iter().chain(others))
    }
}

fn refused(name: &str, error: &cyclone_topics::Error) -> TransportError {
    TransportError::Endpoint { name: name.to_owned(), reason: error.to_string() }
}
