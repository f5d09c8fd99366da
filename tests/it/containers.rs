//! Bags as recorders leave them and users move them: split, renamed, compressed, cut off, of other systems. Each is
//! rendered here; third-party software compresses and converts.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use laser_profiler::{
    bag::{BagReader, Compression, Filter, ReadOptions, RecordOptions, Recorder, Times, Topic},
    msg::{
        schema::Message,
        sensor_msgs::{CameraInfo, Image, JointState},
    },
};

use crate::{
    interop::{interop, python},
    program::{Ended, end, laser_profiler, replay},
    recordings::{bundled, centerline_stamps, image, real, stamp_ns, topic},
};

type Change = fn(&Path);

const NUM_FILES: usize = 3;
const PER_FILE: usize = 5;

/// A file with frames `first` to `first + PER_FILE - 1`, each in a chunk of its own.
fn part(path: &Path, first: usize, compression: Compression) {
    let directory = path.with_extension("part");
    let mut recorder =
        Recorder::create(&directory, RecordOptions { compression, force: false }).unwrap();
    let id = recorder.add_topic(&topic("/image_raw", Image::TYPE)).unwrap();
    for number in first..first + PER_FILE {
        let log_ns = stamp_ns(number);
        let times = Times { log_ns, publish_ns: log_ns, sequence: number as u32 };
        recorder.write(id, times, &image(number, |_| {})).unwrap();
        recorder.flush().unwrap();
    }
    recorder.finish().unwrap();
    let name = directory.file_name().unwrap().to_str().unwrap();
    fs::rename(directory.join(format!("{name}_0.mcap")), path).unwrap();
    fs::remove_dir_all(&directory).unwrap();
}

/// A bag of three files, as `ros2 bag record -d` writes it.
fn split_bag(place: &Path) -> PathBuf {
    let bag = place.join("rec");
    fs::create_dir(&bag).unwrap();
    for file in 0..NUM_FILES {
        part(&bag.join(format!("rec_{file}.mcap")), file * PER_FILE, Compression::None);
    }
    describe(&bag, "rec_0.mcap, rec_1.mcap, rec_2.mcap", "mcap");
    bag
}

fn describe(bag: &Path, files: &str, storage: &str) {
    let count = NUM_FILES * PER_FILE;
    let text = format!(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: {storage}\n  message_count: {count}\n  \
         compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths: [{files}]\n"
    );
    fs::write(bag.join("metadata.yaml"), text).unwrap();
}

fn stamps(files: &[usize]) -> Vec<i64> {
    files.iter().flat_map(|file| file * PER_FILE..(file + 1) * PER_FILE).map(stamp_ns).collect()
}

fn run(verb: &str, bag: &Path, more: &[&str]) -> Ended {
    let mut command = laser_profiler(&[verb]);
    end(command.arg(bag).args(more))
}

/// Runs `info`, `recover` and `replay`. Each must end with `code` and name `named`. Returns the stamps measured.
fn measured(bag: &Path, code: i32, named: &str) -> Vec<i64> {
    let place = bag.parent().unwrap();
    let info = run("info", bag, &[]);
    assert_eq!(info.code, Some(code), "{info:?}");
    assert!(info.stdout.contains(named), "{named}: {info:?}");
    let whole = place.join("whole");
    let recovered = run("recover", bag, &["--force", "-o", whole.to_str().unwrap()]);
    assert_eq!(recovered.code, Some(code), "{recovered:?}");
    assert!(recovered.stdout.contains(named), "{named}: {recovered:?}");
    let (summary, stderr) = replay(bag, &place.join("results"), code, &["--force"]);
    assert!(stderr.contains(named), "{named}: {summary} {stderr}");
    let found = centerline_stamps(&place.join("results"));
    // Where frames are missing between others, their sequence numbers still tell.
    let step_ns = stamp_ns(1) - stamp_ns(0);
    let has_gap = found.windows(2).any(|pair| pair[1] - pair[0] != step_ns);
    replay(&whole, &place.join("results"), if has_gap { 3 } else { 0 }, &["--force"]);
    assert_eq!(centerline_stamps(&place.join("results")), found, "the recovered bag has the same");
    found
}

#[test]
fn a_lost_file_costs_itself_only() {
    let faults: [(&str, Change); 3] = [
        ("the file is missing", |path| fs::remove_file(path).unwrap()),
        ("the file is empty", |path| fs::write(path, b"").unwrap()),
        ("not an MCAP file", |path| fs::write(path, "<!DOCTYPE html>".repeat(99)).unwrap()),
    ];
    for (hit, (why, fault)) in faults.into_iter().enumerate() {
        let place = tempfile::tempdir().unwrap();
        let bag = split_bag(place.path());
        fault(&bag.join(format!("rec_{hit}.mcap")));
        let others: Vec<_> = (0..NUM_FILES).filter(|file| *file != hit).collect();
        assert_eq!(measured(&bag, 3, why), stamps(&others), "{why}");
    }
}

#[test]
fn a_killed_recording_is_read_without_its_metadata() {
    // As kill -9 of `ros2 bag record -d` leaves it: no metadata.yaml, the last file empty, the one before cut off.
    let place = tempfile::tempdir().unwrap();
    let bag = split_bag(place.path());
    fs::remove_file(bag.join("metadata.yaml")).unwrap();
    fs::write(bag.join("rec_3.mcap"), b"").unwrap();
    let cut = bag.join("rec_2.mcap");
    let bytes = fs::read(&cut).unwrap();
    fs::write(&cut, &bytes[..bytes.len() - 9000]).unwrap();
    let found = measured(&bag, 3, "rec_3.mcap");
    assert!(found.len() > 2 * PER_FILE, "{found:?}");
    assert_eq!(found, stamps(&[0, 1, 2])[..found.len()]);
}

#[test]
fn renamed_and_moved_files_are_all_there() {
    let all = stamps(&[0, 1, 2]);
    let changes: [(&str, Change); 4] = [
        ("does not list", |bag| {
            for (from, to) in [("rec_0", "monday"), ("rec_1", "b"), ("rec_2", "a")] {
                let path = |name: &str| bag.join(name.to_owned() + ".mcap");
                fs::rename(path(from), path(to)).unwrap();
            }
        }),
        ("beside it is read", |bag| {
            describe(bag, "old/rec_0.mcap, /elsewhere/rec_1.mcap, ../x/rec_2.mcap", "mcap");
        }),
        ("does not list rec_1.mcap, rec_2.mcap; they are read", |bag| {
            describe(bag, "rec_0.mcap", "mcap");
        }),
        ("metadata.yaml is unreadable", |bag| {
            fs::write(bag.join("metadata.yaml"), "rosbag2_bagfile_inf").unwrap();
        }),
    ];
    for (note, change) in changes {
        let place = tempfile::tempdir().unwrap();
        let bag = split_bag(place.path());
        change(&bag);
        assert_eq!(measured(&bag, 0, note), all, "{note}");
    }
}

/// A type under another name, with its messages.
fn spelled(place: &Path, type_name: &str, schema_encoding: &str) -> PathBuf {
    let path = place.join("rec");
    let mut recorder = Recorder::create(&path, RecordOptions::default()).unwrap();
    let other = Topic {
        type_name: type_name.into(),
        schema_encoding: schema_encoding.into(),
        ..topic("/image_raw", Image::TYPE)
    };
    let id = recorder.add_topic(&other).unwrap();
    for number in 0..PER_FILE {
        let log_ns = stamp_ns(number);
        let times = Times { log_ns, publish_ns: log_ns, sequence: 0 };
        recorder.write(id, times, &image(number, |_| {})).unwrap();
    }
    recorder.finish().unwrap();
    path
}

#[test]
fn every_spelling_of_a_type_is_read() {
    for (type_name, schema) in [
        ("sensor_msgs/Image", "ros2msg"),
        ("sensor_msgs::msg::Image", "ros2idl"),
        ("sensor_msgs::msg::dds_::Image_", "omgidl"),
    ] {
        let place = tempfile::tempdir().unwrap();
        let bag = spelled(place.path(), type_name, schema);
        assert_eq!(measured(&bag, 0, ""), stamps(&[0]), "{type_name}");
    }
}

#[test]
fn recordings_of_other_kinds_are_named_with_the_command_that_converts_them() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    fs::create_dir(path("sqlite")).unwrap();
    describe(&path("sqlite"), "a.db3", "sqlite3");
    fs::write(path("sqlite/a.db3"), b"SQLite format 3\0 and its pages").unwrap();
    fs::write(path("renamed.mcap"), b"SQLite format 3\0 and its pages").unwrap();
    fs::write(path("scan.bag"), b"#ROSBAG V2.0\n and its records").unwrap();
    let packed = zstd::encode_all(&b"SQLite format 3\0 and its pages"[..], 1).unwrap();
    fs::write(path("a.db3.zstd"), packed).unwrap();
    fs::write(path("a.mcap.gz"), [0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 3]).unwrap();
    for (name, commands) in [
        ("sqlite", &["rosbags-convert --src", "ros2 bag convert -i", "storage_id: mcap"][..]),
        ("renamed.mcap", &["SQLite", "rosbags-convert --src"]),
        ("scan.bag", &["ROS 1", "rosbags-convert --src", "scan_mcap --dst-storage mcap"]),
        ("a.db3.zstd", &["SQLite", "unzstd"]),
        ("a.mcap.gz", &["gunzip"]),
    ] {
        let output = path("out").display().to_string();
        for arguments in [&["info"][..], &["replay", "-o", &output], &["recover", "-o", &output]] {
            let mut command = laser_profiler(arguments);
            let ended = end(command.arg(path(name)));
            assert_eq!(ended.code, Some(1), "{name}: {ended:?}");
            for text in commands {
                assert!(ended.stderr.contains(text), "{text}: {ended:?}");
            }
        }
        assert!(!path("out").exists());
    }
}

/// Runs one of the programs that pip installs.
fn tool(python: &Path, name: &str, arguments: &[&str]) {
    let mut command = Command::new(python.with_file_name(name));
    let ended = end(command.args(arguments));
    assert_eq!(ended.code, Some(0), "{ended:?}");
}

#[test]
fn bags_that_other_software_compressed_give_the_same_centrelines() {
    let Some(python) = python() else { return };
    let place = tempfile::tempdir().unwrap();
    let bag = bundled("film_defects");
    let arguments = ["--force", "--params-file", "bags/film_defects.params.yaml"];
    let centrelines = |bag: &Path| {
        let output = place.path().join("results");
        replay(bag, &output, 0, &arguments);
        let reader = BagReader::open(&output, &ReadOptions::default()).unwrap();
        let messages = reader.messages(&Filter::topics(["/laser_profiler/centerline"]));
        messages.map(|message| message.unwrap().data).collect::<Vec<_>>()
    };
    let convert = |name: &str, how: &[&str]| {
        let path = place.path().join(name);
        let (source, packed) = (bag.to_str().unwrap(), path.to_str().unwrap());
        let to = ["--src", source, "--dst", packed, "--dst-storage", "mcap"];
        tool(python, "rosbags-convert", &[&to[..], how].concat());
        path
    };
    // The converter keeps no sequence numbers, so its plain copy is what the compressed ones must equal.
    let expected = centrelines(&convert("plain", &[]));
    assert_eq!(expected.len(), 147);
    for mode in ["file", "message", "storage"] {
        let path = convert(mode, &["--compress", "zstd", "--compress-mode", mode]);
        assert!(centrelines(&path) == expected, "{mode}");
        let whole = place.path().join("whole");
        let options = ["--force", "-o", whole.to_str().unwrap()];
        // The file alone, as if everything else was lost.
        fs::remove_file(path.join("metadata.yaml")).unwrap();
        let recovered = run("recover", &path, &options);
        assert_eq!(recovered.code, Some(0), "{mode}: {recovered:?}");
        assert!(centrelines(&whole) == expected, "{mode}, recovered");
        let mut check = Command::new(python);
        check.arg(interop("check_bag.py")).arg(&whole);
        let read = end(check.args(["--expect", "/camera/image_raw=147"]));
        // The converter writes no type hashes, without which the last reader of `check_bag.py` ends.
        for line in ["rosbags, directory       444 messages", "rerun mcap check         accepts it"]
        {
            assert!(read.stdout.contains(line), "{mode}: {read:?}");
        }
    }
}

#[test]
fn the_printed_commands_convert() {
    let Some(python) = python() else { return };
    let place = tempfile::tempdir().unwrap();
    let (source, sqlite) = (bundled("film_defects"), place.path().join("sqlite"));
    let to = ["--src", source.to_str().unwrap(), "--dst", sqlite.to_str().unwrap()];
    tool(python, "rosbags-convert", &[&to[..], &["--dst-storage", "sqlite3"]].concat());
    let ros1 = place.path().join("ros1.bag");
    let to = ["--src", source.to_str().unwrap(), "--dst", ros1.to_str().unwrap()];
    tool(python, "rosbags-convert", &to);
    for (bag, converted) in [(&sqlite, "sqlite_mcap"), (&ros1, "ros1_mcap")] {
        let refused = run("info", bag, &[]);
        assert_eq!(refused.code, Some(1), "{refused:?}");
        let is_command = |line: &&str| line.trim_start().starts_with("rosbags-convert");
        let command = refused.stderr.lines().find(is_command).unwrap();
        let arguments: Vec<_> = command.split_whitespace().skip(1).collect();
        tool(python, "rosbags-convert", &arguments);
        let info = run("info", &place.path().join(converted), &["--json"]);
        let info: serde_json::Value = serde_json::from_str(&info.stdout).unwrap();
        assert_eq!(info["messages"], 444, "{info}");
    }
}

#[test]
fn messages_of_other_systems_are_read() {
    let Some(python) = python() else { return };
    let place = tempfile::tempdir().unwrap();
    let bag = split_bag(place.path());
    let mut script = Command::new(python);
    let made = end(script.arg(interop("other_systems.py")).arg(&bag).arg(place.path()));
    assert_eq!(made.code, Some(0), "{made:?}");
    for name in ["ros1.mcap", "foxglove.mcap"] {
        let path = place.path().join(name);
        assert_eq!(measured(&path, 0, name), stamps(&[0, 1, 2]), "{name}");
    }
    let info = run("info", &place.path().join("ros1.mcap"), &["--json"]);
    for kind in [Image::TYPE, CameraInfo::TYPE, JointState::TYPE] {
        assert!(info.stdout.contains(kind.name), "{info:?}");
    }
}

#[test]
fn all_reported_cases() {
    for (name, code, num_frames) in [
        ("bag_containers/split_missing", 3, 4),
        ("bag_containers/renamed", 0, 4),
        ("bag_containers/file_zstd", 0, 4),
        ("bag_containers/file_zstd_unpacked", 0, 4),
        ("type_names/eprosima.mcap", 0, 4),
        ("type_names/omgidl.mcap", 0, 4),
        ("type_names/two_part.mcap", 0, 4),
    ] {
        let Some(path) = real(&format!("cases/{name}")) else { continue };
        let place = tempfile::tempdir().unwrap();
        let (summary, _) = replay(&path, &place.path().join("results"), code, &[]);
        assert_eq!(summary["frames"]["processed"], num_frames, "{name}: {summary}");
    }
    for name in ["bag_containers/db3", "bag_containers/ros1.bag"] {
        let Some(path) = real(&format!("cases/{name}")) else { continue };
        let ended = run("info", &path, &[]);
        assert!(ended.stderr.contains("rosbags-convert --src"), "{ended:?}");
    }
}
