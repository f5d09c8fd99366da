//! The command line as scripts rely on it: help, usage errors, machine-readable output, pipes and signals.

use std::{
    io::{BufRead, BufReader, Read},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use laser_profiler::bag::{BagReader, ReadOptions};
use serde_json::Value as Json;

use crate::{
    program::{content, end, laser_profiler, replay},
    recordings::{bundled, centerline_stamps, good_images, record_images, stamp_ns},
};

const VERBS: [&str; 16] = [
    "run",
    "replay",
    "parameters",
    "info",
    "recover",
    "import",
    "simulate",
    "evaluate",
    "calibrate",
    "measure",
    "export",
    "report",
    "compare",
    "suggest",
    "ambient",
    "demo",
];

#[test]
fn every_verb_explains_itself() {
    let all = end(&mut laser_profiler(&["--help"]));
    assert_eq!(all.code, Some(0));
    for verb in VERBS {
        assert!(all.stdout.contains(&format!("\n  {verb} ")), "{verb} in {}", all.stdout);
        let help = end(&mut laser_profiler(&[verb, "--help"]));
        assert_eq!(help.code, Some(0), "{help:?}");
        let example = format!("laser_profiler {verb}");
        assert!(help.stdout.contains("Example"), "{verb}: no example in {}", help.stdout);
        let examples = help.stdout.split("Example").nth(1).unwrap();
        assert!(examples.contains(&example), "{verb}: {examples}");
    }
    // No verb that the list above does not know.
    let listed = all.stdout.split("Commands:").nth(1).unwrap().split("\n\n").next().unwrap();
    let names = listed.lines().filter_map(|line| line.strip_prefix("  ")?.split(' ').next());
    let names: Vec<_> = names.filter(|name| !name.is_empty() && *name != "help").collect();
    assert!(names.iter().all(|name| VERBS.contains(name)), "{names:?}");
}

#[cfg(not(feature = "calibrate"))]
#[test]
fn a_missing_transport_names_the_feature_to_build_with() {
    let board = ["--target", "checkerboard:8x6:0.040"];
    for (what, rest) in [
        ("camera", &board[..]),
        ("plane", &[&board[..], &["--camera", "camera.yaml"]].concat()),
        ("axis", &["--calibration", "rig.yaml", "--markers", "aruco:4x4_50"]),
    ] {
        let mut command = laser_profiler(&["calibrate", what, "bag", "-o", "out.yaml"]);
        let ended = end(command.args(rest));
        assert_eq!(ended.code, Some(1), "{ended:?}");
        assert!(ended.stderr.contains("--features calibrate"), "{ended:?}");
    }
}

#[test]
fn wrong_usage_is_exit_code_2_with_a_reason() {
    let input = bundled("film_defects").display().to_string();
    let with = |rest: &[&'static str]| {
        let mut arguments = vec!["replay", &input, "-o", "/nowhere/out"];
        arguments.extend(rest);
        end(&mut laser_profiler(&arguments))
    };
    for (arguments, reported) in [
        (&["--bogus"] as &[_], &["--bogus"] as &[_]),
        (&["--rate", "0"], &["rate"]),
        (&["--ros-args", "--bogus"], &["--bogus"]),
        (&["--ros-args", "-p", "extraction.blur:=3"], &["extraction.blur"]),
        (&["--ros-args", "-p", "slice.profiles:=0"], &["slice.profiles", "0"]),
        (
            &["--ros-args", "-p", "extraction.blur_radius:=wide"],
            &["extraction.blur_radius", "wide"],
        ),
        (&["--ros-args", "-p", "channel:=infrared"], &["channel", "infrared", "green"]),
        (&["--params-file", "/nowhere/params.yaml"], &["/nowhere/params.yaml"]),
    ] {
        let ended = with(arguments);
        assert_eq!(ended.code, Some(2), "{arguments:?}: {ended:?}");
        for text in reported {
            assert!(ended.stderr.contains(text), "{text}: {ended:?}");
        }
    }
    for arguments in [&[] as &[&str], &["bogus"], &["replay"], &["info"], &["recover", &input]] {
        let ended = end(&mut laser_profiler(arguments));
        assert_eq!(ended.code, Some(2), "{arguments:?}: {ended:?}");
        assert!(ended.stderr.contains("Usage"), "{ended:?}");
    }
}

#[test]
fn the_summary_has_the_published_keys() {
    let output = tempfile::tempdir().unwrap();
    let output = output.path().join("out");
    let parameters = ["--params-file", "bags/film_defects.params.yaml"];
    let (summary, _) = replay(&bundled("film_defects"), &output, 3, &parameters);
    let keys = |json: &Json| json.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
    let expected = [
        "frames",
        "frames_per_second",
        "output",
        "outside_calibrated_volume",
        "points",
        "points_saturated",
        "seconds",
        "sigma_px",
        "slices",
        "stages_ms",
        "without_stripe",
    ];
    assert_eq!(keys(&summary), expected);
    assert_eq!(
        summary["frames"],
        serde_json::json!({"received": 147, "processed": 147, "rejected": 0, "dropped": 0, "lost": 3})
    );
    assert_eq!(keys(&summary["stages_ms"]), ["decode", "encode", "extract", "triangulate"]);
    for times in summary["stages_ms"].as_object().unwrap().values() {
        assert!(times["p50"].as_f64().unwrap() <= times["p99"].as_f64().unwrap(), "{summary}");
    }
    assert_eq!(summary["slices"], 3, "147 profiles in slices of 50");
    assert_eq!(summary["output"], output.display().to_string());
}

#[test]
fn printed_parameters_are_a_parameter_file() {
    let directory = tempfile::tempdir().unwrap();
    let [input, plain, loaded] = ["in", "plain", "loaded"].map(|name| directory.path().join(name));
    record_images(&input, &good_images(3));
    let file = directory.path().join("params.yaml");
    std::fs::write(&file, end(&mut laser_profiler(&["parameters"])).stdout).unwrap();
    replay(&input, &plain.join("out"), 0, &[]);
    replay(&input, &loaded.join("out"), 0, &["--params-file", &file.display().to_string()]);
    assert_eq!(content(&plain.join("out")), content(&loaded.join("out")), "they are the defaults");
}

#[test]
fn a_reader_that_leaves_early_is_no_failure() {
    for verb in ["parameters", "--help", "info bags/film_defects", "evaluate paper"] {
        let pipe = format!("\"$0\" {verb} | head -c 1 >/dev/null; exit ${{PIPESTATUS[0]}}");
        let mut command = Command::new("bash");
        command.args(["-c", &pipe, env!("CARGO_BIN_EXE_laser_profiler")]);
        let ended = end(command.current_dir(env!("CARGO_MANIFEST_DIR")));
        assert_eq!(ended.code, Some(0), "{verb}: {ended:?}");
        assert_eq!(ended.stderr, "", "{verb}");
    }
}

#[test]
fn results_that_cannot_be_printed_are_a_failure() {
    let mut command = Command::new("bash");
    command.args(["-c", "\"$0\" parameters >/dev/full", env!("CARGO_BIN_EXE_laser_profiler")]);
    let ended = end(&mut command);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(ended.stderr.contains("standard output"), "{ended:?}");
}

#[test]
fn a_broken_standard_error_stops_no_replay() {
    let directory = tempfile::tempdir().unwrap();
    let [input, output] = ["in", "out"].map(|name| directory.path().join(name));
    record_images(&input, &good_images(3));
    let mut command = Command::new("bash");
    command.args(["-c", "\"$0\" \"$@\" 2>/dev/full", env!("CARGO_BIN_EXE_laser_profiler")]);
    let ended = end(command.arg("replay").arg(&input).arg("-o").arg(&output).arg("--json"));
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert_eq!(centerline_stamps(&output).len(), 3);
}

/// Waits until `is_so`; a test that waits in vain fails.
fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let started = Instant::now();
    while !is_so() {
        assert!(started.elapsed() < Duration::from_mins(1), "waited in vain until {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn an_interrupted_replay_leaves_a_complete_bag() {
    for signal in ["INT", "TERM"] {
        let directory = tempfile::tempdir().unwrap();
        let [input, output] = ["in", "out"].map(|name| directory.path().join(name));
        record_images(&input, &good_images(1000));
        // 10 ms between frames at a thousandth of the speed: hours, but for the signal.
        let mut command = laser_profiler(&["replay", "--rate", "0.001", "-o"]);
        let mut child = command
            .arg(&output)
            .arg(&input)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut stderr = BufReader::new(child.stderr.take().unwrap());
        let mut line = String::new();
        stderr.read_line(&mut line).unwrap();
        assert!(line.contains("/image_raw"), "{line}");
        wait_until("the bag is begun", || output.join("out_0.mcap").exists());
        let id = child.id().to_string();
        assert!(Command::new("kill").args(["-s", signal, &id]).status().unwrap().success());
        let started = Instant::now();
        let status = child.wait().unwrap();
        assert!(started.elapsed() < Duration::from_secs(5), "it waits for its next frame");
        assert_eq!(status.code(), Some(3), "{signal}");
        stderr.read_to_string(&mut line).unwrap();
        assert!(line.contains("interrupted"), "{line}");

        let bag = BagReader::open(&output, &ReadOptions::default()).unwrap();
        assert!(bag.is_indexed() && bag.notes().is_empty(), "{:?}", bag.notes());
        let stamps = centerline_stamps(&output);
        let expected: Vec<_> = (0..stamps.len()).map(stamp_ns).collect();
        assert_eq!(stamps, expected, "the frames before the signal");
    }
}

#[cfg(not(feature = "foxglove"))]
#[test]
fn a_build_without_the_view_names_the_feature_to_build_with() {
    for arguments in [&["replay", "bag", "--view"] as &[_], &["run", "--view=9000"]] {
        let ended = end(&mut laser_profiler(arguments));
        assert_eq!(ended.code, Some(2), "{ended:?}");
        assert!(ended.stderr.contains("--features foxglove"), "{ended:?}");
    }
}
