//! Truncated and corrupted files: intact parts are read, damage is reported, nothing panics.

use std::fs;

use super::*;
use crate::bag::format::{PREFIX_BYTES, u64_at};
use crate::bag::recover::{RecoverOptions, recover};
use mcap::records::op;

/// Offsets of the outer records of one kind.
pub(super) fn outer_records(bytes: &[u8], opcode: u8) -> Vec<usize> {
    let mut found = Vec::new();
    let mut at = mcap::MAGIC.len();
    while at + 9 <= bytes.len() - mcap::MAGIC.len() {
        if bytes[at] == opcode {
            found.push(at);
        }
        at += PREFIX_BYTES as usize + u64_at(bytes, at + 1) as usize;
    }
    found
}

/// Asserts that the messages are a subset of the recorded ones, in the same order. Returns their number.
fn assert_subset(messages: &[RawMessage]) -> usize {
    let mut recorded = expected(&small_entries()).into_iter();
    for message in essence(messages) {
        assert!(
            recorded.any(|candidate| candidate == message),
            "{message:?} was not recorded or is out of order"
        );
    }
    messages.len()
}

#[test]
fn a_file_truncated_anywhere_keeps_its_complete_messages() {
    for compression in COMPRESSIONS {
        let bytes = small_file(compression);
        let chunks = outer_records(&bytes, op::CHUNK);
        let data_end = outer_records(&bytes, op::DATA_END)[0];
        let directory = tempfile::tempdir().unwrap();
        for length in 0..bytes.len() {
            let path = bare(directory.path(), &bytes[..length]);
            let Ok((messages, errors)) = read_all(&path, &ReadOptions::default()) else {
                assert!(length < mcap::MAGIC.len(), "{length} bytes are refused");
                continue;
            };
            let end = |at: &usize| at + 9 + u64_at(&bytes, at + 1) as usize;
            // The first chunk holds the topics and a message, the second one message, every other chunk two.
            let whole = match chunks.iter().filter(|at| end(at) <= length).count() {
                few @ 0..=2 => few,
                many => 2 * (many - 1),
            };
            let read = assert_subset(&messages);
            assert!(
                read == whole || read == whole + 1,
                "{read} messages in {length} bytes, {whole} are complete"
            );
            assert_eq!(errors.is_empty(), length >= data_end + 13, "{length}: {errors:?}");
            assert!(errors.len() <= 1 && errors.iter().all(BagError::is_loss), "{errors:?}");
        }
    }
}

#[test]
fn a_flipped_bit_never_gives_a_message_that_was_not_recorded() {
    for compression in COMPRESSIONS {
        let bytes = small_file(compression);
        let directory = tempfile::tempdir().unwrap();
        let mut state = 0x9e37_79b9_7f4a_7c15_u64;
        for _ in 0..400 {
            // Xorshift: the same flips in every run.
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            let mut mutated = bytes.clone();
            let at = state as usize % bytes.len();
            mutated[at] ^= 1 << (state >> 60 & 7);
            let path = bare(directory.path(), &mutated);
            for use_index in [true, false] {
                let options = ReadOptions { use_index, ..ReadOptions::default() };
                let Ok((messages, errors)) = read_all(&path, &options) else {
                    assert!(at < 8, "a flip at {at} makes the file unreadable");
                    continue;
                };
                // The checksums detect a flip in the index or in a message record's length or times.
                let read = assert_subset(&messages);
                assert!(read >= 10, "a flip at {at} loses {} messages: {errors:?}", 12 - read);
                assert!(
                    read == 12 || errors.iter().any(BagError::is_loss),
                    "a flip at {at} loses messages silently"
                );
            }
        }
    }
}

#[test]
fn a_chunk_with_a_wrong_checksum_is_reported_and_the_rest_is_read() {
    let mut bytes = small_file(Compression::None);
    let chunk = outer_records(&bytes, op::CHUNK)[3];
    let last = chunk + 9 + u64_at(&bytes, chunk + 1) as usize - 1;
    bytes[last] ^= 1;
    let directory = tempfile::tempdir().unwrap();
    let path = bare(directory.path(), &bytes);
    let bag = BagReader::open(&path, &ReadOptions::default()).unwrap();
    let items: Vec<_> = bag.messages(&Filter::all()).collect();
    let is_loss = |item: &Result<_, BagError>| item.as_ref().is_err_and(BagError::is_loss);
    assert_eq!(
        items.iter().map(is_loss).collect::<Vec<_>>().iter().position(|loss| *loss),
        Some(4)
    );
    assert_eq!(items.len(), 11);
    let Err(BagError::Damaged { offset, what, .. }) = &items[4] else { panic!("{:?}", items[4]) };
    assert_eq!(*offset, chunk as u64);
    assert!(what.contains("CRC"), "{what}");
}

#[test]
fn wrong_lengths_allocate_no_memory_and_are_skipped() {
    let bytes = small_file(Compression::Zstd);
    let chunks = outer_records(&bytes, op::CHUNK);
    let directory = tempfile::tempdir().unwrap();
    // Length of the record, of the uncompressed content, of the compression's name, of the compressed content.
    for (field, width) in [(1, 8), (25, 8), (37, 4), (45, 8)] {
        for value in [0_u64, 1, 1 << 30, 1 << 40, u64::MAX - 8, u64::MAX] {
            let mut mutated = bytes.clone();
            mutated[chunks[2] + field..chunks[2] + field + width]
                .copy_from_slice(&value.to_le_bytes()[..width]);
            let path = bare(directory.path(), &mutated);
            for use_index in [true, false] {
                let options = ReadOptions { use_index, ..ReadOptions::default() };
                let (messages, errors) = read_all(&path, &options).unwrap();
                assert_eq!(assert_subset(&messages), 10, "{field} {value}");
                assert!(errors.iter().any(BagError::is_loss), "{field} {value}: {errors:?}");
            }
        }
    }
}

#[test]
fn a_record_longer_than_the_limit_is_damage() {
    let directory = tempfile::tempdir().unwrap();
    let output = directory.path().join("bag");
    let entries = [entry(0, 10, b"a"), entry(0, 20, &[0; 5000]), entry(0, 30, b"b")];
    record(&output, Compression::Lz4, &entries, 1);
    let options = ReadOptions { record_limit_bytes: 4096, ..ReadOptions::default() };
    let (messages, errors) = read_all(&output, &options).unwrap();
    assert_eq!(essence(&messages), [expected(&entries)[0].clone(), expected(&entries)[2].clone()]);
    assert!(errors[0].to_string().contains("the limit of 4096"), "{errors:?}");
}

#[test]
fn a_file_that_is_not_a_recording_is_refused_with_its_name() {
    let directory = tempfile::tempdir().unwrap();
    for (content, why) in
        [(&b""[..], "empty"), (b"abc", "shorter"), (b"a text, not a recording", "first eight")]
    {
        let path = bare(directory.path(), content);
        let error = read_all(&path, &ReadOptions::default()).unwrap_err().to_string();
        assert!(error.contains("bare.mcap: not an MCAP file") && error.contains(why), "{error}");
    }
    let absent = read_all(&directory.path().join("absent"), &ReadOptions::default()).unwrap_err();
    assert!(absent.to_string().contains("absent"));
}

#[test]
fn recovering_skips_the_damage_and_keeps_the_rest() {
    let mut bytes = small_file(Compression::Zstd);
    let chunks = outer_records(&bytes, op::CHUNK);
    // The third chunk's header is overwritten, and the file is truncated.
    bytes[chunks[2]..chunks[2] + 20].fill(0xee);
    bytes.truncate(chunks[6] + 60);
    let directory = tempfile::tempdir().unwrap();
    let (path, output) = (bare(directory.path(), &bytes), directory.path().join("whole"));
    let recovery = recover(&path, &output, RecoverOptions::default()).unwrap();
    let offsets: Vec<_> = recovery.damaged.iter().map(|range| range.offset).collect();
    assert_eq!(offsets, [chunks[2] as u64, chunks[6] as u64]);
    assert_eq!(recovery.damaged[0].end, chunks[3] as u64);
    assert_eq!(
        (recovery.output.messages, recovery.num_attachments, recovery.num_metadata),
        (8, 1, 1)
    );

    let bag = BagReader::open(&output, &ReadOptions::default()).unwrap();
    assert!(bag.is_indexed());
    assert_eq!(bag.topics().len(), 3);
    assert_eq!(bag.attachments().next().unwrap().unwrap(), calibration());
    let (messages, errors) = read_all(&output, &ReadOptions::default()).unwrap();
    assert!(errors.is_empty());
    assert_eq!(assert_subset(&messages), 8);
    assert!(fs::read(&path).unwrap() == bytes, "the input is untouched");
    assert!(
        recover(&output, &output, RecoverOptions { force: true, compression: None }).is_err(),
        "the output would replace the input"
    );
}

#[test]
fn recovering_an_intact_bag_copies_it() {
    let directory = tempfile::tempdir().unwrap();
    let (input, output) = (directory.path().join("bag"), directory.path().join("copy").join("bag"));
    record(&input, Compression::Zstd, &small_entries(), 2);
    assert!(recover(&input, &output, RecoverOptions::default()).unwrap().damaged.is_empty());
    let [original, copy] =
        [&input, &output].map(|bag| read_all(bag, &ReadOptions::default()).unwrap().0);
    assert_eq!(original, copy);
}
