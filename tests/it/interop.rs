//! Files that the node writes, opened by four third-party readers: see `tests/interop`.

use std::{
    env,
    fmt::Display,
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
};

use laser_profiler::{
    bag::{BagReader, Filter, ReadOptions},
    node::{
        live_recording::{LiveRecorder, RecordedTopics, RecordingParams},
        recording::Description,
        sink::{Outgoing, Sink},
    },
};

use crate::{
    program::{Ended, end, replay, skip},
    recordings::{bundled, real},
};

const NOTHING: &[(&str, u64)] = &[];

/// Python with the pinned readers, installed once and kept for the next run; `None` after reporting the reason if there is none.
pub(crate) fn python() -> Option<&'static Path> {
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    match PYTHON.get_or_init(virtual_environment) {
        Ok(python) => Some(python),
        Err(reason) => {
            skip("interop", reason);
            assert!(env::var_os("CI").is_none(), "CI skips nothing: {reason}");
            None
        }
    }
}

fn virtual_environment() -> Result<PathBuf, String> {
    let requirements = interop("requirements.txt");
    let wanted = fs::read(&requirements).map_err(|error| error.to_string())?;
    let place = Path::new(env!("CARGO_TARGET_TMPDIR")).join("interop-venv");
    let (python, stamp) = (place.join("bin/python"), place.join("requirements.txt"));
    if fs::read(&stamp).is_ok_and(|installed| installed == wanted) {
        return Ok(python);
    }
    let succeed = |command: &mut Command| match command.output() {
        Ok(output) if output.status.success() => Ok(()),
        Ok(output) => Err(format!("{command:?}: {}", String::from_utf8_lossy(&output.stderr))),
        Err(error) => Err(format!("{command:?}: {error}")),
    };
    succeed(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&place))?;
    let mut install = Command::new(&python);
    install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"]);
    succeed(install.arg(&requirements))?;
    fs::write(&stamp, wanted).map_err(|error| error.to_string())?;
    Ok(python)
}

pub(crate) fn interop(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/interop").join(name)
}

/// Runs a check; `expected` are topics with their numbers of messages.
fn check(python: &Path, script: &str, bag: &Path, expected: &[(impl Display, u64)]) -> Ended {
    let mut command = Command::new(python);
    command.arg(interop(script)).arg(bag);
    for (topic, count) in expected {
        command.args(["--expect", &format!("{topic}={count}")]);
    }
    end(&mut command)
}

fn passes(ended: &Ended) {
    assert_eq!(ended.code, Some(0), "{}\n{}", ended.stdout, ended.stderr);
}

/// Replays a recording and has the results opened: one centreline for each of its frames.
fn results_open(input: &Path, num_frames: u64, code: i32, arguments: &[&str]) {
    let Some(python) = python() else { return };
    let directory = tempfile::tempdir().unwrap();
    let output = directory.path().join("results");
    let (summary, _) = replay(input, &output, code, arguments);
    assert_eq!(summary["frames"]["processed"], num_frames, "{summary}");
    let mut expected = vec![("centerline", num_frames), ("annotations", num_frames)];
    let slices = summary["slices"].as_u64().unwrap();
    if slices > 0 {
        expected.extend([("profile", num_frames), ("height_map", 1)]);
        expected.extend(["points", "points_dense", "slice_info"].map(|topic| (topic, slices)));
    }
    let expected: Vec<_> = expected
        .into_iter()
        .map(|(topic, count)| (format!("/laser_profiler/{topic}"), count))
        .collect();
    passes(&check(python, "check_bag.py", &output, &expected));
    passes(&check(python, "check_bag.py", &output.join("results_0.mcap"), &expected));
    passes(&check(python, "check_types.py", &output, NOTHING));
}

#[test]
fn results_of_the_bundled_recordings() {
    for (name, num_frames) in [("film_defects", 147), ("saturated_vertical", 35)] {
        let parameters = format!("bags/{name}.params.yaml");
        // Exit code 3: both lack frames on purpose.
        results_open(&bundled(name), num_frames, 3, &["--params-file", &parameters]);
    }
}

#[test]
fn results_of_real_recordings() {
    let vertical = ["--ros-args", "-p", "stripe_direction:=vertical"];
    for (name, num_frames, arguments) in [
        ("turntable_object", 320, &vertical as &[_]),
        ("turntable_empty", 40, &vertical),
        ("robot_floor", 85, &[]),
    ] {
        if let Some(path) = real(name) {
            results_open(&path, num_frames, 0, arguments);
        }
    }
}

#[test]
fn the_bundled_recordings_themselves() {
    let Some(python) = python() else { return };
    for (name, num_frames) in [("film_defects", 147), ("saturated_vertical", 35)] {
        let expected = [("/camera/image_raw", num_frames), ("/truth/centerline", num_frames)];
        passes(&check(python, "check_bag.py", &bundled(name), &expected));
        passes(&check(python, "check_types.py", &bundled(name), NOTHING));
    }
}

/// Recordings of a live node: several files, with the latched topics repeated in each.
#[test]
fn live_recordings_in_several_files() {
    let Some(python) = python() else { return };
    let directory = tempfile::tempdir().unwrap();
    let results = directory.path().join("results");
    let parameters = ["--params-file", "bags/film_defects.params.yaml"];
    replay(&bundled("film_defects"), &results, 3, &parameters);
    let params = RecordingParams {
        directory: directory.path().join("live"),
        split_bytes: Some(400_000),
        min_free_bytes: 0,
        ..RecordingParams::default()
    };
    let live = record_again(&results, params);
    let files: Vec<_> = fs::read_dir(&live)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "mcap"))
        .collect();
    assert!(files.len() >= 3, "{files:?}");
    let expected = [("/laser_profiler/centerline", 147), ("/laser_profiler/profile", 147)];
    passes(&check(python, "check_bag.py", &live, &expected));
    passes(&check(python, "check_types.py", &live, NOTHING));
    for file in &files {
        passes(&check(python, "check_bag.py", file, NOTHING));
    }
}

/// Sends the messages of a bag through a live recorder; returns its bag.
fn record_again(bag: &Path, params: RecordingParams) -> PathBuf {
    let bag = BagReader::open(bag, &ReadOptions::default()).unwrap();
    let results = bag.topics().iter().map(|topic| (**topic).clone()).enumerate().collect();
    let topics = RecordedTopics { results, images: Vec::new() };
    let (mut recorder, control) = LiveRecorder::new("", topics, params, Description::default());
    let directory = control.start().unwrap().remove(0);
    for message in bag.messages(&Filter::all()).map(Result::unwrap) {
        let topic = bag.topics().iter().position(|topic| *topic == message.topic).unwrap();
        let outgoing = Outgoing {
            topic,
            log_time_ns: message.log_time_ns,
            publish_time_ns: message.publish_time_ns,
            sequence: message.sequence,
            data: message.data.into(),
        };
        recorder.write(&outgoing).unwrap();
    }
    let stopped = control.stop().unwrap().remove(0);
    assert_eq!((stopped.dropped, stopped.last_error), (0, None));
    recorder.finish().unwrap();
    directory
}

/// The check must be able to fail.
#[test]
fn the_check_notices() {
    let Some(python) = python() else { return };
    let directory = tempfile::tempdir().unwrap();
    let good = bundled("film_defects");
    let ended = check(python, "check_bag.py", &good, &[("/camera/image_raw", 148)]);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(ended.stdout.contains("/camera/image_raw has 147 messages, expected 148"), "{ended:?}");

    let mut bytes = fs::read(good.join("film_defects_0.mcap")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    let damaged = directory.path().join("damaged.mcap");
    fs::write(&damaged, bytes).unwrap();
    let ended = check(python, "check_bag.py", &damaged, NOTHING);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(ended.stdout.contains("mcap, mcap-ros2-support: "), "{ended:?}");
}
