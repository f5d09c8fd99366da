//! The executable between a camera and a reader in C and C++.

use super::{
    domain::Domain,
    peer::{Peer, VENDORS},
};
use crate::live::{Node, frames};

#[test]
fn every_image_becomes_a_centreline() {
    for vendor in VENDORS {
        let domain = Domain::claim();
        let arguments = ["--transport", "dds", "--ros-args", "-r", "image_raw:=/camera/image_raw"];
        let node = Node::start(&arguments, &[("ROS_DOMAIN_ID", domain.id.to_string())]);
        let wanted = [
            "subscribe",
            "--topic",
            "rt/laser_profiler/centerline",
            "--type",
            "laser_profiler_msgs::msg::dds_::Centerline_",
            "--reliable",
            "--count",
            "1000",
            "--seconds",
            "12",
        ];
        let Some(reader) = Peer::start(vendor, &domain, &wanted) else { continue };
        reader.wait_for("matched");
        let offered = [
            "publish",
            "--topic",
            "rt/camera/image_raw",
            "--width",
            "640",
            "--height",
            "480",
            "--rate",
            "20",
            "--count",
            "100",
        ];
        let Some(camera) = Peer::start(vendor, &domain, &offered) else { continue };
        camera.wait_for("sent");
        let received = reader.wait_for("received");
        let (code, words, _) = node.end();
        let [arrived, processed, rejected, dropped, lost] = frames(&words);
        // With best effort, images sent before discovery are lost. After that all are measured.
        assert!((80..=100).contains(&arrived), "{vendor:?}: {words}");
        assert_eq!((rejected, dropped, lost, code), (0, 0, 0, 0), "{vendor:?}: {words}");
        assert_eq!(received["count"], processed, "{vendor:?}: {received} {words}");
    }
}
