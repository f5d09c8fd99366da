//! Damaged, inconsistent or foreign recordings: a clear error or counted losses, and every good frame is kept.

use std::{fs, path::Path};

use laser_profiler::{
    bag::Topic,
    msg::{
        schema::Message,
        sensor_msgs::{Image, JointState},
    },
};
use tempfile::TempDir;

use crate::{
    program::{end, laser_profiler, limited, replay},
    recordings::{centerline_stamps, good_images, record, record_images, stamp_ns, topic},
};

const NUM_FRAMES: usize = 12;
/// Address space in KiB: an allocation of a false length would exceed it.
const MEMORY: &str = "ulimit -v 1500000";

/// A bare recording, and the file length at which each frame is complete.
fn recording(directory: &TempDir) -> (Vec<u8>, Vec<u64>) {
    let bag = directory.path().join("good");
    let ends = record_images(&bag, &good_images(NUM_FRAMES));
    (fs::read(bag.join("good_0.mcap")).unwrap(), ends)
}

fn stamps(numbers: impl Iterator<Item = usize>) -> Vec<i64> {
    numbers.map(stamp_ns).collect()
}

#[test]
fn files_that_are_not_recordings_are_rejected_by_name() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name);
    fs::write(path("empty.mcap"), b"").unwrap();
    fs::write(path("text.mcap"), "Dear diary, today we scanned a cell.\n".repeat(40)).unwrap();
    fs::create_dir(path("nothing")).unwrap();
    fs::create_dir(path("a_directory.mcap")).unwrap();
    for (name, reason) in [
        ("empty.mcap", "empty"),
        ("text.mcap", "not an MCAP file"),
        ("nothing", "neither metadata.yaml nor an .mcap file"),
        ("a_directory.mcap", "neither metadata.yaml nor an .mcap file"),
        ("missing", "No such file"),
    ] {
        let input = path(name).display().to_string();
        let output = path("out").display().to_string();
        let ended = end(&mut laser_profiler(&["replay", &input, "-o", &output]));
        assert_eq!(ended.code, Some(1), "{name}: {ended:?}");
        assert!(ended.stderr.contains(&input) && ended.stderr.contains(reason), "{ended:?}");
        assert!(!path("out").exists(), "{name}: nothing is written for it");
    }
}

#[test]
fn the_image_topic_must_be_clear() {
    let directory = tempfile::tempdir().unwrap();
    let images = good_images(2);
    let bag = |name: &str, topics: &[Topic]| {
        let path = directory.path().join(name);
        record(&path, topics, &images);
        path.display().to_string()
    };
    let joints = topic("/joint_states", JointState::TYPE);
    let [left, right] =
        ["/left/image_raw", "/right/image_raw"].map(|name| topic(name, Image::TYPE));
    let two = bag("two", &[left.clone(), right]);
    let none = bag("none", &[joints]);
    let json = bag("json", &[Topic { message_encoding: "json".into(), ..left }]);
    let remap = ["--ros-args", "-r", "image_raw:=/middle/image_raw"];
    for (input, arguments, code, reported) in [
        (&two, &[] as &[&str], 2, ["image_raw:=/left/image_raw", "image_raw:=/right/image_raw"]),
        (&two, &remap, 2, ["/middle/image_raw", "/left/image_raw (sensor_msgs/msg/Image)"]),
        (&none, &[], 1, ["holds no images", "/joint_states (sensor_msgs/msg/JointState)"]),
        (&json, &[], 1, ["/left/image_raw", "\"json\""]),
    ] {
        let output = directory.path().join("out").display().to_string();
        let mut command = laser_profiler(&["replay", input, "-o", &output]);
        let ended = end(command.args(arguments));
        assert_eq!(ended.code, Some(code), "{ended:?}");
        for text in reported {
            assert!(ended.stderr.contains(text), "{text}: {ended:?}");
        }
    }
}

#[test]
fn a_truncated_recording_loses_only_its_missing_part() {
    let directory = tempfile::tempdir().unwrap();
    let (whole, ends) = recording(&directory);
    let input = directory.path().join("cut.mcap");
    let output = directory.path().join("out");
    // Inside every chunk, at its end and in the index.
    let cuts = ends.iter().flat_map(|end| [end - 2000, end - 1, *end]);
    for cut in cuts.chain([whole.len() as u64 - 9, whole.len() as u64 - 300]) {
        fs::write(&input, &whole[..cut as usize]).unwrap();
        let complete = ends.iter().filter(|&&end| end <= cut).count();
        if complete == 0 {
            let mut command = laser_profiler(&["replay", "--force", "-o"]);
            let ended = end(command.arg(&output).arg(&input));
            assert!(matches!(ended.code, Some(1 | 3)), "cut at {cut}: {ended:?}");
            assert!(ended.stderr.contains("cut.mcap"), "cut at {cut}: {ended:?}");
            continue;
        }
        let code = if complete == NUM_FRAMES { 0 } else { 3 };
        let (summary, _) = replay_or_damaged(&input, &output, code);
        let found = centerline_stamps(&output);
        assert_eq!(found[..complete], stamps(0..complete), "cut at {cut}: {summary}");
    }
}

/// A file without its index may count as damaged even when no message is missing.
fn replay_or_damaged(input: &Path, output: &Path, code: i32) -> (serde_json::Value, String) {
    let mut command = laser_profiler(&["replay", "--json", "--force", "-o"]);
    let ended = end(command.arg(output).arg(input));
    assert!(ended.code == Some(code) || ended.code == Some(3), "{ended:?}");
    (serde_json::from_str(&ended.stdout).unwrap(), ended.stderr)
}

#[test]
fn a_flipped_bit_costs_at_most_its_frame() {
    let directory = tempfile::tempdir().unwrap();
    let (whole, ends) = recording(&directory);
    let input = directory.path().join("flipped.mcap");
    let output = directory.path().join("out");
    for (hit, pair) in ends.windows(2).enumerate() {
        // In the picture, in the middle of the chunk.
        let place = usize::midpoint(pair[0] as usize, pair[1] as usize);
        let mut bytes = whole.clone();
        bytes[place] ^= 1 << (hit % 8);
        fs::write(&input, bytes).unwrap();
        let (summary, stderr) = replay(&input, &output, 3, &["--force"]);
        assert!(stderr.contains("flipped.mcap: damaged at byte"), "{stderr}");
        let others = (0..NUM_FRAMES).filter(|&number| number != hit + 1);
        assert_eq!(centerline_stamps(&output), stamps(others), "bit at {place}: {summary}");
    }
}

#[test]
fn no_flipped_bit_anywhere_crashes_it() {
    let directory = tempfile::tempdir().unwrap();
    let (whole, ends) = recording(&directory);
    let input = directory.path().join("flipped.mcap").display().to_string();
    let output = directory.path().join("out").display().to_string();
    // The records around the pictures carry more information per byte than the pixels.
    let framing = (0..ends[0] as usize - 4000).chain(ends[NUM_FRAMES - 1] as usize..whole.len());
    for (turn, place) in framing.step_by(23).chain((0..whole.len()).step_by(2003)).enumerate() {
        let mut bytes = whole.clone();
        bytes[place] ^= 1 << (turn % 8);
        fs::write(&input, bytes).unwrap();
        let ended = end(&mut limited(MEMORY, &["replay", &input, "--force", "-o", &output]));
        assert!(matches!(ended.code, Some(0..=3)), "bit at {place}: {ended:?}");
        assert!(!ended.stderr.contains("panicked"), "bit at {place}: {ended:?}");
        assert!(ended.code == Some(0) || ended.stderr.contains("flipped.mcap"), "{ended:?}");
    }
}

#[test]
fn false_lengths_are_rejected() {
    let directory = tempfile::tempdir().unwrap();
    let (whole, ends) = recording(&directory);
    let input = directory.path().join("lying.mcap").display().to_string();
    let output = directory.path().join("out");
    // Behind a chunk comes its index of messages and then the next chunk: opcode, length (8 bytes), times (16 bytes),
    // uncompressed size (8 bytes).
    let chunk = ends[4] as usize + chunk_after(&whole[ends[4] as usize..]);
    for (what, offset) in [("record", 1), ("uncompressed", 25)] {
        for length in [0, 1, 1 << 20, 1 << 33, 1 << 40, u64::MAX / 2, u64::MAX] {
            let mut bytes = whole.clone();
            bytes[chunk + offset..chunk + offset + 8].copy_from_slice(&u64::to_le_bytes(length));
            fs::write(&input, bytes).unwrap();
            let mut command = limited(MEMORY, &["replay", "--force", &input, "-o"]);
            let ended = end(command.arg(&output));
            assert_eq!(ended.code, Some(3), "{what} length {length}: {ended:?}");
            assert!(ended.stderr.contains("lying.mcap"), "{what} length {length}: {ended:?}");
            let found = centerline_stamps(&output);
            let others = stamps((0..NUM_FRAMES).filter(|&number| number != 5));
            assert!(others.iter().all(|stamp| found.contains(stamp)), "{what} {length}: {ended:?}");
        }
    }
}

/// Offset of the first chunk record from here on, going from record to record.
fn chunk_after(bytes: &[u8]) -> usize {
    const CHUNK: u8 = 6;
    let mut at = 0;
    while bytes[at] != CHUNK {
        at += 9 + u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
    }
    at
}
