//! The fast path for uncompressed chunks gives the same messages as the general decoder.

use proptest::prelude::*;

use super::*;

/// Sizes around the thresholds of the fast path: a block, a piece, several pieces.
const SIZES: [usize; 12] =
    [0, 1, 40, 16_353, 16_384, 16_385, 32_700, 32_768, 32_769, 131_072, 147_457, 300_000];

/// Bytes that differ between seeds.
fn content(size: usize, seed: usize) -> Vec<u8> {
    let mut state = seed as u32 + 1;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    (0..size).map(|_| next()).collect()
}

fn entries(sizes: &[usize]) -> Vec<Entry> {
    let entry = |(number, &size)| entry(number % 2, 1_000 + number as i64, &content(size, number));
    sizes.iter().enumerate().map(entry).collect()
}

/// Reads all messages and recycles buffers of other sizes.
fn read_recycling(path: &Path, filter: &Filter) -> Vec<RawMessage> {
    let bag = BagReader::open(path, &ReadOptions::default()).unwrap();
    let (mut messages, mut stream) = (Vec::new(), bag.messages(filter));
    while let Some(message) = stream.next() {
        let message = message.unwrap();
        stream.recycle(vec![0xee; message.data.len() / 2 + 10]);
        messages.push(message);
    }
    messages
}

#[test]
fn messages_of_every_size_are_read_back() {
    let entries = entries(&[SIZES, SIZES].concat());
    for per_chunk in [1, 3, 24] {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("bag");
        record(&path, Compression::None, &entries, per_chunk);
        let messages = read_recycling(&path, &Filter::all());
        assert!(essence(&messages) == expected(&entries), "{per_chunk} messages a chunk");
        let messages = read_recycling(&path, &Filter::topics(["/profile"]));
        let mut wanted = expected(&entries);
        wanted.retain(|(topic, ..)| topic == "/profile");
        assert!(essence(&messages) == wanted, "{per_chunk} messages a chunk, filtered");
    }
}

#[test]
fn a_flipped_bit_in_a_chunk_loses_only_that_chunk() {
    let entries = entries(&[300_000, 40, 20_000, 40, 40, 150_000]);
    let directory = tempfile::tempdir().unwrap();
    let file = record(&directory.path().join("bag"), Compression::None, &entries, 2).file;
    let bytes = fs::read(file).unwrap();
    let starts: Vec<_> = entries
        .iter()
        .map(|(_, _, data)| bytes.windows(data.len()).position(|at| at == data).unwrap())
        .collect();
    for (number, (_, _, data)) in entries.iter().enumerate() {
        for at in [0, data.len() / 2, data.len() - 1] {
            let mut damaged = bytes.clone();
            damaged[starts[number] + at] ^= 0x10;
            let path = bare(directory.path(), &damaged);
            let (messages, errors) = read_all(&path, &ReadOptions::default()).unwrap();
            assert_eq!(errors.len(), 1, "{errors:?}");
            let mut left = expected(&entries);
            // The first message shares its chunk with the topics, the second has its own, the others come in pairs.
            let first = if number < 2 { number } else { number / 2 * 2 };
            left.drain(first..first + if number < 2 { 1 } else { 2 });
            assert!(essence(&messages) == left, "message {number}, byte {at}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn the_fast_path_equals_the_general_decoder(
        sizes in prop::collection::vec(0_usize..70_000, 1..20),
        per_chunk in 1_usize..8,
    ) {
        let directory = tempfile::tempdir().unwrap();
        let entries = entries(&sizes);
        let [plain, packed] = [Compression::None, Compression::Lz4].map(|compression| {
            let path = directory.path().join(format!("{compression:?}"));
            record(&path, compression, &entries, per_chunk);
            essence(&read_recycling(&path, &Filter::all()))
        });
        prop_assert!(plain == packed && plain == expected(&entries));
    }
}
