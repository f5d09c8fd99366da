//! A node as a process between a camera and a reader that are ours.

use std::time::Duration;

use laser_profiler::{
    msg::{laser_profiler_msgs::Centerline, qos::QosProfile, schema::Message},
    ros::{
        dds::DdsTransport,
        transport::{Publication, Transport},
    },
};

use super::{
    domain::Domain,
    node::{Inbox, eventually, image, image_topic, open, topic},
};
use crate::live::{Node, frames};

const LIMIT_BYTES: usize = 1 << 20;

/// A node between a camera and a reader in this process.
pub(super) struct Line {
    pub(super) node: Node,
    camera: Box<dyn Publication>,
    pub(super) results: Inbox,
    num_sent: i64,
    _network: DdsTransport,
    pub(super) domain: Domain,
}

impl Line {
    pub(super) fn start() -> Self {
        let domain = Domain::claim();
        let arguments = ["--transport", "dds", "--ros-args", "-r", "image_raw:=/camera/image_raw"];
        let node = Node::start(&arguments, &[("ROS_DOMAIN_ID", domain.id.to_string())]);
        let network = open(&domain, "camera");
        let camera =
            network.advertise(&image_topic("/camera/image_raw", QosProfile::reliable(5))).unwrap();
        let name = "/laser_profiler/centerline";
        let results = topic(name, Centerline::TYPE, QosProfile::reliable(50));
        let results = Inbox::open(&network, &results, LIMIT_BYTES);
        Self { node, camera, results, num_sent: 0, _network: network, domain }
    }

    /// Sends images until a centreline of one of them arrives.
    pub(super) fn wait_for_a_result(&mut self) {
        while self.results.next_within(Duration::ZERO).is_some() {}
        eventually("a centreline arrives", || {
            self.num_sent += 1;
            // The stamps of a session must grow.
            self.camera.publish(&image(64, self.num_sent * 1_000_000), 0).unwrap();
            self.results.next_within(Duration::from_millis(100)).is_some()
        });
    }

    pub(super) fn end(self) {
        let (code, words, took) = self.node.end();
        let [received, processed, ..] = frames(&words);
        assert!(received > 0 && processed == received, "{words}");
        assert!(took < Duration::from_secs(2), "SIGTERM took {took:?}, exit code {code}");
    }
}
