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
const PIXELS: usize = 2592 * 2048;

#[test]
fn every_image_of_a_camera_arrives() {
    for vendor in VENDORS {
        let domain = Domain::claim();
        let node = open(&domain, "reader");
        let topic = image_topic("/camera/image_raw", QosProfile::best_effort(5));
        let inbox = Inbox::open(&node, &topic, LIMIT_BYTES);
        let arguments = [
            "publish",
            "--topic",
            "rt/camera/image_raw",
            "--width",
            "2592",
            "--height",
            "2048",
            "--rate",
            "22",
            "--count",
            "66",
        ];
        let Some(peer) = Peer::start(vendor, &domain, &arguments) else { continue };
        for number in 1..=NUM_IMAGES {
            let arrival = inbox.next().unwrap();
            assert_eq!(arrival.sequence, Some(number), "{vendor:?}: none is lost");
            assert_eq!(arrival.data.len(), PIXELS + AROUND_PIXELS as usize);
            let pixels = &arrival.data[AROUND_PIXELS as usize..];
            let is_right =
                pixels.iter().enumerate().all(|(at, pixel)| at % 251 == usize::from(*pixel));
            assert!(is_right, "{vendor:?}: image {number} is what was sent");
        }
        peer.wait_for("sent");
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
    let domain = Domain::claim();
    let node = open(&domain, "writer");
    assert!(num_bytes as usize <= node.max_reliable_bytes().unwrap());
    let topic = image_topic("/result", QosProfile::reliable(10));
    let mut publication = node.advertise(&topic).unwrap();
    let arguments = ["subscribe", "--topic", "rt/result", "--reliable", "--count", "100"];
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
