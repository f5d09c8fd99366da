//! Files of other writers: without chunks, without index, out of order, from ROS 1; and recordings of real cameras.

use std::collections::BTreeMap;
use std::io::{Cursor, Write as _};

use mcap::records::MessageHeader;
use mcap::{WriteOptions, Writer};

use super::*;

type Memory = Writer<Cursor<Vec<u8>>>;

/// A file with one channel and the messages that `write` adds.
fn file(options: WriteOptions, encoding: &str, write: impl FnOnce(&mut Memory, u16)) -> Vec<u8> {
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    let schema = writer.add_schema("std_msgs/msg/String", "ros2msg", b"string data").unwrap();
    let channel = writer.add_channel(schema, "/a", encoding, &BTreeMap::new()).unwrap();
    write(&mut writer, channel);
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

fn put(writer: &mut Memory, channel_id: u16, time: u64) {
    let header = MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
    writer.write_to_known_channel(&header, &time.to_le_bytes()).unwrap();
}

fn times(bytes: &[u8]) -> (Vec<i64>, Vec<BagError>) {
    let directory = tempfile::tempdir().unwrap();
    let (messages, errors) =
        read_all(&bare(directory.path(), bytes), &ReadOptions::default()).unwrap();
    (messages.iter().map(|message| message.log_time_ns).collect(), errors)
}

#[test]
fn unchunked_messages_are_read() {
    let bytes =
        file(WriteOptions::new().use_chunks(false).profile("ros2"), "cdr", |writer, channel| {
            (0..50).for_each(|time| put(writer, channel, time));
        });
    let (times, errors) = times(&bytes);
    assert_eq!(times, (0..50).collect::<Vec<_>>());
    assert!(errors.is_empty(), "{errors:?}");
}

#[test]
fn a_file_without_index_or_summary_is_read() {
    let options = [
        WriteOptions::new().emit_chunk_indexes(false),
        WriteOptions::new().emit_summary_records(false).emit_summary_offsets(false),
    ];
    for options in options {
        let bytes = file(options, "cdr", |writer, channel| {
            for time in 0..20 {
                put(writer, channel, time);
                writer.flush().unwrap();
            }
        });
        let (times, errors) = times(&bytes);
        assert_eq!(times, (0..20).collect::<Vec<_>>());
        assert!(errors.is_empty(), "{errors:?}");
    }
}

#[test]
fn overlapping_chunks_are_read_in_time_order() {
    let bytes = file(WriteOptions::new(), "cdr", |writer, channel| {
        for time in [5, 1, 9, 3, 3, 20, 7, 8, 2, 30] {
            put(writer, channel, time);
            if time % 3 == 0 {
                writer.flush().unwrap();
            }
        }
    });
    let (times, errors) = times(&bytes);
    assert_eq!(times, [1, 2, 3, 3, 5, 7, 8, 9, 20, 30]);
    assert!(errors.is_empty(), "{errors:?}");
}

#[test]
fn sorting_takes_bounded_memory_and_reports_the_limit() {
    let bytes = file(WriteOptions::new().compression(None), "cdr", |writer, channel| {
        // Every chunk begins at time 0, so that all of them would have to wait for the last.
        for time in 1..100 {
            put(writer, channel, 0);
            put(writer, channel, time);
            writer.flush().unwrap();
        }
    });
    let directory = tempfile::tempdir().unwrap();
    let options = ReadOptions { record_limit_bytes: 400, ..ReadOptions::default() };
    let (messages, errors) = read_all(&bare(directory.path(), &bytes), &options).unwrap();
    assert_eq!(messages.len(), 198);
    assert!(matches!(errors[..], [BagError::Unsorted { .. }]), "{errors:?}");
}

#[test]
fn an_incomplete_index_is_detected() {
    // Statistics and chunks of a whole file, but the index of its first chunk only.
    let whole =
        file(WriteOptions::new().calculate_summary_section_crc(false), "cdr", |writer, channel| {
            for time in 0..6 {
                put(writer, channel, time);
                writer.flush().unwrap();
            }
        });
    let chunk_index = mcap::records::op::CHUNK_INDEX;
    let mut at = mcap::MAGIC.len();
    let mut seen = 0;
    let mut bytes = whole.clone();
    while at + 9 < whole.len() {
        if whole[at] == chunk_index {
            seen += 1;
            if seen > 1 {
                // An unassigned opcode: readers ignore it.
                bytes[at] = 0x99;
            }
        }
        at += 9 + u64::from_le_bytes(whole[at + 1..at + 9].try_into().unwrap()) as usize;
    }
    let (mut times, errors) = times(&bytes);
    times.sort_unstable();
    assert_eq!(times, [0, 1, 2, 3, 4, 5]);
    assert!(matches!(errors[..], [BagError::Index { .. }]), "{errors:?}");
}

#[test]
fn ros_1_messages_are_refused_with_their_topic() {
    let bytes = file(WriteOptions::new().profile("ros1"), "ros1", |writer, channel| {
        put(writer, channel, 1);
    });
    let directory = tempfile::tempdir().unwrap();
    let bag = BagReader::open(&bare(directory.path(), &bytes), &ReadOptions::default()).unwrap();
    assert!(bag.notes()[0].contains("\"ros1\""), "{:?}", bag.notes());
    let error = bag.topics()[0].require_cdr().unwrap_err().to_string();
    assert!(error.contains("/a") && error.contains("\"ros1\""), "{error}");
    assert!(topic("/b").require_cdr().is_ok());
}

#[test]
fn a_time_out_of_range_is_reported() {
    let bytes = file(WriteOptions::new(), "cdr", |writer, channel| {
        put(writer, channel, 1);
        put(writer, channel, u64::MAX);
    });
    let (times, errors) = times(&bytes);
    assert_eq!(times, [1]);
    assert!(errors[0].to_string().contains("2262"), "{errors:?}");
}

#[test]
fn recordings_of_real_cameras_open() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data");
    let recordings: [(&str, &[(&str, usize)]); 2] = [
        ("turntable_object", &[("/camera/image_raw", 320), ("/turntable/joint_states", 320)]),
        ("robot_floor", &[("/camera/image_raw/compressed", 85)]),
    ];
    for (name, expected) in recordings {
        let path = data.join(name);
        if !path.exists() {
            // Not by `eprintln!`, which the test harness hides when a test passes.
            let skipped = format!("SKIPPED {name}: {} is missing\n", path.display());
            std::io::stderr().write_all(skipped.as_bytes()).unwrap();
            continue;
        }
        let (messages, errors) = read_all(&path, &ReadOptions::default()).unwrap();
        assert!(errors.is_empty(), "{errors:?}");
        assert!(messages.is_sorted_by_key(|message| message.log_time_ns));
        for (topic, count) in expected {
            assert_eq!(
                messages.iter().filter(|message| message.topic.name == *topic).count(),
                *count,
                "{topic}"
            );
        }
    }
}
