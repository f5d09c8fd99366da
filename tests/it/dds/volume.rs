//! Images as large and as fast as cameras send them, and results as large as they may be.

use std::time::Duration;

use laser_profiler::{msg::qos::QosProfile, ros::transport::Transport};

use super::{
    domain::Domain,
    node::{Inbox, image, image_topic, open, wait_for_subscribers},
    peer::{Peer, VENDORS},
};

const LIMIT_BYTES: usize = 64 << 20;
const NUM_IMAGES: i64 = 66;
const IMAGE_BYTES: usize = 2592 * 2048 + 52;

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
            assert_eq!(arrival.data.len(), IMAGE_BYTES);
            let pixels = &arrival.data[IMAGE_BYTES - 2592 * 2048..];
            let is_right =
                pixels.iter().enumerate().all(|(at, pixel)| at % 251 == usize::from(*pixel));
            assert!(is_right, "{vendor:?}: image {number} is what was sent");
        }
        peer.wait_for("sent");
    }
}

#[test]
fn every_message_up_to_the_limit_is_delivered() {
    for (vendor, num_pixels) in
        VENDORS.into_iter().flat_map(|vendor| [(vendor, 20_000), (vendor, 96 * 1024 - 64)])
    {
        let domain = Domain::claim();
        let node = open(&domain, "writer");
        assert!(num_pixels as usize + 64 <= node.max_reliable_bytes().unwrap());
        let topic = image_topic("/result", QosProfile::reliable(10));
        let mut publication = node.advertise(&topic).unwrap();
        let arguments = ["subscribe", "--topic", "rt/result", "--reliable", "--count", "200"];
        let Some(peer) = Peer::start(vendor, &domain, &arguments) else { continue };
        wait_for_subscribers(&*publication, 1);
        peer.wait_for("matched");
        let message = image(num_pixels, 1);
        for _ in 0..200 {
            publication.publish(&message, 1).unwrap();
            std::thread::sleep(Duration::from_millis(10));
        }
        let line = peer.wait_for("received");
        assert_eq!(line["count"], 200, "{vendor:?}, {num_pixels} bytes: {line}");
    }
}
