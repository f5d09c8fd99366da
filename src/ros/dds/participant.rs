//! The node's participant in a DDS domain.

use std::{
    collections::BTreeMap,
    net::Ipv4Addr,
    sync::{Arc, Mutex, PoisonError},
};

use ros2_client::NodeName;
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, GUID, Publisher, QosPolicies, RTPSEntity,
    StatusEvented, Subscriber, Topic, TopicKind,
    bytes::Bytes,
    dds::CreateResult,
    no_key::{DataWriter, SimpleDataReader},
};

use super::{
    announcer::Announcer,
    endpoints::{Endpoint, Endpoints},
    listener::Listener,
    names,
    qos::Side,
    raw::{RawReader, RawWriter, Received},
    settings::{DdsSettings, DiscoveryRange},
    static_peers::{StaticPeers, Tap},
};
use crate::ros::transport::{GraphTopic, NodeIdentity, TransportError};

pub(super) type RawDataReader = SimpleDataReader<Received, RawReader>;
pub(super) type RawDataWriter = DataWriter<Bytes, RawWriter>;

/// A participant with one node, its endpoints and its view of the domain. Fields are dropped in this order: listeners
/// before the domain, and static peers, which forward its farewell, after it.
pub(super) struct Participant {
    _watch: Listener,
    announcer: Mutex<Announcer>,
    publisher: Publisher,
    subscriber: Subscriber,
    domain: DomainParticipant,
    _static_peers: Option<StaticPeers>,
    pub(super) endpoints: Arc<Endpoints>,
    pub(super) node: NodeName,
}

impl Participant {
    /// Joins a domain.
    ///
    /// # Errors
    /// An invalid setting; no free port or no network.
    pub(super) fn join(
        settings: &DdsSettings,
        identity: &NodeIdentity,
    ) -> Result<Self, TransportError> {
        let node = names::node_name(identity)?;
        let tap = Tap::open(settings)?;
        let unreachable = |error| unreachable(settings.domain_id, &error);
        let domain = open(settings).map_err(unreachable)?;
        let static_peers = tap.map(|tap| StaticPeers::start(tap, domain.guid())).transpose()?;

        let endpoints = Arc::new(Endpoints::default());
        let watch = watch(&domain, Arc::clone(&endpoints))?;
        let nothing = QosPolicies::qos_none();
        let publisher = domain.create_publisher(&nothing).map_err(unreachable)?;
        let subscriber = domain.create_subscriber(&nothing).map_err(unreachable)?;
        let mut announcer =
            Announcer::open(node.clone(), &domain, &publisher).map_err(unreachable)?;
        announcer.announce(&[]);
        Ok(Self {
            _watch: watch,
            announcer: Mutex::new(announcer),
            publisher,
            subscriber,
            domain,
            _static_peers: static_peers,
            endpoints,
            node,
        })
    }

    /// Creates a reader and announces it to other nodes. Names are those of DDS.
    ///
    /// # Errors
    /// RustDDS rejects it.
    pub(super) fn reader(
        &self,
        topic: &str,
        type_name: &str,
        policies: &QosPolicies,
    ) -> Result<RawDataReader, TransportError> {
        let refused = |error| refused(topic, &error);
        let described = self.topic(topic, type_name, policies).map_err(refused)?;
        // The topic, which owns the cache, carries the limits.
        let reader =
            self.subscriber.create_simple_datareader_no_key(&described, None).map_err(refused)?;
        self.enter(reader.guid(), Side::Reader, topic, type_name);
        Ok(reader)
    }

    /// Creates a writer and announces it to other nodes. Names are those of DDS.
    ///
    /// # Errors
    /// RustDDS rejects it.
    pub(super) fn writer(
        &self,
        topic: &str,
        type_name: &str,
        policies: &QosPolicies,
    ) -> Result<RawDataWriter, TransportError> {
        let refused = |error| refused(topic, &error);
        let described = self.topic(topic, type_name, policies).map_err(refused)?;
        let writer = self.publisher.create_datawriter_no_key(&described, None).map_err(refused)?;
        self.enter(writer.guid(), Side::Writer, topic, type_name);
        Ok(writer)
    }

    fn topic(&self, name: &str, type_name: &str, policies: &QosPolicies) -> CreateResult<Topic> {
        let (name, type_name) = (name.to_owned(), type_name.to_owned());
        self.domain.create_topic(name, type_name, policies, TopicKind::NoKey)
    }

    fn enter(&self, guid: GUID, side: Side, topic: &str, type_name: &str) {
        let (topic, type_name) = (topic.to_owned(), type_name.to_owned());
        let mut announcer = self.announcer.lock().unwrap_or_else(PoisonError::into_inner);
        self.endpoints.insert(guid, Endpoint { side, topic, type_name });
        announcer.announce(&self.endpoints.all());
    }

    /// Announces to other nodes that an endpoint is gone.
    pub(super) fn leave(&self, guid: GUID) {
        let mut announcer = self.announcer.lock().unwrap_or_else(PoisonError::into_inner);
        self.endpoints.remove(guid);
        announcer.announce(&self.endpoints.all());
    }

    /// Returns the DDS name of the type that a writer of another participant sends.
    pub(super) fn type_sent_by(&self, writer: GUID) -> Option<String> {
        let mut writers = self.domain.discovered_writers().into_iter();
        let found = writers.find(|found| found.writer_proxy.remote_writer_guid == writer);
        found.map(|found| found.publication_topic_data.type_name)
    }

    /// Returns the discovered ROS topics.
    pub(super) fn topics(&self) -> Vec<GraphTopic> {
        let own = self.endpoints.all().into_iter();
        let own = own.map(|(_, endpoint)| (endpoint.side, endpoint.topic, endpoint.type_name));
        // RustDDS also discovers the participant's own endpoints.
        let is_other = |guid: GUID| guid.prefix != self.domain.guid().prefix;
        let writers = self.domain.discovered_writers().into_iter();
        let writers = writers.filter(|writer| is_other(writer.writer_proxy.remote_writer_guid));
        let writers = writers.map(|writer| {
            let data = writer.publication_topic_data;
            (Side::Writer, data.topic_name, data.type_name)
        });
        let readers = self.domain.discovered_readers().into_iter();
        let readers = readers.filter(|reader| is_other(reader.reader_proxy.remote_reader_guid));
        let readers = readers.map(|reader| {
            let data = reader.subscription_topic_data;
            (Side::Reader, data.topic_name().clone(), data.type_name().clone())
        });
        let mut topics = BTreeMap::<_, (usize, usize)>::new();
        for (side, topic, type_name) in own.chain(writers).chain(readers) {
            let name = names::ros_topic(&topic).map(str::to_owned);
            let Some(key) = name.zip(names::ros_type(&type_name)) else { continue };
            let (num_publishers, num_subscribers) = topics.entry(key).or_default();
            *(if side == Side::Writer { num_publishers } else { num_subscribers }) += 1;
        }
        let topic = |((name, type_name), (num_publishers, num_subscribers))| GraphTopic {
            name,
            type_name,
            num_publishers,
            num_subscribers,
        };
        topics.into_iter().map(topic).collect()
    }
}

fn open(settings: &DdsSettings) -> CreateResult<DomainParticipant> {
    let builder = DomainParticipantBuilder::new(settings.domain_id);
    match settings.range {
        DiscoveryRange::Subnet => builder.build(),
        DiscoveryRange::Localhost => builder.with_only_networks([Ipv4Addr::LOCALHOST]).build(),
    }
}

fn watch(
    domain: &DomainParticipant,
    endpoints: Arc<Endpoints>,
) -> Result<Listener, TransportError> {
    let events = domain.status_listener();
    Listener::start("discovery", move |stop| {
        stop.follow(events.as_async_status_stream(), |event| endpoints.apply(&event));
    })
}

fn unreachable(domain_id: u16, error: &rustdds::dds::CreateError) -> TransportError {
    TransportError::Unreachable(format!(
        "cannot join DDS domain {domain_id} ({error}): if other programs use its UDP ports, set another \
         ROS_DOMAIN_ID; if there is no network, set ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST"
    ))
}

fn refused(topic: &str, error: &rustdds::dds::CreateError) -> TransportError {
    TransportError::Endpoint { name: topic.to_owned(), reason: error.to_string() }
}
