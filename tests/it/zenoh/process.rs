//! The executable between a camera and a reader in Python.

use std::{
    fs,
    path::Path,
    time::{Duration, SystemTime},
};

use laser_profiler::{
    bag::{BagReader, Filter, ReadOptions},
    msg::{
        laser_profiler_msgs::Centerline,
        schema::{Message, MessageType},
        sensor_msgs::{Image, PointCloud2},
    },
};

use super::{
    network::{Network, TOPIC},
    peer::wait_until,
};
use crate::live::{Node, frames};

const RESULT: &str = "/laser_profiler/centerline";
const SMALL: [&str; 6] = ["--width", "64", "--height", "48", "--fps", "100"];

/// The node of a network, its images remapped, with more ROS arguments.
pub(super) fn node(network: &Network, ros: &[&str]) -> Node {
    let remap = format!("image_raw:={TOPIC}");
    let arguments =
        [&["--transport", "zenoh", "--ros-args", "-r", &remap as &str][..], ros].concat();
    let connect = format!("connect/endpoints=[\"tcp/127.0.0.1:{}\"]", network.port);
    let environment =
        [("ROS_DOMAIN_ID", network.domain.clone()), ("ZENOH_CONFIG_OVERRIDE", connect)];
    Node::start(&arguments, &environment)
}

fn recording(directory: &Path) -> [String; 4] {
    let directory = format!("recording.directory:={}", directory.display());
    ["-p".to_owned(), "recording.enabled:=true".to_owned(), "-p".to_owned(), directory]
}

#[test]
fn every_image_becomes_a_centreline_there_and_in_the_bag() {
    let Some((network, _router)) = Network::start() else { return };
    let place = tempfile::tempdir().unwrap();
    let record = recording(place.path());
    let node = node(&network, &record.each_ref().map(String::as_str));
    let kind = Centerline::TYPE;
    let wanted = ["--topic", RESULT, "--type", kind.name, "--hash", kind.hash, "--last", "200"];
    let receiver = network.peer("receive", &wanted);
    receiver.event("ready");
    let sender = network.peer("send", &[&SMALL[..], &["--count", "200"]].concat());
    sender.event("sent");
    // Only the last centreline shows that the node has the last image: a put returns before it is delivered.
    let received = receiver.event("received");
    // The first messages may be sent before discovery finishes; after that none is missing.
    assert_eq!(received["lost"], 0, "{received}");
    assert!(received["received"].as_u64().unwrap() >= 150, "{received}");
    let (code, words, took) = node.end();
    assert_eq!((code, frames(&words)), (0, [200, 200, 0, 0, 0]), "{words}");
    assert!(took < Duration::from_secs(2), "SIGTERM took {took:?}");
    assert_eq!(recorded_ns(place.path(), RESULT).unwrap().len(), 200);
    let bag = fs::read_dir(place.path()).unwrap().next().unwrap().unwrap().path();
    assert!(bag.join("metadata.yaml").is_file(), "the bag is finished");
}

#[test]
fn losses_in_a_relay_are_counted_exactly() {
    let Some((network, _router)) = Network::start() else { return };
    let node = node(&network, &[]);
    let kind = Image::TYPE;
    let before = ["--topic", "/camera/before", "--count", "400"];
    let to = ["--to", TOPIC, "--type", kind.name, "--hash", kind.hash, "--loss", "5"];
    let relay = network.peer("relay", &[&before[..], &to].concat());
    relay.event("ready");
    let result = Centerline::TYPE;
    let wanted = ["--topic", RESULT, "--type", result.name, "--hash", result.hash, "--idle", "2"];
    let receiver = network.peer("receive", &wanted);
    receiver.event("ready");
    let _sender = network.peer("send", &[&before[..], &SMALL, &["--linger", "60"]].concat());
    let relayed = relay.event("relayed");
    let (forwarded, injected) =
        (relayed["forwarded"].as_u64().unwrap(), relayed["injected"].as_u64().unwrap());
    // A put returns before the image is delivered: the node has them all when no more centrelines come.
    receiver.event("received");
    let (code, words, _) = node.end();
    let [received, processed, rejected, dropped, lost] = frames(&words);
    assert_eq!((received, rejected, dropped), (forwarded, 0, 0), "{words} {relayed}");
    assert_eq!((processed, lost), (forwarded, injected), "{words} {relayed}");
    assert!(injected > 0);
    assert_eq!(code, 3, "finished, but data was lost");
}

#[test]
fn a_reader_at_1_hz_on_the_clouds_costs_the_others_nothing() {
    let Some((network, _router)) = Network::start() else { return };
    let calibrated = [
        "-p",
        "calibration_file:=launch_configs/cell.calibration.yaml",
        "-p",
        "extraction.min_segment_area:=100",
        "-p",
        "slice.profiles:=10",
    ];
    let node = node(&network, &calibrated);
    let listen = |topic: &str, kind: &MessageType, more: &[&str]| {
        let wanted = ["--topic", topic, "--type", kind.name, "--hash", kind.hash];
        let receiver = network.peer("receive", &[&wanted[..], more].concat());
        receiver.event("ready");
        receiver
    };
    let slow = listen("/laser_profiler/points", PointCloud2::TYPE, &["--slow", "1"]);
    let other = listen(RESULT, Centerline::TYPE, &[]);
    // A slice of 10 profiles of 640 points, 100 KB, ten times a second.
    let images = ["--stripe", "--width", "640", "--height", "480", "--fps", "100"];
    let sender = network.peer("send", &[&images[..], &["--count", "1000"]].concat());
    sender.event("sent");
    let received = other.event("received");
    let lost = received["lost"].as_u64().unwrap();
    assert!(received["received"].as_u64().unwrap() > 900 && lost <= 10, "{received}");
    drop(slow);
    let (_, words, _) = node.end();
    assert_eq!(frames(&words)[1], 1000, "{words}");
}

#[test]
fn after_kill_9_everything_older_than_a_second_is_there() {
    let Some((network, _router)) = Network::start() else { return };
    let place = tempfile::tempdir().unwrap();
    let record = recording(place.path());
    let node = node(&network, &record.each_ref().map(String::as_str));
    let forever = ["--seconds", "60"];
    let _sender = network.peer("send", &[&SMALL[..], &forever].concat());
    wait_until("a flushed recording", || {
        recorded_ns(place.path(), RESULT).is_some_and(|recorded| recorded.len() > 100)
    });
    node.kill();
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap();
    let now_ns = i64::try_from(now.as_nanos()).unwrap();
    let recorded_ns = recorded_ns(place.path(), RESULT).unwrap();
    let youngest = now_ns - recorded_ns.last().unwrap();
    assert!(youngest < 2_000_000_000, "the last {youngest} ns are lost");
    assert!(recorded_ns.windows(2).all(|pair| pair[0] < pair[1]));
}

/// The log times of a topic in the bag of a directory; `None` before there is one.
fn recorded_ns(directory: &Path, topic: &str) -> Option<Vec<i64>> {
    let bag = fs::read_dir(directory).unwrap().next()?.unwrap().path();
    let bag = BagReader::open(&bag, &ReadOptions::default()).ok()?;
    let messages = bag.messages(&Filter::topics([topic]));
    Some(messages.flatten().map(|message| message.log_time_ns).collect())
}
