//! Images as large and as fast as cameras send them, and results as large as they may be.

use std::{thread, time::Duration};

use laser_profiler::{msg::qos::QosProfile, ros::transport::Transport};

use super::{
    domain::Domain,
    node::{AROUND_PIXELS, Inbox, image, image_topic, open, wait_for_subscribers},
    peer::{Peer, VENDORS, Vendor},
};

const LIMIT_BYTES: usize = 64 << 20;
const NUM_IMAGES: i64 = 66;

/// Receives a camera's images for three seconds, compares each with the one sent, and returns the number of losses.
fn num_lost(
    vendor: Vendor,
    qos: QosProfile,
    [width, height]: [usize; 2],
    reliably: &[&str],
) -> Option<i64> {
    let domain = Domain::claim_alone();
    let node = open(&domain, "reader");
    let inbox = Inbox::open(&node, &image_topic("/camera/image_raw", qos), LIMIT_BYTES);
    let (width_, height_) = (width.to_string(), height.to_string());
    let what =
        ["publish", "--topic", "rt/camera/image_raw", "--width", &width_, "--height", &height_];
    let how = ["--rate", "22", "--count", "66", "--depth", "66", "--held"];
    let mut peer = Peer::start(vendor, &domain, &[&what[..], &how, reliably].concat())?;
    inbox.release(&mut peer);
    let (mut num_received, mut last) = (0, 0);
    while last < NUM_IMAGES {
        // The very last may be lost, too.
        let Some(arrival) = inbox.next_within(Duration::from_secs(5)) else { break };
        let arrival = arrival.unwrap();
        assert!(arrival.sequence > Some(last), "{vendor:?}: no image comes twice or late");
        last = arrival.sequence.unwrap();
        assert_eq!(arrival.data.len(), width * height + AROUND_PIXELS as usize);
        let pixels = &arrival.data[AROUND_PIXELS as usize..];
        let is_right = pixels.iter().enumerate().all(|(at, pixel)| at % 251 == usize::from(*pixel));
        assert!(is_right, "{vendor:?}: image {last} is what was sent");
        num_received += 1;
    }
    Some(NUM_IMAGES - num_received)
}

#[test]
fn images_arrive_as_they_were_sent() {
    for vendor in VENDORS {
        let qos = QosProfile::best_effort(5);
        let Some(lost) = num_lost(vendor, qos, [2592, 2048], &[]) else { continue };
        assert!(
            lost <= 6,
            "{vendor:?}: {lost} of {NUM_IMAGES} lost, even for a busy machine too many"
        );
    }
}

#[test]
fn every_image_arrives_that_is_sent_reliably() {
    for vendor in VENDORS {
        let qos = QosProfile::reliable(66);
        let Some(lost) = num_lost(vendor, qos, [1280, 1024], &["--reliable"]) else { continue };
        assert_eq!(lost, 0, "{vendor:?}");
    }
}

#[test]
fn every_message_up_to_the_limit_is_delivered() {
    // Centrelines at a camera's fastest, and slices as large as they get.
    for (num_bytes, rate_hz) in [(20_000, 100), (96 * 1024, 20)] {
        for vendor in VENDORS {
            is_delivered(vendor, num_bytes, rate_hz);
        }
    }
}

fn is_delivered(vendor: Vendor, num_bytes: u32, rate_hz: u32) {
    let domain = Domain::claim_alone();
    let node = open(&domain, "writer");
    assert!(num_bytes as usize <= node.max_reliable_bytes().unwrap_or(usize::MAX));
    let topic = image_topic("/result", QosProfile::reliable(10));
    let mut publication = node.advertise(&topic).unwrap();
    let arguments =
        ["subscribe", "--topic", "rt/result", "--reliable", "--count", "100", "--depth", "100"];
    let Some(peer) = Peer::start(vendor, &domain, &arguments) else { return };
    wait_for_subscribers(&*publication, 1);
    peer.wait_for("matched");
    let message = image(num_bytes - AROUND_PIXELS, 1);
    assert_eq!(message.len(), num_bytes as usize);
    for _ in 0..100 {
        publication.publish(&message, 1).unwrap();
        thread::sleep(Duration::from_secs(1) / rate_hz);
    }
    let line = peer.wait_for("received");
    assert_eq!(line["count"], 100, "{vendor:?}, {num_bytes} bytes: {line}");
}
