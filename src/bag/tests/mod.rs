//! Tests across the module: written messages are read back, damage is reported, nothing else is lost.

mod round_trip;
mod from_a_time;
mod damage;
mod plain;
mod full_disk;
mod split;
mod foreign;
mod describe;
mod containers;
mod unfinished;
mod recover;

use std::fs;
use std::path::{Path, PathBuf};

use super::{
    Attachment, BagError, BagReader, Compression, Filter, MetadataRecord, RawMessage, ReadOptions,
    RecordOptions, RecordSummary, Recorder, Times, Topic,
};
use crate::msg::qos::QosProfile;

pub(super) const COMPRESSIONS: [Compression; 3] =
    [Compression::None, Compression::Lz4, Compression::Zstd];

pub(super) fn topic(name: &str) -> Topic {
    Topic {
        name: name.into(),
        type_name: "std_msgs/msg/String".into(),
        message_encoding: "cdr".into(),
        schema_encoding: "ros2msg".into(),
        schema: b"string data".to_vec(),
        type_hash: "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18".into(),
        qos: crate::bag::qos::to_yaml(&[QosProfile::reliable(10)]),
    }
}

/// A message to be recorded: number of the topic, times, content.
pub(super) type Entry = (usize, Times, Vec<u8>);

pub(super) fn entry(topic: usize, time_ns: i64, data: &[u8]) -> Entry {
    (
        topic,
        Times { log_ns: time_ns, publish_ns: time_ns - 5, sequence: time_ns as u32 },
        data.to_vec(),
    )
}

pub(super) fn calibration() -> Attachment {
    Attachment {
        name: "calibration.yaml".into(),
        media_type: "application/yaml".into(),
        log_time_ns: 7,
        create_time_ns: 3,
        data: b"beta: 0.5".to_vec(),
    }
}

pub(super) fn parameters() -> MetadataRecord {
    MetadataRecord {
        name: "laser_profiler".into(),
        entries: [("version", "0.1.0"), ("parameters", "a: 1\nb: 2\n")]
            .map(|(key, text)| (key.into(), text.into()))
            .into(),
    }
}

/// Records into `directory`, one chunk for every `flush_every` messages.
pub(super) fn record(
    directory: &Path,
    compression: Compression,
    entries: &[Entry],
    flush_every: usize,
) -> RecordSummary {
    let mut recorder =
        Recorder::create(directory, RecordOptions { compression, force: false }).unwrap();
    let topics =
        ["/image_raw", "/profile", "/silent"].map(|name| recorder.add_topic(&topic(name)).unwrap());
    recorder.attach(&calibration()).unwrap();
    recorder.metadata(&parameters()).unwrap();
    for (number, (topic, times, data)) in entries.iter().enumerate() {
        recorder.write(topics[*topic], *times, data).unwrap();
        if (number + 1) % flush_every == 0 {
            recorder.flush().unwrap();
        }
    }
    recorder.finish().unwrap()
}

/// Twelve messages in six chunks.
pub(super) fn small_entries() -> Vec<Entry> {
    (0..12)
        .map(|number| entry(number % 2, 1_000 + number as i64 * 100, &[number as u8; 40]))
        .collect()
}

/// The bytes of a bag with `small_entries`.
pub(super) fn small_file(compression: Compression) -> Vec<u8> {
    let directory = tempfile::tempdir().unwrap();
    fs::read(record(&directory.path().join("bag"), compression, &small_entries(), 2).file).unwrap()
}

/// Writes bytes as a bare file.
pub(super) fn bare(directory: &Path, bytes: &[u8]) -> PathBuf {
    let path = directory.join("bare.mcap");
    if path.exists() {
        // Overwriting a file makes some file systems wait for the disk.
        fs::remove_file(&path).unwrap();
    }
    fs::write(&path, bytes).unwrap();
    path
}

/// Reads all messages and all errors.
pub(super) fn read_all(
    path: &Path,
    options: &ReadOptions,
) -> Result<(Vec<RawMessage>, Vec<BagError>), BagError> {
    let bag = BagReader::open(path, options)?;
    let (mut messages, mut errors) = (Vec::new(), Vec::new());
    for item in bag.messages(&Filter::all()) {
        match item {
            Ok(message) => messages.push(message),
            Err(error) => errors.push(error),
        }
    }
    Ok((messages, errors))
}

/// The recorded content in comparable form.
pub(super) fn essence(messages: &[RawMessage]) -> Vec<(String, Times, Vec<u8>)> {
    let times = |message: &RawMessage| Times {
        log_ns: message.log_time_ns,
        publish_ns: message.publish_time_ns,
        sequence: message.sequence,
    };
    messages
        .iter()
        .map(|message| (message.topic.name.clone(), times(message), message.data.clone()))
        .collect()
}

pub(super) fn expected(entries: &[Entry]) -> Vec<(String, Times, Vec<u8>)> {
    let mut expected: Vec<_> = entries
        .iter()
        .map(|(topic, times, data)| {
            (["/image_raw", "/profile"][*topic].to_owned(), *times, data.clone())
        })
        .collect();
    expected.sort_by_key(|(_, times, _)| times.log_ns);
    expected
}
