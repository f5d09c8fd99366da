//! Small inputs that state a lot: memory stays in proportion, and the error says what is too much.

use std::{fmt::Write, fs, os::unix::fs::symlink, path::Path};

use mcap::records::op;

use crate::{
    memory::peak_kib_and_code,
    program::{end, laser_profiler},
    recordings::{good_images, record_images},
};

/// Of the program itself, of one chunk of the largest size, and of the messages that wait in order of time.
const ENOUGH_KIB: u64 = 400 << 10;

fn info(bag: &Path) -> (u64, Option<i32>) {
    peak_kib_and_code(laser_profiler(&["info", "--json"]).arg(bag))
}

fn describe(bag: &Path, files: impl Iterator<Item = String>) {
    let mut text = "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: mcap\n  \
                    relative_file_paths:\n"
        .to_owned();
    for file in files {
        writeln!(text, "  - {file}").unwrap();
    }
    fs::write(bag.join("metadata.yaml"), text).unwrap();
}

#[test]
fn a_file_that_is_listed_many_times_is_read_once() {
    let place = tempfile::tempdir().unwrap();
    let bag = place.path().join("bag");
    record_images(&bag, &good_images(3));
    symlink(".", bag.join("again")).unwrap();
    // A link to its own folder gives a file any number of names.
    describe(&bag, (0..9000).map(|depth| format!("{}bag_0.mcap", "again/".repeat(depth % 30))));
    let ended = end(laser_profiler(&["info", "--json"]).arg(&bag));
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let info: serde_json::Value = serde_json::from_str(&ended.stdout).unwrap();
    assert_eq!((&info["messages"], info["files"].as_array().unwrap().len()), (&3.into(), 1));
}

#[test]
fn a_description_of_very_many_files_takes_little_memory() {
    let place = tempfile::tempdir().unwrap();
    let bag = place.path().join("bag");
    record_images(&bag, &good_images(3));
    describe(
        &bag,
        ["bag_0.mcap".to_owned()].into_iter().chain((1..60_000).map(|n| format!("{n}.mcap"))),
    );
    let (peak, code) = info(&bag);
    eprintln!("60 000 missing files: {peak} KiB");
    assert_eq!(code, Some(3), "they are missing");
    assert!(peak < ENOUGH_KIB, "{peak} KiB");
    let ended = end(laser_profiler(&["info"]).arg(&bag));
    assert!(ended.stdout.contains("it lists 60000 files"), "{:?}", ended.code);
}

/// A text that repeats a long text by references.
fn references(long: &str, num: usize) -> String {
    // As many definitions as the parser wants for that many references.
    let mut text = format!("long: &long {}\nshort:\n", long.repeat(100_000));
    for number in 0..num / 10 {
        writeln!(text, "- &a{number} x").unwrap();
    }
    text += "files:\n";
    for _ in 0..num {
        text += "- *long\n";
    }
    text
}

#[test]
fn references_in_yaml_multiply_nothing() {
    let place = tempfile::tempdir().unwrap();
    let bomb = references("0123456789", 20_000);
    let bag = place.path().join("bag");
    record_images(&bag, &good_images(3));
    let relative = bomb.replace("files:", "relative_file_paths:").replace('\n', "\n  ");
    let head = "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: mcap\n  ";
    fs::write(bag.join("metadata.yaml"), format!("{head}{relative}\n")).unwrap();
    let (peak, code) = info(&bag);
    eprintln!("metadata.yaml with references: {peak} KiB");
    assert!(code == Some(0) && peak < ENOUGH_KIB, "{code:?}, {peak} KiB");

    let file = place.path().join("p.yaml");
    let nested = bomb.replace('\n', "\n    ");
    for text in [
        format!("/**:\n  ros__parameters:\n    {nested}\n"),
        format!("type: projective\n{bomb}"),
        format!("frames: 3\n{bomb}"),
    ] {
        // Below the limit on the size of the file, so that the references count.
        let text = text.replacen(&"0123456789".repeat(25_000), "", 1);
        assert!(text.len() < 1 << 20, "{} bytes", text.len());
        fs::write(&file, text).unwrap();
        let path = file.to_str().unwrap();
        let output = place.path().join("out");
        let output = output.to_str().unwrap();
        for arguments in [
            &["replay", "bags/film_defects", "-o", output, "--params-file", path][..],
            &[
                "replay",
                "bags/film_defects",
                "-o",
                output,
                "--ros-args",
                "-p",
                &format!("calibration_file:={path}"),
            ],
            &["simulate", path, "-o", output],
        ] {
            let (peak, code) = peak_kib_and_code(&mut laser_profiler(arguments));
            assert!(
                matches!(code, Some(1 | 2)) && peak < ENOUGH_KIB,
                "{arguments:?}: {code:?}, {peak} KiB"
            );
        }
    }
}

/// A record with its opcode and length.
fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode], (body.len() as u64).to_le_bytes().as_slice(), body].concat()
}

/// A chunk of messages without content, all at the same time.
fn chunk_of_empty_messages(num: usize) -> Vec<u8> {
    // Channel 0, sequence number 0, log time, publish time.
    let header = [&[0; 6], 1_u64.to_le_bytes().as_slice(), &1_u64.to_le_bytes()].concat();
    let messages = record(op::MESSAGE, &header).repeat(num);
    let packed = zstd::encode_all(&*messages, 3).unwrap();
    let mut body = Vec::new();
    for number in [1_u64, 1, messages.len() as u64] {
        body.extend(number.to_le_bytes());
    }
    body.extend(0_u32.to_le_bytes());
    body.extend([4_u32.to_le_bytes().as_slice(), b"zstd"].concat());
    body.extend((packed.len() as u64).to_le_bytes());
    body.extend(packed);
    record(op::CHUNK, &body)
}

#[test]
fn messages_without_content_take_their_share_of_the_limits() {
    let place = tempfile::tempdir().unwrap();
    let bag = place.path().join("bomb.mcap");
    let text = |text: &[u8]| [(text.len() as u32).to_le_bytes().as_slice(), text].concat();
    let header = record(op::HEADER, &[text(b"ros2"), text(b"bomb")].concat());
    let channel = [[0; 4].as_slice(), &text(b"/empty"), &text(b"cdr"), &[0; 4]].concat();
    let chunk = chunk_of_empty_messages(1_200_000);
    let file = [mcap::MAGIC, &header, &record(op::CHANNEL, &channel), &chunk.repeat(12)].concat();
    let size = file.len();
    fs::write(&bag, file).unwrap();
    let (peak, code) = peak_kib_and_code(laser_profiler(&["info", "--verify"]).arg(&bag));
    eprintln!("14 million messages in {size} bytes: {peak} KiB");
    assert_eq!(code, Some(3), "the file was not finished");
    assert!(peak < ENOUGH_KIB, "{peak} KiB");
    let ended = end(laser_profiler(&["info", "--verify"]).arg(&bag));
    assert!(ended.stdout.contains("holds more than 1048576 messages"), "{:?}", ended.code);
}
