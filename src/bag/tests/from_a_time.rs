//! Reading from a start time, as after a seek in a viewer.

use std::fs;

use super::*;

/// Messages from a start time on, read with and without the index.
fn read_from(path: &Path, from_ns: i64) -> Vec<(String, Times, Vec<u8>)> {
    let [by_index, by_scan] = [true, false].map(|use_index| {
        let options = ReadOptions { use_index, ..ReadOptions::default() };
        let bag = BagReader::open(path, &options).unwrap();
        assert_eq!(bag.time_range_ns(), Some(1_000..=2_100));
        let filter = Filter::topics(["/image_raw", "/profile"]).from(from_ns);
        let messages: Vec<_> = bag.messages(&filter).map(|message| message.unwrap()).collect();
        essence(&messages)
    });
    assert_eq!(by_index, by_scan);
    by_index
}

#[test]
fn earlier_messages_are_skipped() {
    let directory = tempfile::tempdir().unwrap();
    for compression in COMPRESSIONS {
        let output = directory.path().join(format!("{compression:?}"));
        record(&output, compression, &small_entries(), 3);
        for from_ns in [i64::MIN, 0, 1_000, 1_001, 1_500, 2_100, 2_101, i64::MAX] {
            let mut later = expected(&small_entries());
            later.retain(|(_, times, _)| times.log_ns >= from_ns);
            assert_eq!(read_from(&output, from_ns), later, "{compression:?} {from_ns}");
        }
    }
}

#[test]
fn chunks_that_end_before_are_not_opened() {
    let directory = tempfile::tempdir().unwrap();
    let output = directory.path().join("bag");
    let entries = [entry(0, 10, &[1; 300]), entry(0, 20, b"x")];
    let file = record(&output, Compression::None, &entries, 1).file;
    let mut bytes = fs::read(&file).unwrap();
    let payload = bytes.windows(300).position(|window| window == [1; 300]).unwrap();
    bytes[payload] = 2;
    fs::write(&file, bytes).unwrap();
    let bag = BagReader::open(&output, &ReadOptions::default()).unwrap();
    let is_intact = |from_ns| bag.messages(&Filter::all().from(from_ns)).all(|item| item.is_ok());
    assert!(is_intact(11) && !is_intact(10));
}
