//! `recover` keeps what the channels state, and tells what it writes otherwise.

use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::WriteOptions;
use mcap::records::MessageHeader;

use super::*;
use crate::bag::channels::{QOS_KEY, TYPE_HASH_KEY};
use crate::bag::qos::to_yaml;
use crate::bag::recover::{RecoverOptions, Recovery, recover};

/// A channel: type, encoding of the messages, metadata.
type Channel<'a> = (&'a str, &'a str, &'a [(&'a str, &'a str)]);

/// A file with channels of one topic, and a message on each.
fn file(channels: &[Channel<'_>], message: &[u8]) -> Vec<u8> {
    let options = WriteOptions::new().profile("ros2");
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    for (number, (type_name, encoding, entries)) in channels.iter().enumerate() {
        let schema = writer.add_schema(type_name, "ros2msg", b"string data").unwrap();
        let metadata: BTreeMap<_, _> =
            entries.iter().map(|(key, text)| ((*key).to_owned(), (*text).to_owned())).collect();
        let channel_id = writer.add_channel(schema, "/a", encoding, &metadata).unwrap();
        let time = number as u64;
        let header = MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, message).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// Recovers a file; returns the report, and the channels in the new one by the mcap crate.
fn recovered(bytes: &[u8]) -> (Recovery, Vec<BTreeMap<String, String>>) {
    let directory = tempfile::tempdir().unwrap();
    let output = directory.path().join("whole");
    let recovery = recover(&bare(directory.path(), bytes), &output, RecoverOptions::default());
    let written = fs::read(output.join("whole_0.mcap")).unwrap();
    let summary = mcap::Summary::read(&written).unwrap().unwrap();
    let channels = summary.channels.values().map(|channel| channel.metadata.clone()).collect();
    (recovery.unwrap(), channels)
}

const STRING: &str = "std_msgs/msg/String";

#[test]
fn the_metadata_of_channels_is_kept() {
    let qos = to_yaml(&[QosProfile::reliable(7)]);
    let entries = [("rig", "left"), (QOS_KEY, qos.as_str()), (TYPE_HASH_KEY, "RIHS01_ab")];
    let (recovery, channels) = recovered(&file(&[(STRING, "cdr", &entries)], b"\0\x01\0\0"));
    assert!(recovery.is_complete() && recovery.notes.is_empty(), "{recovery:?}");
    let expected = entries.map(|(key, text)| (key.to_owned(), text.to_owned()));
    assert_eq!(channels, [BTreeMap::from(expected)]);
}

#[test]
fn channels_of_one_topic_are_joined_and_what_does_not_fit_is_told() {
    let qos = [QosProfile::reliable(7), QosProfile::best_effort(1)];
    let texts = qos.map(|qos| to_yaml(&[qos]));
    let channels: [Channel<'_>; 3] = [
        (STRING, "cdr", &[(QOS_KEY, &texts[0]), ("rig", "left")]),
        (STRING, "cdr", &[(QOS_KEY, &texts[1]), ("rig", "right"), ("lens", "8 mm")]),
        (STRING, "json", &[]),
    ];
    let (recovery, channels) = recovered(&file(&channels, b"\0\x01\0\0"));
    assert_eq!(recovery.output.messages, 2);
    let [entries] = &channels[..] else { panic!("{channels:?}") };
    let mut written = crate::bag::qos::parse(&entries[QOS_KEY]).unwrap();
    written.sort_by_key(|profile| profile.depth);
    assert_eq!(written, [qos[1], qos[0]]);
    assert_eq!((&*entries["rig"], &*entries["lens"]), ("left", "8 mm"));
    let left_out = recovery.left_out.join("\n");
    for told in [
        "/a: another \"rig\" of its channel: \"right\"",
        "1 messages: /a: is recorded as",
        "in json",
    ] {
        assert!(left_out.contains(told), "{told}: {left_out}");
    }
}

#[test]
fn what_is_rewritten_is_told() {
    let numbers = "- history: 1\n  depth: 5\n  reliability: 2\n  durability: 2\n  deadline: {sec: 0, nsec: 0}\n  \
        lifespan: {sec: 0, nsec: 0}\n  liveliness: 1\n  liveliness_lease_duration: {sec: 0, nsec: 0}\n";
    let stated: [(&str, &str); 2] = [(QOS_KEY, numbers), ("rig", "left")];
    let image = b"\0\x01\0\0\x01\0\0\0\x05\0\0\0\x04\0\0\0cam\0\x08\0\0\0the file\x05\0\0\0jpeg\0";
    let foxglove = ("foxglove_msgs/msg/CompressedImage", "cdr", &stated[..]);
    let (recovery, channels) = recovered(&file(&[foxglove], image));
    assert!(recovery.is_complete(), "{recovery:?}");
    let notes = recovery.notes.join("\n");
    for told in [
        "/a: messages of foxglove_msgs are rewritten as sensor_msgs/msg/CompressedImage",
        "/a: its quality of service is written as names, as version 9 of rosbag2 does, not as numbers",
    ] {
        assert!(notes.contains(told), "{told}: {notes}");
    }
    assert_eq!(channels[0]["rig"], "left");
    let written = crate::bag::qos::parse(&channels[0][QOS_KEY]).unwrap();
    assert_eq!(written.iter().map(|profile| profile.depth).collect::<Vec<_>>(), [5]);
}
