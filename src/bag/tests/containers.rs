//! Bags of several files, some of them missing, empty, cut off, renamed or compressed; messages compressed one by one.

use std::collections::BTreeMap;
use std::io::Cursor;

use mcap::WriteOptions;
use mcap::records::{MessageHeader, Metadata};

use super::*;
use crate::bag::info::{Depth, describe};
use crate::bag::recover::{RecoverOptions, recover};
use crate::msg::{builtin_interfaces::Time, cdr, sensor_msgs::CompressedImage};

/// A message in comparable form.
type Essence = (String, Times, Vec<u8>);
type Fault = fn(&Path);
type Edit = fn(Vec<u8>) -> Vec<u8>;

const NUM_FILES: usize = 3;
const PER_FILE: usize = 12;

fn entries_of(file: usize) -> Vec<Entry> {
    let shift = |(topic, times, data): Entry| {
        let by = 10_000 * file as i64;
        let (log_ns, publish_ns) = (times.log_ns + by, times.publish_ns + by);
        (topic, Times { log_ns, publish_ns, ..times }, data)
    };
    small_entries().into_iter().map(shift).collect()
}

fn expected_of(files: &[usize]) -> Vec<Essence> {
    files.iter().flat_map(|file| expected(&entries_of(*file))).collect()
}

/// A bag of three files, `bag_0.mcap` to `bag_2.mcap`.
fn split_bag(directory: &Path) -> PathBuf {
    let bag = directory.join("bag");
    fs::create_dir(&bag).unwrap();
    for file in 0..NUM_FILES {
        let part = directory.join("part");
        let written = record(&part, Compression::None, &entries_of(file), 2);
        fs::rename(&written.file, bag.join(format!("bag_{file}.mcap"))).unwrap();
        fs::remove_dir_all(&part).unwrap();
    }
    list(&bag, "[bag_0.mcap, bag_1.mcap, bag_2.mcap]", "''");
    bag
}

fn list(bag: &Path, files: &str, mode: &str) {
    let count = NUM_FILES * PER_FILE;
    let text = format!(
        "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: mcap\n  message_count: {count}\n  compression_mode: {mode}\n  \
         relative_file_paths: {files}\n"
    );
    fs::write(bag.join("metadata.yaml"), text).unwrap();
}

fn read(bag: &Path) -> (Vec<Essence>, Vec<BagError>) {
    let (messages, errors) = read_all(bag, &ReadOptions::default()).unwrap();
    (essence(&messages), errors)
}

fn pack(path: &Path) -> Vec<u8> {
    let packed = zstd::encode_all(&fs::read(path).unwrap()[..], 1).unwrap();
    fs::write(path.with_extension("mcap.zstd"), &packed).unwrap();
    fs::remove_file(path).unwrap();
    packed
}

#[test]
fn a_missing_or_empty_or_foreign_file_costs_itself_only() {
    let faults: [(&str, Fault); 4] = [
        ("missing", |path| fs::remove_file(path).unwrap()),
        ("empty", |path| fs::write(path, b"").unwrap()),
        ("shorter", |path| fs::write(path, b"\x89MCA").unwrap()),
        ("first eight bytes", |path| fs::write(path, [0; 4096]).unwrap()),
    ];
    for (why, fault) in faults {
        for hit in 0..NUM_FILES {
            let directory = tempfile::tempdir().unwrap();
            let bag = split_bag(directory.path());
            let file = format!("bag_{hit}.mcap");
            fault(&bag.join(&file));
            let others: Vec<_> = (0..NUM_FILES).filter(|file| *file != hit).collect();
            let (messages, errors) = read(&bag);
            assert_eq!(messages, expected_of(&others), "{file} {why}");
            let [error] = &errors[..] else { panic!("{errors:?}") };
            assert!(error.is_loss() && error.to_string().contains(&file), "{error}");
            assert!(error.to_string().contains(why), "{error}");

            let reader = BagReader::open(&bag, &ReadOptions::default()).unwrap();
            let info = describe(&bag, &reader, Depth::Index).unwrap();
            assert_eq!(info.messages as usize, 2 * PER_FILE);
            assert!(info.damaged[0].file.ends_with(&file), "{:?}", info.damaged);
            let states = "states 36 messages, the files hold 24";
            assert!(info.notes.iter().any(|note| note.contains(states)), "{:?}", info.notes);

            let output = directory.path().join("whole");
            let recovery = recover(&bag, &output, RecoverOptions::default()).unwrap();
            assert!(recovery.damaged[0].file.ends_with(&file), "{:?}", recovery.damaged);
            assert_eq!(read(&output).0, expected_of(&others));
        }
    }
}

#[test]
fn a_truncated_file_keeps_its_complete_messages() {
    for hit in 0..NUM_FILES {
        let directory = tempfile::tempdir().unwrap();
        let bag = split_bag(directory.path());
        let path = bag.join(format!("bag_{hit}.mcap"));
        let whole = fs::read(&path).unwrap();
        let chunks = damage::outer_records(&whole, mcap::records::op::CHUNK);
        fs::write(&path, &whole[..chunks[3] + 70]).unwrap();
        let (messages, errors) = read(&bag);
        assert_eq!(errors.len(), 1, "{errors:?}");
        let (first, last) = (hit * PER_FILE, (hit + 1) * PER_FILE);
        let all = expected_of(&[0, 1, 2]);
        let num_kept = messages.len() - (all.len() - PER_FILE);
        assert!((1..PER_FILE).contains(&num_kept), "{num_kept}");
        assert_eq!(messages, [&all[..first + num_kept], &all[last..]].concat());
    }
}

#[test]
fn renamed_files_are_read_in_order_of_time_and_nothing_is_lost() {
    let directory = tempfile::tempdir().unwrap();
    let bag = split_bag(directory.path());
    for (from, to) in [("bag_0", "z"), ("bag_1", "a"), ("bag_2", "m")] {
        let path = |name: &str| bag.join(name.to_owned() + ".mcap");
        fs::rename(path(from), path(to)).unwrap();
        let (messages, errors) = read(&bag);
        assert!(errors.is_empty(), "{from}: {errors:?}");
        assert_eq!(messages, expected_of(&[0, 1, 2]), "{from}");
        let reader = BagReader::open(&bag, &ReadOptions::default()).unwrap();
        let notes = reader.notes().join("\n");
        assert!(notes.contains(from) && notes.contains(&format!("{to}.mcap")), "{notes}");
    }
    fs::remove_file(bag.join("metadata.yaml")).unwrap();
    assert_eq!(read(&bag).0, expected_of(&[0, 1, 2]));
}

#[test]
fn compressed_files_are_read_like_their_content() {
    for packed in [vec![0, 1, 2], vec![1], vec![0, 2]] {
        let directory = tempfile::tempdir().unwrap();
        let bag = split_bag(directory.path());
        let mut names: Vec<_> = (0..NUM_FILES).map(|file| format!("bag_{file}.mcap")).collect();
        for &file in &packed {
            pack(&bag.join(&names[file]));
            names[file] += ".zstd";
        }
        let lists = [
            Some(format!("[{}]", names.join(", "))),
            Some("[bag_0.mcap, bag_1.mcap, bag_2.mcap]".into()),
            None,
        ];
        for files in lists {
            match &files {
                Some(files) => list(&bag, files, "FILE"),
                None => fs::remove_file(bag.join("metadata.yaml")).unwrap(),
            }
            let (messages, errors) = read(&bag);
            assert!(errors.is_empty(), "{files:?} {errors:?}");
            assert_eq!(messages, expected_of(&[0, 1, 2]), "{files:?}");
            let reader = BagReader::open(&bag, &ReadOptions::default()).unwrap();
            assert!(reader.is_indexed(), "the index of a compressed file is used");
            assert_eq!(reader.attachments().count(), NUM_FILES);
            let info = describe(&bag, &reader, Depth::Index).unwrap();
            assert!(info.files[packed[0]].compression.contains(&"zstd file".to_owned()));
        }
        let output = directory.path().join("whole");
        assert!(recover(&bag, &output, RecoverOptions::default()).unwrap().damaged.is_empty());
        assert_eq!(read(&output).0, expected_of(&[0, 1, 2]));
    }
}

#[test]
fn a_truncated_compressed_file_keeps_what_can_be_decompressed() {
    let directory = tempfile::tempdir().unwrap();
    let bag = directory.path().join("bag");
    // Contents that do not compress, so that half of the file is half of the messages.
    let mut state = 1_u64;
    let mut noise = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (state >> 56) as u8
    };
    let entries: Vec<_> = (0..20)
        .map(|number| {
            let data: Vec<_> = std::iter::repeat_with(&mut noise).take(100_000).collect();
            entry(0, 1000 * (number + 1), &data)
        })
        .collect();
    let path = record(&bag, Compression::None, &entries, 1).file;
    let packed = pack(&path);
    let packed_path = path.with_extension("mcap.zstd");
    for (share, least) in [(1, 4), (2, 9), (3, 14)] {
        fs::write(&packed_path, &packed[..packed.len() * share / 4]).unwrap();
        let (messages, errors) = read(&bag);
        assert!((least..=5 * share).contains(&messages.len()), "{share}: {}", messages.len());
        assert_eq!(messages, expected(&entries)[..messages.len()]);
        assert!(errors.iter().any(BagError::is_loss), "{errors:?}");
        let reader = BagReader::open(&bag, &ReadOptions::default()).unwrap();
        let notes = reader.notes().join("\n");
        assert!(notes.contains("ends early"), "{notes}");
    }
}

/// A file with these messages on a topic of that type and encoding. `mode` is what its own description states.
fn of_messages([type_name, encoding]: [&str; 2], mode: &str, messages: &[Vec<u8>]) -> Vec<u8> {
    let options = WriteOptions::new().profile("ros2").compression(None);
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    let schema = writer.add_schema(type_name, "", b"").unwrap();
    let channel_id = writer.add_channel(schema, "/a", encoding, &BTreeMap::new()).unwrap();
    for (number, message) in messages.iter().enumerate() {
        let time = number as u64 * 10;
        let header = MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, message).unwrap();
    }
    let description = format!(
        "version: 9\nstorage_identifier: mcap\ncompression_format: zstd\ncompression_mode: {mode}\nrelative_file_paths: []\n"
    );
    let metadata = [("serialized_metadata".to_owned(), description)].into();
    writer.write_metadata(&Metadata { name: "rosbag2".into(), metadata }).unwrap();
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

fn zstd(message: &[u8]) -> Vec<u8> {
    zstd::encode_all(message, 1).unwrap()
}

/// A file with messages compressed one by one, whose content `edit` changes.
fn packed_messages(mode: &str, edit: impl Fn(usize, Vec<u8>) -> Vec<u8>) -> Vec<u8> {
    let packed: Vec<_> = (0..10).map(|number| edit(number, zstd(&plain(number)))).collect();
    of_messages(["std_msgs/msg/String", "cdr"], mode, &packed)
}

/// The CDR of message `number`.
fn plain(number: usize) -> Vec<u8> {
    [&[0, 1, 0, 0][..], &[number as u8; 500]].concat()
}

#[test]
fn messages_compressed_one_by_one_are_read_and_recovered() {
    let directory = tempfile::tempdir().unwrap();
    for mode in ["MESSAGE", "message", "''"] {
        let path = bare(directory.path(), &packed_messages(mode, |_, packed| packed));
        let (messages, errors) = read(&path);
        assert!(errors.is_empty(), "{errors:?}");
        let data: Vec<_> = messages.into_iter().map(|(_, _, data)| data).collect();
        assert_eq!(data, (0..10).map(plain).collect::<Vec<_>>(), "{mode}");

        let output = directory.path().join("whole");
        let options = RecoverOptions { force: true, compression: None };
        assert!(recover(&path, &output, options).unwrap().damaged.is_empty());
        assert_eq!(read(&output).0.len(), 10);
        let recovered = fs::read(output.join("whole_0.mcap")).unwrap();
        let is_magic = |bytes: &[u8]| bytes == b"MESSAGE";
        assert!(!recovered.windows(7).any(is_magic), "the new file states no compression");
    }
}

/// A compressed image with the stamp 1.000000005 s, the frame `cam`, the format `jpeg` and the file `the file`, by the rules
/// of each encoding; with its type and encoding.
const OF_OTHER_SYSTEMS: [([&str; 2], &[u8]); 3] = [
    (
        ["foxglove_msgs/msg/CompressedImage", "cdr"],
        b"\0\x01\0\0\x01\0\0\0\x05\0\0\0\x04\0\0\0cam\0\x08\0\0\0the file\x05\0\0\0jpeg\0",
    ),
    (
        ["sensor_msgs/CompressedImage", "ros1"],
        b"\x07\0\0\0\x01\0\0\0\x05\0\0\0\x03\0\0\0cam\x04\0\0\0jpeg\x08\0\0\0the file",
    ),
    (
        ["foxglove.CompressedImage", "protobuf"],
        b"\x0a\x04\x08\x01\x10\x05\x12\x08the file\x1a\x04jpeg\x22\x03cam",
    ),
];

#[test]
fn compressed_messages_of_other_systems_are_decompressed_before_they_are_rewritten() {
    let directory = tempfile::tempdir().unwrap();
    for (channel, message) in OF_OTHER_SYSTEMS {
        let cut = zstd(message)[..12].to_vec();
        let bytes = of_messages(channel, "MESSAGE", &[zstd(message), cut, message.to_vec()]);
        let (messages, errors) = read(&bare(directory.path(), &bytes));
        assert_eq!(messages.len(), 2, "{channel:?}: {errors:?}");
        for (_, _, data) in &messages {
            let image: CompressedImage<'_> = cdr::decode(data).unwrap();
            assert_eq!(image.header.stamp, Time { sec: 1, nanosec: 5 }, "{channel:?}");
            assert_eq!((&*image.header.frame_id, &*image.format), ("cam", "jpeg"), "{channel:?}");
            assert_eq!(image.data, b"the file", "{channel:?}");
        }
        let [error] = &errors[..] else { panic!("{channel:?}: {errors:?}") };
        assert!(error.to_string().contains("log time 10 ns cannot be decompressed"), "{error}");
    }
}

#[test]
fn a_damaged_compressed_message_costs_itself_only() {
    let edits: [(&str, Edit); 3] = [
        ("cut off", |packed| packed[..packed.len() - 3].to_vec()),
        ("a flipped block", |mut packed| {
            packed[5..9].fill(0xff);
            packed
        }),
        ("one that expands beyond the limit", |_| {
            zstd::encode_all(&vec![0; 300_000_000][..], 1).unwrap()
        }),
    ];
    let directory = tempfile::tempdir().unwrap();
    for (what, edit) in edits {
        let bytes = packed_messages(
            "MESSAGE",
            |number, packed| {
                if number == 4 { edit(packed) } else { packed }
            },
        );
        let (messages, errors) = read(&bare(directory.path(), &bytes));
        assert_eq!(messages.len(), 9, "{what}: {errors:?}");
        let [error] = &errors[..] else { panic!("{what}: {errors:?}") };
        assert!(error.is_loss() && error.to_string().contains("/a: the message"), "{error}");
    }
}

#[test]
fn other_spellings_of_a_type_are_that_type() {
    let directory = tempfile::tempdir().unwrap();
    for (spelled, profile, encoding, name) in [
        ("sensor_msgs/Image", "ros2", "cdr", "sensor_msgs/msg/Image"),
        ("sensor_msgs::msg::dds_::Image_", "", "cdr", "sensor_msgs/msg/Image"),
        ("sensor_msgs::msg::CameraInfo", "", "cdr", "sensor_msgs/msg/CameraInfo"),
        ("sensor_msgs/Image", "", "json", "sensor_msgs/Image"),
    ] {
        let options = WriteOptions::new().profile(profile);
        let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
        let schema = writer.add_schema(spelled, "omgidl", b"").unwrap();
        writer.add_channel(schema, "/a", encoding, &BTreeMap::new()).unwrap();
        writer.finish().unwrap();
        let path = bare(directory.path(), &writer.into_inner().into_inner());
        let bag = BagReader::open(&path, &ReadOptions::default()).unwrap();
        assert_eq!(bag.topics()[0].type_name, name, "{spelled}");
    }
}
