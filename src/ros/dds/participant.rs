//! The node's participant in a DDS domain.

use std::{
    collections::BTreeMap,
    io,
    net::{Ipv4Addr, SocketAddr, UdpSocket},
    sync::Arc,
    thread,
};

use ros2_client::NodeName;
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, DomainParticipantStatusEvent as Event, GUID,
    Publisher, QosPolicies, RTPSEntity, StatusEvented, Subscriber, Topic, TopicKind,
    bytes::Bytes,
    dds::CreateResult,
    discovery::ReaderProxy,
    no_key::{DataWriter, SimpleDataReader},
};

use super::{
    announcer::Announcer,
    endpoints::{Endpoint, Endpoints},
    first_requests::{FirstRequests, LOOKUP_PERIOD, Match, NUM_LOOKUPS},
    listener::Listener,
    loopback_only, names,
    qos::Side,
    raw::{RawReader, RawWriter, Received},
    second_copies::{Recipient, SecondCopies, usable},
    settings::{DdsSettings, DiscoveryRange},
    static_peers::{StaticPeers, Tap},
};
use crate::ros::transport::{GraphTopic, TransportError};

pub(super) type RawDataReader = SimpleDataReader<Received, RawReader>;
pub(super) type RawDataWriter = DataWriter<Bytes, RawWriter>;

/// A participant with one node, its endpoints and its view of the domain. Fields are dropped in this order: listeners
/// before the domain, and static peers, which forward its farewell, after it.
pub(super) struct Participant {
    _watch: Listener,
    announcer: Arc<Announcer>,
    publisher: Publisher,
    subscriber: Subscriber,
    pub(super) second_copies: SecondCopies,
    socket: UdpSocket,
    domain: DomainParticipant,
    _static_peers: Option<StaticPeers>,
    pub(super) endpoints: Arc<Endpoints>,
    pub(super) node: NodeName,
}

impl Participant {
    /// Joins a domain. `announcer` returns that of the node, here or on another participant.
    ///
    /// # Errors
    /// An invalid setting; no free port or no network.
    pub(super) fn join(
        settings: &DdsSettings,
        node: NodeName,
        announcer: impl FnOnce(&DomainParticipant, &Publisher) -> CreateResult<Arc<Announcer>>,
    ) -> Result<Self, TransportError> {
        let tap = Tap::open(settings)?;
        let unreachable =
            |error: rustdds::dds::CreateError| unreachable(settings.domain_id, &error.to_string());
        let domain = open(settings).map_err(unreachable)?;
        if settings.range == DiscoveryRange::Localhost {
            close_to_other_machines(settings.domain_id);
        }
        let static_peers = tap.map(|tap| StaticPeers::start(tap, domain.guid())).transpose()?;

        let endpoints = Arc::new(Endpoints::default());
        let failed = |error: io::Error| {
            TransportError::Unreachable(format!("cannot prepare DDS services: {error}"))
        };
        let socket = socket(settings.range).map_err(failed)?;
        let first_requests =
            socket.try_clone().and_then(|socket| FirstRequests::start(domain.clone(), socket));
        let second_copies = socket.try_clone().and_then(SecondCopies::start).map_err(failed)?;
        let watch = watch(&domain, Arc::clone(&endpoints), first_requests.map_err(failed)?)?;
        let nothing = QosPolicies::qos_none();
        let publisher = domain.create_publisher(&nothing).map_err(unreachable)?;
        let subscriber = domain.create_subscriber(&nothing).map_err(unreachable)?;
        let announcer = announcer(&domain, &publisher).map_err(unreachable)?;
        Ok(Self {
            _watch: watch,
            announcer,
            publisher,
            subscriber,
            domain,
            _static_peers: static_peers,
            endpoints,
            second_copies,
            socket,
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
        self.endpoints.insert(guid, Endpoint { side, topic, type_name });
        self.announcer.enter(guid, side);
    }

    /// Announces to other nodes that an endpoint is gone.
    pub(super) fn leave(&self, guid: GUID) {
        self.endpoints.remove(guid);
        self.announcer.leave(guid);
    }

    /// Returns the DDS name of the type that a writer of another participant sends.
    pub(super) fn type_sent_by(&self, writer: GUID) -> Option<String> {
        let mut writers = self.domain.discovered_writers().into_iter();
        let found = writers.find(|found| found.writer_proxy.remote_writer_guid == writer);
        found.map(|found| found.publication_topic_data.type_name)
    }

    /// Returns the readers of `peer`'s participant that are matched with an own writer, with their announced addresses.
    /// Waits a little for them, because a match may be reported before the addresses can be looked up.
    pub(super) fn readers_of(&self, writer: GUID, peer: GUID) -> Vec<Recipient> {
        let matched = self.endpoints.matched_of(writer, peer);
        let recipient = |reader: ReaderProxy| Recipient {
            reader: reader.remote_reader_guid,
            addresses: reader.unicast_locator_list.into_iter().map(SocketAddr::from).collect(),
        };
        let look_up = || {
            let readers = self.domain.discovered_readers().into_iter();
            let readers = readers.map(|reader| reader.reader_proxy);
            let readers = readers.filter(|reader| matched.contains(&reader.remote_reader_guid));
            readers.map(recipient).collect()
        };
        for _ in 1..NUM_LOOKUPS {
            let found: Vec<_> = look_up();
            if found.len() == matched.len() {
                return found;
            }
            thread::sleep(LOOKUP_PERIOD);
        }
        look_up()
    }

    /// Sends a message of this node's own, beside those of RustDDS, to where it can be sent.
    pub(super) fn send(&self, message: &[u8], addresses: &[SocketAddr]) {
        for address in usable(addresses) {
            if let Err(error) = self.socket.send_to(message, address) {
                tracing::debug!("a reader at {address}: {error}");
            }
        }
    }

    /// Returns the discovered ROS topics.
    #[cfg(not(feature = "cyclone"))]
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
        ros_topics(own.chain(writers).chain(readers))
    }
}

/// Counts the endpoints of each ROS topic; each with its topic and type, as on DDS.
pub(super) fn ros_topics(
    endpoints: impl Iterator<Item = (Side, String, String)>,
) -> Vec<GraphTopic> {
    let mut topics = BTreeMap::<_, (usize, usize)>::new();
    for (side, topic, type_name) in endpoints {
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

fn open(settings: &DdsSettings) -> CreateResult<DomainParticipant> {
    let builder = DomainParticipantBuilder::new(settings.domain_id);
    if settings.range == DiscoveryRange::Subnet {
        builder.build()
    } else {
        builder.with_only_networks([Ipv4Addr::LOCALHOST]).build()
    }
}

fn close_to_other_machines(domain_id: u16) {
    if let Err(error) = loopback_only::restrict(domain_id) {
        tracing::warn!(
            "other machines can reach the UDP ports of DDS domain {domain_id}: the system does not allow to restrict \
             them to this machine ({error}); block ports {} to {} in the firewall",
            7400 + 250 * u32::from(domain_id),
            7649 + 250 * u32::from(domain_id)
        );
    }
}

/// Returns a socket for messages beside RustDDS's. From the loopback address, the system sends to this machine only.
fn socket(range: DiscoveryRange) -> io::Result<UdpSocket> {
    let is_for_others = range == DiscoveryRange::Subnet;
    let own = if is_for_others { Ipv4Addr::UNSPECIFIED } else { Ipv4Addr::LOCALHOST };
    UdpSocket::bind((own, 0))
}

fn watch(
    domain: &DomainParticipant,
    endpoints: Arc<Endpoints>,
    first_requests: FirstRequests,
) -> Result<Listener, TransportError> {
    let events = domain.status_listener();
    Listener::start("discovery", move |stop| {
        stop.follow(events.as_async_status_stream(), |event| {
            endpoints.apply(&event);
            if let Event::RemoteWriterMatched { local_reader: reader, remote_writer: writer } =
                event
                && endpoints.takes_requests(reader)
            {
                first_requests.ask(Match { reader, writer });
            }
        });
    })
}

pub(super) fn unreachable(domain_id: u16, error: &str) -> TransportError {
    TransportError::Unreachable(format!(
        "cannot join DDS domain {domain_id} ({error}): if other programs use its UDP ports, set another \
         ROS_DOMAIN_ID; if there is no network, set ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST"
    ))
}

fn refused(topic: &str, error: &rustdds::dds::CreateError) -> TransportError {
    TransportError::Endpoint { name: topic.to_owned(), reason: error.to_string() }
}
