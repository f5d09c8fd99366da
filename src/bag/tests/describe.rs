//! `info`: the index gives the same report as reading the messages.

use super::*;
use crate::bag::info::{BagInfo, Depth, describe};
use crate::cli::Outcome;
use crate::cli::info::{InfoArgs, run};

fn info(path: &Path, depth: Depth) -> BagInfo {
    describe(path, &BagReader::open(path, &ReadOptions::default()).unwrap(), depth).unwrap()
}

fn print(args: &InfoArgs) -> (String, Outcome) {
    let mut out = Vec::new();
    let outcome = run(args, &mut out).unwrap();
    (String::from_utf8(out).unwrap(), outcome)
}

#[test]
fn the_index_and_the_messages_give_the_same_report() {
    let directory = tempfile::tempdir().unwrap();
    let output = directory.path().join("bag");
    record(&output, Compression::Lz4, &small_entries(), 3);
    let [by_index, by_reading] = [Depth::Index, Depth::Messages].map(|depth| info(&output, depth));
    assert!(!by_index.verified && by_reading.verified);
    for info in [&by_index, &by_reading] {
        assert_eq!((info.messages, info.start_ns, info.end_ns), (12, Some(1_000), Some(2_100)));
        let image = &info.topics[0];
        assert_eq!((image.name.as_str(), image.messages), ("/image_raw", 6));
        assert_eq!(image.rate_hz, Some(5e6));
        assert_eq!(image.largest_gap_s, Some(200e-9));
        assert_eq!((info.topics[2].messages, info.topics[2].rate_hz), (0, None));
        assert_eq!(info.metadata["laser_profiler"]["version"], "0.1.0");
        // From `printf 'beta: 0.5' | sha256sum`.
        assert_eq!(
            info.attachments[0].sha256,
            "e77af9fb695f8697ab2ad6a2fc855a86a1f14e39f36b3223df9bc94a58feb436"
        );
    }
    assert_eq!((by_index.topics[0].bytes, by_index.topics[0].skipped), (None, None));
    // The sequence number is the time: 199 numbers are skipped five times.
    assert_eq!((by_reading.topics[0].bytes, by_reading.topics[0].skipped), (Some(240), Some(995)));
}

#[test]
fn a_truncated_file_is_described_and_counts_as_loss() {
    let directory = tempfile::tempdir().unwrap();
    let bytes = small_file(Compression::Zstd);
    let path = bare(directory.path(), &bytes[..bytes.len() / 2]);
    let (text, outcome) = print(&InfoArgs { bag: path.clone(), json: false, verify: false });
    assert_eq!(outcome, Outcome::DataLost);
    assert!(text.contains("Damaged") && text.contains("the whole file was read"), "{text}");
    let (json, _) = print(&InfoArgs { bag: path, json: true, verify: false });
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["verified"], true);
    assert_eq!(json["damaged"].as_array().unwrap().len(), 1);
}

#[test]
fn columns_are_aligned_and_the_report_is_complete() {
    let directory = tempfile::tempdir().unwrap();
    let output = directory.path().join("bag");
    record(&output, Compression::None, &small_entries(), 3);
    let (text, outcome) = print(&InfoArgs { bag: output, json: false, verify: false });
    assert_eq!(outcome, Outcome::Done);
    let ends: Vec<_> = ["Messages", "/image_raw", "/profile", "/silent"]
        .map(|word| {
            let line = text
                .lines()
                .filter(|line| !line.starts_with("Messages "))
                .find(|line| line.contains(word))
                .unwrap();
            line.find("std_msgs").or(line.find("Type")).unwrap()
        })
        .into();
    assert!(ends.iter().all(|end| *end == ends[0]), "{text}");
    for word in
        ["1970-01-01 00:00:00 UTC", "calibration.yaml", "laser_profiler", "    b: 2", "none"]
    {
        assert!(text.contains(word), "{word} is not in\n{text}");
    }
}

#[test]
fn a_closed_pipe_is_no_error() {
    struct Closed;
    impl std::io::Write for Closed {
        fn write(&mut self, _: &[u8]) -> std::io::Result<usize> {
            Err(std::io::ErrorKind::BrokenPipe.into())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Err(std::io::ErrorKind::BrokenPipe.into())
        }
    }
    let directory = tempfile::tempdir().unwrap();
    let output = directory.path().join("bag");
    record(&output, Compression::None, &small_entries(), 3);
    for json in [false, true] {
        let args = InfoArgs { bag: output.clone(), json, verify: false };
        assert_eq!(run(&args, &mut Closed).unwrap(), Outcome::Done);
    }
}
