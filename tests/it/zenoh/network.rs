//! A router from Python's zenoh, our nodes, and the traffic between them.

use std::{
    net::TcpListener,
    path::Path,
    process,
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
        mpsc::{Receiver, sync_channel},
    },
};

use laser_profiler::{
    msg::{
        cdr,
        qos::QosProfile,
        schema::{Message, MessageType},
        sensor_msgs::Image,
        std_msgs::Header,
    },
    ros::{
        transport::{Arrival, Fault, NodeIdentity, Subscription, TopicEndpoint, Transport},
        zenoh::{Role, ZenohSettings, ZenohTransport},
    },
};

use super::peer::{DEADLINE, Peer};
use crate::interop::python;

/// A separate domain on a separate port.
pub(super) struct Network {
    pub(super) python: &'static Path,
    pub(super) port: u16,
    pub(super) domain: String,
}

pub(super) const TOPIC: &str = "/cell/topic";

impl Network {
    /// Without a router; `None` after reporting that there are no peers.
    pub(super) fn without_router() -> Option<Self> {
        let python = python()?;
        let port = free_port();
        Some(Self { python, port, domain: (port % 200).to_string() })
    }

    /// Starts the network with its router, which must outlive its use.
    pub(super) fn start() -> Option<(Self, Peer)> {
        let network = Self::without_router()?;
        let router = network.router();
        Some((network, router))
    }

    pub(super) fn router(&self) -> Peer {
        let router = Peer::start(
            self.python,
            "zenoh_peer.py",
            &["router", "--listen", &format!("tcp/127.0.0.1:{}", self.port)],
        );
        router.event("ready");
        router
    }

    /// Settings as from the environment, with more values for `ZENOH_CONFIG_OVERRIDE`.
    pub(super) fn settings(&self, role: Role, overrides: &str) -> ZenohSettings {
        let key = if role == Role::Router { "listen" } else { "connect" };
        let variable = |name: &str| match name {
            "ROS_DOMAIN_ID" => Some(self.domain.clone()),
            "ZENOH_CONFIG_OVERRIDE" => {
                Some(format!("{key}/endpoints=[\"tcp/127.0.0.1:{}\"];{overrides}", self.port))
            }
            _ => None,
        };
        ZenohSettings::from_environment(&variable, role).unwrap()
    }

    /// Opens one of our nodes.
    pub(super) fn node(&self) -> ZenohTransport {
        open(&self.settings(Role::Node, ""))
    }

    /// A command of `zenoh_peer.py` or, for `send` and `receive`, of `zenoh_images.py`, for `encoder` and `tf`, of
    /// `zenoh_axis.py`.
    pub(super) fn peer(&self, command: &str, arguments: &[&str]) -> Peer {
        let script = match command {
            "send" | "receive" => "zenoh_images.py",
            "encoder" | "tf" => "zenoh_axis.py",
            _ => "zenoh_peer.py",
        };
        let connect = format!("tcp/127.0.0.1:{}", self.port);
        let common = [command, "--connect", &connect, "--domain", &self.domain, "--topic", TOPIC]
            .into_iter();
        let arguments: Vec<_> = common.chain(arguments.iter().copied()).collect();
        Peer::start(self.python, script, &arguments)
    }

    /// Starts a peer for headers, the smallest of our types.
    pub(super) fn header_peer(&self, command: &str, arguments: &[&str]) -> Peer {
        let kind = Header::TYPE;
        let arguments: Vec<_> =
            arguments.iter().copied().chain(["--type", kind.name, "--hash", kind.hash]).collect();
        self.peer(command, &arguments)
    }
}

/// Below the range of ephemeral ports: an outgoing connection could take one before the router does.
pub(super) fn free_port() -> u16 {
    static NUM_TRIED: AtomicU32 = AtomicU32::new(0);
    loop {
        let number = (process::id() % 1000) * 97 + NUM_TRIED.fetch_add(1, Ordering::Relaxed);
        let port = u16::try_from(20_000 + number % 12_000).unwrap();
        if TcpListener::bind(("127.0.0.1", port)).is_ok() {
            return port;
        }
    }
}

pub(super) fn open(settings: &ZenohSettings) -> ZenohTransport {
    ZenohTransport::open(settings, &identity()).unwrap()
}

pub(super) fn identity() -> NodeIdentity {
    NodeIdentity { name: "laser_profiler".to_owned(), namespace: "/cell".to_owned() }
}

pub(super) fn topic(kind: &'static MessageType, qos: QosProfile) -> TopicEndpoint {
    TopicEndpoint { name: TOPIC.to_owned(), kind, qos }
}

pub(super) fn headers(qos: QosProfile) -> TopicEndpoint {
    topic(Header::TYPE, qos)
}

pub(super) fn images() -> TopicEndpoint {
    topic(Image::TYPE, QosProfile::best_effort(5))
}

/// A subscription and its received messages.
pub(super) struct Inbox {
    pub(super) subscription: Box<dyn Subscription>,
    pub(super) arrivals: Receiver<Result<Arrival, Fault>>,
}

impl Inbox {
    pub(super) fn open(node: &dyn Transport, topic: &TopicEndpoint, limit_bytes: usize) -> Self {
        let (sender, arrivals) = sync_channel(10_000);
        let on_arrival = Box::new(move |arrival| sender.try_send(arrival).unwrap());
        let subscription = node.subscribe(topic, limit_bytes, on_arrival).unwrap();
        Self { subscription, arrivals }
    }

    pub(super) fn next(&self) -> Result<Arrival, Fault> {
        self.arrivals.recv_timeout(DEADLINE).unwrap()
    }

    pub(super) fn try_next(&self) -> Option<Result<Arrival, Fault>> {
        self.arrivals.try_recv().ok()
    }
}

/// A header as a message, with `text` for its frame.
pub(super) fn header(text: &str) -> Arc<[u8]> {
    let mut bytes = Vec::new();
    let header = Header { frame_id: text.into(), ..Header::default() };
    cdr::encode(&header, &mut bytes).unwrap();
    bytes.into()
}
