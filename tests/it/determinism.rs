//! The same recording gives the same bytes under any thread schedule.

use std::path::Path;

use crate::{
    program::{content, end, laser_profiler, limited},
    recordings::{bundled, real},
};

/// Replays under every schedule and compares all files, byte by byte.
fn always_the_same(input: &Path, arguments: &[&str]) {
    let directory = tempfile::tempdir().unwrap();
    let mut expected = None;
    // One core and several, few threads and many, alone and against a competitor for the same cores.
    for (turn, threads) in ["", "1", "2", "16"].iter().enumerate() {
        for cores in ["true", "taskset -pc 0 $$ >/dev/null"] {
            let output = directory.path().join(format!("{turn}{}", cores.len())).join("results");
            let mut command = limited(cores, &["replay", "-o"]);
            command.arg(&output).arg(input).args(arguments);
            if !threads.is_empty() {
                command.env("TOKIO_WORKER_THREADS", threads).env("RAYON_NUM_THREADS", threads);
            }
            let ended = end(&mut command);
            assert!(matches!(ended.code, Some(0 | 3)), "{ended:?}");
            let files = content(&output);
            assert!(files.iter().any(|(_, bytes)| bytes.len() > 10_000), "there are results");
            let expected = expected.get_or_insert_with(|| files.clone());
            for ((name, bytes), (_, first)) in files.iter().zip(expected.iter()) {
                assert!(bytes == first, "{}: {name} differs", input.display());
            }
            assert_eq!(files.len(), expected.len());
        }
    }
}

#[test]
fn bundled_recordings() {
    for name in ["film_defects", "saturated_vertical"] {
        let parameters = format!("bags/{name}.params.yaml");
        always_the_same(&bundled(name), &["--params-file", &parameters]);
    }
}

#[test]
fn a_real_recording() {
    if let Some(path) = real("turntable_empty") {
        always_the_same(&path, &["--ros-args", "-p", "stripe_direction:=vertical"]);
    }
}

/// Results do not contain the paths of the recording and of the output.
#[test]
fn directories_leave_no_trace() {
    let directory = tempfile::tempdir().unwrap();
    let moved = directory.path().join("elsewhere").join("film_defects");
    std::fs::create_dir_all(&moved).unwrap();
    for (name, bytes) in content(&bundled("film_defects")) {
        std::fs::write(moved.join(name), bytes).unwrap();
    }
    let replayed = |input: &Path, place: &str| {
        let output = directory.path().join(place).join("results");
        let ended = end(laser_profiler(&["replay", "-o"]).arg(&output).arg(input));
        assert_eq!(ended.code, Some(3), "{ended:?}");
        content(&output)
    };
    assert!(replayed(&bundled("film_defects"), "a") == replayed(&moved, "b"));
}
