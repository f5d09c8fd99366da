//! Our side.

use std::{
    sync::{Arc, mpsc},
    time::{Duration, Instant},
};

use laser_profiler::{
    msg::{
        builtin_interfaces::Time,
        cdr::encode,
        qos::QosProfile,
        schema::{Message, MessageType, ServiceType},
        sensor_msgs::Image,
        std_msgs::Header,
    },
    ros::{
        dds::{DdsSettings, DdsTransport},
        transport::{
            Arrival, Fault, NodeIdentity, Publication, ServiceEndpoint, Subscription,
            TopicEndpoint, Transport,
        },
    },
};

use super::{domain::Domain, peer::Peer};

/// Deadline for events that happen on their own.
pub(crate) const PATIENCE: Duration = Duration::from_secs(30);
/// Capacity for messages that arrive while a test is busy.
const MAX_WAITING: usize = 4096;

/// Bytes of an image message besides its pixels, CDR header included.
pub(crate) const AROUND_PIXELS: u32 = 52;

pub(crate) static TRIGGER: ServiceType =
    ServiceType { name: "std_srvs/srv/Trigger", text: "", hash: "" };

pub(crate) fn settings(domain: &Domain) -> DdsSettings {
    DdsSettings { domain_id: domain.id, ..DdsSettings::default() }
}

pub(crate) fn open(domain: &Domain, name: &str) -> DdsTransport {
    open_with(&settings(domain), name)
}

pub(crate) fn open_with(settings: &DdsSettings, name: &str) -> DdsTransport {
    let identity = NodeIdentity { name: name.to_owned(), namespace: "/cell".to_owned() };
    DdsTransport::open(settings, &identity).unwrap()
}

pub(crate) fn image_topic(name: &str, qos: QosProfile) -> TopicEndpoint {
    topic(name, Image::TYPE, qos)
}

pub(crate) fn topic(name: &str, kind: &'static MessageType, qos: QosProfile) -> TopicEndpoint {
    TopicEndpoint { name: name.to_owned(), kind, qos }
}

pub(crate) fn trigger(name: &str) -> ServiceEndpoint {
    ServiceEndpoint { name: name.to_owned(), kind: &TRIGGER }
}

/// A subscription and its received messages.
pub(crate) struct Inbox {
    pub(crate) subscription: Box<dyn Subscription>,
    arrivals: mpsc::Receiver<Result<Arrival, Fault>>,
}

impl Inbox {
    pub(crate) fn open(node: &dyn Transport, topic: &TopicEndpoint, limit_bytes: usize) -> Self {
        let (sender, arrivals) = mpsc::sync_channel(MAX_WAITING);
        let on_arrival = Box::new(move |arrival| drop(sender.try_send(arrival)));
        let subscription = node.subscribe(topic, limit_bytes, on_arrival).unwrap();
        Self { subscription, arrivals }
    }

    /// Releases a peer's publisher once it is matched here.
    pub(crate) fn release(&self, peer: &mut Peer) {
        eventually("a publisher comes", || self.subscription.num_matched() == 1);
        peer.release();
    }

    pub(crate) fn next(&self) -> Result<Arrival, Fault> {
        self.next_within(PATIENCE).expect("something arrives")
    }

    pub(crate) fn next_within(&self, time: Duration) -> Option<Result<Arrival, Fault>> {
        self.arrivals.recv_timeout(time).ok()
    }
}

/// Waits for an event that happens on its own.
pub(crate) fn eventually(what: &str, mut is_so: impl FnMut() -> bool) {
    let end = Instant::now() + PATIENCE;
    while !is_so() {
        assert!(Instant::now() < end, "{what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

pub(crate) fn wait_for_subscribers(publication: &dyn Publication, wanted: usize) {
    eventually("subscribers come", || publication.num_matched() == wanted);
}

/// An image message, `AROUND_PIXELS` longer than its pixels.
pub(crate) fn image(num_pixels: u32, stamp_ns: i64) -> Arc<[u8]> {
    let stamp = Time {
        sec: i32::try_from(stamp_ns / 1_000_000_000).unwrap(),
        nanosec: u32::try_from(stamp_ns % 1_000_000_000).unwrap(),
    };
    let pixels = vec![7; num_pixels as usize];
    let message = Image {
        header: Header { stamp, frame_id: "camera".into() },
        height: 1,
        width: num_pixels,
        encoding: "mono8".into(),
        is_bigendian: 0,
        step: num_pixels,
        data: &pixels,
    };
    let mut bytes = Vec::new();
    encode(&message, &mut bytes).unwrap();
    bytes.into()
}
