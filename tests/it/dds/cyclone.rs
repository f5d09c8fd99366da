//! Features of Cyclone that RustDDS lacks: large clouds, type hashes, the exact depth, and peers that stop and die.

use std::{
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use laser_profiler::{
    msg::{qos::QosProfile, schema::Message, sensor_msgs::Image},
    ros::{
        dds::{DdsSettings, DiscoveryRange},
        transport::{Publication, Transport},
    },
};

use super::{
    domain::Domain,
    node::{
        AROUND_PIXELS, Inbox, eventually, image, image_topic, open, open_with, settings,
        wait_for_subscribers,
    },
    peer::{Peer, VENDORS, Vendor},
};
use crate::live::Node;

const LIMIT_BYTES: usize = 64 << 20;
/// A cloud of 260 000 points.
const CLOUD_BYTES: u32 = 5 << 20;

fn publish_at(publication: &mut dyn Publication, message: &Arc<[u8]>, times: u32, rate_hz: u32) {
    for _ in 0..times {
        publication.publish(message, 1).unwrap();
        thread::sleep(Duration::from_secs(1) / rate_hz);
    }
}

#[test]
fn clouds_of_5_mb_reach_both_vendors() {
    for vendor in VENDORS {
        let domain = Domain::claim_alone();
        let node = open(&domain, "writer");
        assert_eq!(node.max_reliable_bytes(), None);
        let mut publication =
            node.advertise(&image_topic("/points", QosProfile::reliable(10))).unwrap();
        let arguments = ["subscribe", "--topic", "rt/points", "--reliable", "--count", "10"];
        let Some(peer) = Peer::start(vendor, &domain, &arguments) else { continue };
        wait_for_subscribers(&*publication, 1);
        peer.wait_for("matched");
        publish_at(&mut *publication, &image(CLOUD_BYTES - AROUND_PIXELS, 1), 10, 2);
        let line = peer.wait_for("received");
        assert_eq!(line["count"], 10, "{vendor:?}: {line}");
        assert_eq!(line["bytes"], 10 * CLOUD_BYTES, "{vendor:?}: {line}");
    }
}

#[test]
fn the_type_hash_is_in_discovery() {
    for vendor in VENDORS {
        let domain = Domain::claim();
        let node = open(&domain, "writer");
        let _publication = node.advertise(&image_topic("/x", QosProfile::reliable(1))).unwrap();
        let Some(peer) = Peer::start(vendor, &domain, &["discover", "--topic", "rt/x"]) else {
            continue;
        };
        let line = peer.wait_for("publisher");
        assert_eq!(line["type"], "sensor_msgs::msg::dds_::Image_", "{vendor:?}");
        assert_eq!(line["user_data"], format!("typehash={};", Image::TYPE.hash), "{vendor:?}");
    }
}

#[test]
fn a_late_subscriber_receives_exactly_the_depth() {
    for vendor in VENDORS {
        let domain = Domain::claim();
        let node = open(&domain, "writer");
        let topic = image_topic("/latched", QosProfile::latched(1));
        let mut publication = node.advertise(&topic).unwrap();
        for number in 1..=9 {
            publication.publish(&image(100, number), number).unwrap();
        }
        let arguments = ["subscribe", "--topic", "rt/latched", "--latched", "--count", "2"];
        let Some(peer) = Peer::start(vendor, &domain, &arguments) else { continue };
        wait_for_subscribers(&*publication, 1);
        peer.wait_for("matched");
        // If an older one were sent, the peer would have two before this one, which is longer.
        let late = Inbox::open(&node, &topic, LIMIT_BYTES);
        assert_eq!(late.next().unwrap().data, *image(100, 9));
        // Time for the old one: its delivery is not acknowledged to the application.
        thread::sleep(Duration::from_secs(1));
        publication.publish(&image(1000, 10), 10).unwrap();
        let line = peer.wait_for("received");
        let expected = 100 + 1000 + 2 * AROUND_PIXELS;
        assert_eq!(line["bytes"], expected, "{vendor:?}: {line}");
    }
}

#[test]
fn a_stopped_subscriber_takes_nothing_from_the_others() {
    for vendor in VENDORS {
        let domain = Domain::claim();
        let node = open(&domain, "writer");
        let mut publication = node.advertise(&image_topic("/x", QosProfile::reliable(10))).unwrap();
        let subscribe = ["subscribe", "--topic", "rt/x", "--reliable", "--depth", "100", "--count"];
        let start = |count| Peer::start(vendor, &domain, &[&subscribe[..], &[count]].concat());
        let (Some(stopped), Some(living)) = (start("1000"), start("60")) else { continue };
        wait_for_subscribers(&*publication, 2);
        for peer in [&stopped, &living] {
            peer.wait_for("matched");
        }
        stopped.signal("STOP");
        // More than RustDDS stores, and longer than a lease.
        publish_at(&mut *publication, &image(1_000_000, 1), 60, 5);
        let line = living.wait_for("received");
        assert_eq!(line["count"], 60, "{vendor:?}: {line}");
    }
}

/// Receives until a message comes that was sent after `since`.
fn is_fresh(inbox: &Inbox, since: Instant) -> bool {
    // Messages are taken at once: one that arrives after a quiet second has just been sent.
    inbox.next_within(Duration::from_secs(1)).is_some() && since.elapsed() > Duration::from_secs(2)
}

/// For longer, see `replaced.rs`.
#[test]
fn a_publisher_that_was_silent_is_heard_again() {
    for vendor in VENDORS {
        let domain = Domain::claim();
        let node = open(&domain, "reader");
        let topic = image_topic("/camera/image_raw", QosProfile::best_effort(5));
        let inbox = Inbox::open(&node, &topic, LIMIT_BYTES);
        let arguments =
            ["publish", "--topic", "rt/camera/image_raw", "--rate", "20", "--count", "100000"];
        let Some(peer) = Peer::start(vendor, &domain, &arguments) else { continue };
        inbox.next().unwrap();
        peer.signal("STOP");
        thread::sleep(Duration::from_secs(1));
        // What was on its way.
        while inbox.next_within(Duration::from_millis(200)).is_some() {}
        peer.signal("CONT");
        let since = Instant::now();
        eventually("images come again", || is_fresh(&inbox, since));
    }
}

#[test]
fn a_node_that_was_stopped_measures_again() {
    for (vendor, silence_s) in [(Vendor::Cyclone, 1), (Vendor::Cyclone, 15), (Vendor::FastDds, 15)]
    {
        let domain = Domain::claim();
        let arguments = ["--transport", "dds", "--ros-args", "-r", "image_raw:=/camera/image_raw"];
        let node = Node::start(&arguments, &[("ROS_DOMAIN_ID", domain.id.to_string())]);
        let arguments = ["publish", "--topic", "rt/camera/image_raw", "--rate", "10", "--count"];
        let Some(_camera) = Peer::start(vendor, &domain, &[&arguments[..], &["100000"]].concat())
        else {
            continue;
        };
        let results = ["subscribe", "--topic", "rt/laser_profiler/centerline", "--count", "20"];
        let kind = ["--type", "laser_profiler_msgs::msg::dds_::Centerline_", "--reliable"];
        let start = || Peer::start(vendor, &domain, &[&results[..], &kind].concat()).unwrap();
        let before = start().wait_for("received");
        assert_eq!(before["count"], 20, "{vendor:?}");
        node.signal("STOP");
        thread::sleep(Duration::from_secs(silence_s));
        node.signal("CONT");
        let after = start().wait_for("received");
        assert_eq!(after["count"], 20, "{vendor:?} after {silence_s} s: {after}");
        drop(node);
    }
}

#[test]
fn a_publisher_that_is_killed_and_comes_back_is_heard_every_time() {
    let domain = Domain::claim();
    let node = open(&domain, "reader");
    let topic = image_topic("/camera/image_raw", QosProfile::best_effort(5));
    let inbox = Inbox::open(&node, &topic, LIMIT_BYTES);
    let arguments = ["publish", "--topic", "rt/camera/image_raw", "--count", "100000"];
    let mut known = Vec::new();
    for round in 0..20 {
        let vendor = VENDORS[round % 2];
        let Some(_killed_at_the_end) = Peer::start(vendor, &domain, &arguments) else { return };
        let publisher = loop {
            let publisher = inbox.next().unwrap().publisher;
            if !known.contains(&publisher) {
                break publisher;
            }
        };
        known.push(publisher);
    }
}

#[test]
fn without_discovery_nobody_is_found() {
    let domain = Domain::claim();
    let off = DdsSettings { range: DiscoveryRange::Off, ..settings(&domain) };
    let (alone, other) = (open_with(&off, "alone"), open(&domain, "other"));
    let topic = image_topic("/x", QosProfile::reliable(1));
    let lonely = alone.advertise(&topic).unwrap();
    let _inbox = Inbox::open(&other, &topic, LIMIT_BYTES);
    let heard = other.advertise(&topic).unwrap();
    // By then, a node that looks for others has found them.
    wait_for_subscribers(&*heard, 1);
    assert_eq!(lonely.num_matched(), 0);
}
