//! Frame positions from an axis on the network: a peer in Python publishes images and the counts of an
//! encoder or poses.

use std::path::Path;

use laser_profiler::{
    bag::{BagReader, Filter, ReadOptions},
    msg::{
        cdr,
        laser_profiler_msgs::{Centerline, EncoderStamped, FrameTrace},
        schema::{Message, MessageType},
        tf2_msgs::TFMessage,
    },
};

use super::network::{Network, TOPIC};
use crate::live::{Node, frames};

const RESULT: &str = "/laser_profiler/centerline";
const COUNT: usize = 100;
const PERIOD_NS: f64 = 1e7;

/// Stamp and trace of every centreline that the node recorded.
fn traces(place: &Path) -> Vec<(i64, FrameTrace)> {
    let bag = std::fs::read_dir(place).unwrap().next().unwrap().unwrap().path();
    let bag = BagReader::open(&bag, &ReadOptions::default()).unwrap();
    let messages = bag.messages(&Filter::topics([RESULT]));
    let traced = messages.map(|message| {
        let data = message.unwrap().data;
        let line: Centerline<'_> = cdr::decode(&data).unwrap();
        (line.header.stamp.to_ns(), line.trace)
    });
    traced.collect()
}

/// The node's recording of images between samples of an axis, and the start time of the peer.
fn moved(
    command: &str,
    kind: &MessageType,
    topic: &str,
    more: &[&str],
) -> Option<(i64, Vec<(i64, FrameTrace)>)> {
    let (network, _router) = Network::start()?;
    let place = tempfile::tempdir().unwrap();
    let remap = format!("image_raw:={TOPIC}");
    let directory = format!("recording.directory:={}", place.path().display());
    let own = ["--transport", "zenoh", "--ros-args", "-r", &remap];
    let record = ["-p", "recording.enabled:=true", "-p", &directory];
    let connect = format!("connect/endpoints=[\"tcp/127.0.0.1:{}\"]", network.port);
    let environment =
        [("ROS_DOMAIN_ID", network.domain.clone()), ("ZENOH_CONFIG_OVERRIDE", connect)];
    let node = Node::start(&[&own[..], &record, more].concat(), &environment);
    let count = COUNT.to_string();
    let result = Centerline::TYPE;
    let wanted =
        ["--topic", RESULT, "--type", result.name, "--hash", result.hash, "--last", &count];
    let receiver = network.peer("receive", &wanted);
    receiver.event("ready");
    let axis = ["--axis-topic", topic, "--type", kind.name, "--hash", kind.hash, "--count", &count];
    let peer = network.peer(command, &axis);
    let start_ns = peer.event("sent")["start_ns"].as_i64().unwrap();
    // A put returns before the image is delivered: only the last centreline shows that the node has them all.
    receiver.event("received");
    let (_, words, _) = node.end();
    assert_eq!(frames(&words)[..2], [COUNT as u64; 2], "{words}");
    Some((start_ns, traces(place.path())))
}

/// Most frames lie clearly between two samples; their position is `value` of the number of samples.
fn holds(traced: &[(i64, FrameTrace)], value: impl Fn(i64) -> f64) {
    let sound: Vec<_> = traced.iter().filter(|(_, trace)| trace.encoder_status == 0).collect();
    assert!(sound.len() >= COUNT - 10, "{} of {COUNT} frames: {traced:?}", sound.len());
    for (stamp_ns, trace) in sound {
        assert_eq!(trace.encoder_source, FrameTrace::SOURCE_HOST, "interpolated: {trace:?}");
        assert!((trace.position - value(*stamp_ns)).abs() < 1e-9, "{stamp_ns}: {trace:?}");
    }
}

#[test]
fn counts_of_an_encoder_become_positions() {
    let source = ["-p", "motion.source:=encoder"];
    let found = moved("encoder", EncoderStamped::TYPE, "/encoder", &source);
    let Some((start_ns, traced)) = found else { return };
    holds(&traced, |stamp_ns| 1e-5 * (1000.0 + 7.0 * (stamp_ns - start_ns) as f64 / PERIOD_NS));
}

#[test]
fn poses_become_the_way_from_the_first_frame() {
    let source = ["-p", "motion.source:=tf", "-p", "motion.part_frame:=base"];
    let Some((_, traced)) = moved("tf", TFMessage::TYPE, "/tf", &source) else { return };
    // Earlier frames have no known position.
    let is_known = |trace: &FrameTrace| trace.encoder_source != FrameTrace::SOURCE_NONE;
    let first = traced.iter().find(|(_, trace)| is_known(trace)).unwrap().0;
    holds(&traced, |stamp_ns| 1e-3 * (stamp_ns - first) as f64 / PERIOD_NS);
}
