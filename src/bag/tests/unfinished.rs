//! Chunks that their writer never closed.

use super::*;
use crate::bag::recover::{RecoverOptions, recover};

/// The bytes of one uncompressed chunk with its messages, and the offsets of their ends.
fn chunk() -> (Vec<u8>, Vec<usize>) {
    let directory = tempfile::tempdir().unwrap();
    let file = record(&directory.path().join("bag"), Compression::None, &small_entries(), 100).file;
    let bytes = fs::read(file).unwrap();
    let mut at = mcap::MAGIC.len();
    let length = |at: usize| u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
    let mut ends = Vec::new();
    // The first chunk holds the topics and a message, the second one all the others.
    while bytes[at] != mcap::records::op::CHUNK || ends.is_empty() {
        if bytes[at] == mcap::records::op::CHUNK {
            ends.push(at + 9 + length(at));
        }
        at += 9 + length(at);
    }
    let (end, mut record) = (at + 9 + length(at), at + 49);
    while record < end {
        record += 9 + length(record);
        ends.push(record);
    }
    (bytes[..end].to_vec(), ends)
}

/// Offset of the last chunk.
fn last_chunk(ends: &[usize]) -> usize {
    ends[1] - (ends[2] - ends[1]) - 49
}

#[test]
fn a_truncated_chunk_gives_its_complete_messages() {
    let (bytes, ends) = chunk();
    let start = last_chunk(&ends);
    let directory = tempfile::tempdir().unwrap();
    let placeholders = [None, Some(0_u64), Some(u64::MAX)];
    for (placeholder, end) in placeholders.into_iter().flat_map(|it| {
        (start + 50 + 40..=bytes.len())
            .step_by(7)
            .chain(ends[1..].to_vec())
            .map(move |end| (it, end))
    }) {
        let mut cut = bytes[..end].to_vec();
        if let Some(length) = placeholder {
            // Length, uncompressed and compressed size; times and checksum.
            for field in [1, 25, 41] {
                cut[start + field..start + field + 8].copy_from_slice(&length.to_le_bytes());
            }
            cut[start + 9..start + 25].fill(0);
            cut[start + 33..start + 37].fill(length as u8);
        }
        let path = bare(directory.path(), &cut);
        let (messages, errors) = read_all(&path, &ReadOptions::default()).unwrap();
        let num_complete = ends.iter().filter(|at| **at <= end).count();
        let all = expected(&small_entries());
        assert_eq!(essence(&messages), all[..num_complete], "{placeholder:?} {end}: {errors:?}");
        assert_eq!(errors.len(), 1, "{placeholder:?} {end}: {errors:?}");
        assert!(errors[0].is_loss());
    }
    let path = bare(directory.path(), &bytes[..ends[6]]);
    let recovery = recover(&path, &directory.path().join("whole"), RecoverOptions::default());
    let recovery = recovery.unwrap();
    assert_eq!((recovery.output.messages, recovery.damaged.len()), (7, 1));
}

#[test]
fn a_hole_of_zeros_is_damage() {
    let (whole, ends) = chunk();
    let start = last_chunk(&ends);
    let directory = tempfile::tempdir().unwrap();
    for hole in [ends[3]..ends[5], ends[4]..ends[6] + 20, ends[2] + 9..ends[9]] {
        for has_checksum in [true, false] {
            let mut bytes = whole.clone();
            if !has_checksum {
                bytes[start + 33..start + 37].fill(0);
            }
            bytes[hole.clone()].fill(0);
            let path = bare(directory.path(), &bytes);
            let output = directory.path().join("whole");
            let options = RecoverOptions { force: true, compression: None };
            let recovery = recover(&path, &output, options).unwrap();
            let damaged = &recovery.damaged;
            let is_chunk = |offset: u64| offset == start as u64;
            assert!(damaged.iter().any(|range| is_chunk(range.offset)), "{hole:?} {damaged:?}");
        }
    }
}
