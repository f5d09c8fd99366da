//! A scanned flat: its tilt, the repeatability of its height, the calibration's share of its uncertainty, and the
//! part's frame levelled on it. Rendered, and on the disk of a real turntable.

use std::{fs, path::Path};

use serde_json::Value as Json;

use crate::{
    program::{Ended, end, laser_profiler, replay},
    recordings::{bundled, real},
};

/// The turntable's rig by an independent calibration; only the distance of the laser plane is uncertain, by
/// 0.4 mm. The table turns about the normal of its disk.
fn turntable(distance_m: f64) -> String {
    format!(
        "type: camera_and_plane
camera_name: camera
image_width: 640
image_height: 480
camera_matrix: {{rows: 3, cols: 3, data: [627.5, 0.0, 316.1, 0.0, 625.8, 242.3, 0.0, 0.0, 1.0]}}
distortion_model: plumb_bob
distortion_coefficients: {{rows: 1, cols: 5, data: [0.1155, -0.2219, -0.0004, -0.0038, 0.0785]}}
frame_id: laser_plane
laser_plane: {{normal: [0.911, -0.139, 0.387], distance_m: {distance_m:?}}}
plane_quality: {{rms_m: 0.0004, boards_used: 20, covariance: [0, 0, 0, 0, 0, 0, 0, 0, 1.6e-7]}}
axis: {{kind: revolute, point_m: [0.0185, 0.0551, 0.4263], direction: [0.032, -0.928, -0.371]}}
axis_quality: {{positions_used: 40, direction_sigma_rad: 0.0, point_sigma_m: 0.0, scale_sigma: 0.0}}
"
    )
}

fn run(arguments: &[&str]) -> Ended {
    end(&mut laser_profiler(arguments))
}

fn json(arguments: &[&str]) -> Json {
    let ended = run(&[arguments, &["--json"]].concat());
    assert_eq!(ended.code, Some(0), "{ended:?}");
    serde_json::from_str(&ended.stdout).unwrap()
}

/// Scans the empty disk with a calibration; returns the path of the results.
fn disk(recording: &Path, place: &Path, calibration: &Path) -> String {
    let chosen = format!("calibration_file:={}", calibration.display());
    let files = ["launch_configs/bright_ambient.yaml", "launch_configs/turntable.yaml"];
    let params = ["--params-file", files[0], "--params-file", files[1]];
    let results = place.join("results");
    let ros = ["--force", "--ros-args", "-p", &chosen];
    replay(recording, &results, 0, &[&params[..], &ros].concat());
    results.display().to_string()
}

/// Half of the disk's width without its printed rim, and its range of heights, which excludes the wall.
fn plane(results: &str, low_mm: f64) -> Json {
    let heights = format!("--heights={low_mm}mm,{}mm", low_mm + 10.0);
    json(&["measure", "plane", results, "--region=-50mm,-50mm,50mm,50mm", &heights])
}

fn value(answer: &Json, figure: &str) -> f64 {
    answer[figure]["value"].as_f64().unwrap_or_else(|| panic!("{figure} in {answer}"))
}

#[test]
fn the_height_of_an_empty_disk_repeats() {
    let Some(recording) = real("turntable_empty") else { return };
    let place = tempfile::tempdir().unwrap();
    let rig = place.path().join("rig.yaml");
    fs::write(&rig, turntable(0.1667)).unwrap();
    let seen = disk_plane(&disk(&recording, place.path(), &rig));
    eprintln!("{seen:#}");
    assert_eq!(seen["profiles_compared"], 40);
    assert!(value(&seen, "profiles_sigma_m") < 60e-6, "{seen}");
}

/// The plane of the disk in the table's frame.
fn disk_plane(results: &str) -> Json {
    let middle = json(&["measure", "plane", results, "--region=-20mm,-20mm,20mm,20mm"]);
    plane(results, 1e3 * value(&middle, "height_m") - 5.0)
}

/// The stated share equals the difference to a replay with the laser plane one standard deviation farther away.
#[test]
fn the_calibrations_share_matches_a_shifted_calibration() {
    let Some(recording) = real("turntable_empty") else { return };
    let place = tempfile::tempdir().unwrap();
    let rig = place.path().join("rig.yaml");
    let [seen, other] = [0.1667, 0.1667 + 4e-4].map(|distance_m| {
        fs::write(&rig, turntable(distance_m)).unwrap();
        disk_plane(&disk(&recording, place.path(), &rig))
    });
    assert!(seen["calibration_unknown"].is_null(), "{seen}");
    let share = seen["height_m"]["sigma_calibration"].as_f64().unwrap();
    let moved = (value(&other, "height_m") - value(&seen, "height_m")).abs();
    assert!(moved > 1e-4 && (share / moved - 1.0).abs() < 0.1, "{share} m, {moved} m");
}

#[test]
fn a_table_is_levelled_and_stays_level() {
    let Some(recording) = real("turntable_empty") else { return };
    let place = tempfile::tempdir().unwrap();
    let [rig, level] = ["rig.yaml", "level.yaml"].map(|name| place.path().join(name));
    fs::write(&rig, turntable(0.1667)).unwrap();
    let results = disk(&recording, place.path(), &rig);
    let region = "--region=-20mm,-20mm,20mm,20mm";
    let reported = json(&["calibrate", "level", &results, "-o", level.to_str().unwrap(), region]);
    assert!(reported["height_m"].as_f64().unwrap().abs() > 0.01, "{reported}");
    let results = disk(&recording, place.path(), &level);
    let seen = json(&["measure", "plane", &results, region]);
    assert!(value(&seen, "height_m").abs() < 2e-5 && value(&seen, "tilt_rad") < 1e-3, "{seen}");
}

#[test]
fn the_tilt_of_a_rendered_flat_is_measured_and_removed() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name).display().to_string();
    let scenario = "tests/data/metrology/flat.scenario.yaml";
    assert_eq!(run(&["simulate", scenario, "-o", &path("flat")]).code, Some(0));
    let scan = |calibration: &str| {
        let chosen = format!("calibration_file:={calibration}");
        let params = ["--params-file", "tests/data/metrology/replay_scan.yaml", "--force"];
        let ros = ["--ros-args", "-p", &chosen];
        let [flat, results] = ["flat", "results"].map(|name| place.path().join(name));
        replay(&flat, &results, 0, &[&params[..], &ros].concat());
        path("results")
    };
    let results = scan(&format!("{}/calibration.yaml", path("flat")));
    let reported = json(&["calibrate", "level", &results, "-o", &path("level.yaml")]);
    // Slopes of 0.02 along and 0.01 across the stripe.
    let truth = 0.02_f64.hypot(0.01).atan();
    let [tilt, sigma] = ["tilt_rad", "tilt_sigma_rad"].map(|key| reported[key].as_f64().unwrap());
    assert!((tilt - truth).abs() < (4.0 * sigma).max(1e-6), "{reported}");
    let results = scan(&path("level.yaml"));
    let seen = json(&["measure", "plane", &results]);
    assert!(value(&seen, "tilt_rad") < 1e-6 && value(&seen, "height_m").abs() < 1e-8, "{seen}");
    // Once more changes nothing.
    let again = json(&["calibrate", "level", &results, "-o", &path("again.yaml")]);
    let [before, after] =
        [&reported, &again].map(|reported| reported["part"]["origin_m"][2].as_f64().unwrap());
    assert!((before - after).abs() < 1e-8, "{reported} {again}");
    let refused = run(&["calibrate", "level", &results, "-o", &path("level.yaml")]);
    assert!(refused.code == Some(1) && refused.stderr.contains("--force"), "{refused:?}");
}

#[test]
fn unsuitable_scans_cannot_be_levelled() {
    let place = tempfile::tempdir().unwrap();
    let [results, output] = ["results", "level.yaml"].map(|name| place.path().join(name));
    replay(
        &bundled("film_defects"),
        &results,
        3,
        &["--params-file", "bags/film_defects.params.yaml"],
    );
    let arguments =
        ["calibrate", "level", results.to_str().unwrap(), "-o", output.to_str().unwrap()];
    let ended = run(&arguments);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(ended.stderr.contains("camera_and_plane") && !output.exists(), "{ended:?}");
}
