//! A real rig: camera, laser plane and axis of the turntable, against an independent calibration of the same recordings.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use serde_json::Value as Json;
use tempfile::TempDir;

use super::{calibrate, number, refused, vector};
use crate::recordings::real;

const TARGET: [&str; 2] = ["--target", "checkerboard:8x6:0.040"];
const VERTICAL: [&str; 3] = ["--ros-args", "-p", "stripe_direction:=vertical"];

/// The camera of the rig, in a file.
fn camera(bag: &Path, directory: &TempDir) -> (Json, PathBuf) {
    let file = directory.path().join("camera.yaml");
    (calibrate(&[&["camera"][..], &TARGET].concat(), bag, &file), file)
}

/// Its laser plane.
fn plane(bag: &Path, camera: &Path, directory: &TempDir) -> (Json, PathBuf) {
    let file = directory.path().join("rig.yaml");
    let arguments = [&["plane", "--camera", camera.to_str().unwrap()], &TARGET[..], &VERTICAL];
    (calibrate(&arguments.concat(), bag, &file), file)
}

fn angle_deg(one: &Vector3<f64>, other: &Vector3<f64>) -> f64 {
    one.angle(other).to_degrees()
}

#[test]
fn the_rig_is_calibrated_from_its_recordings() {
    let [Some(boards), Some(lines), Some(turning)] =
        ["turntable_checkerboard", "turntable_checkerboard_laser", "turntable_empty"].map(real)
    else {
        return;
    };
    let directory = tempfile::tempdir().unwrap();
    let (found, camera_file) = camera(&boards, &directory);
    assert!(number(&found, "views_used") >= 130.0, "{found}");
    assert!(number(&found, "rms_px") <= 0.13, "{found}");
    assert!((number(&found["intrinsics"], "fx") - 627.5).abs() < 6.0, "{found}");

    let (found, rig) = plane(&lines, &camera_file, &directory);
    assert!(number(&found, "boards_used") >= 20.0, "{found}");
    assert!(number(&found, "plane_rms_m") <= 0.5e-3, "{found}");
    let off_deg = angle_deg(&vector(&found, "normal"), &Vector3::new(0.911, -0.139, 0.387));
    assert!(off_deg < 0.4, "{off_deg} degrees: {found}");
    assert!((number(&found, "distance_m") - 0.1667).abs() < 0.5e-3, "{found}");

    let axis = ["axis", "--markers", "aruco:4x4_50", "--calibration", rig.to_str().unwrap()];
    let output = directory.path().join("scanner.yaml");
    let found = calibrate(&[&axis[..], &VERTICAL].concat(), &turning, &output);
    let off_deg = angle_deg(&vector(&found, "direction"), &Vector3::new(0.032, -0.928, -0.371));
    assert!(off_deg < 1.0, "{off_deg} degrees: {found}");
    // The reference's plane lies 208.7 mm away; 1 % is what two calibrations of this rig differ by.
    assert!((number(&found["circles"], "table_distance_m") / 0.2087 - 1.0).abs() < 0.01, "{found}");
    assert!(number(&found, "rms_px") < 0.5, "{found}");
    // The table of this recording lags its joint by about a degree in these frames.
    let late = |one: &Json| (one["view"].as_str().unwrap().to_owned(), number(one, "off"));
    let late: Vec<_> = found["suspicious"].as_array().unwrap().iter().map(late).collect();
    let expected = [1, 2, 3, 4, 5].map(|frame| format!("turntable_empty:{frame}"));
    assert_eq!(late.iter().map(|(view, _)| view.clone()).collect::<Vec<_>>(), expected);
    assert!(late.iter().all(|(_, off)| (off.to_degrees() + 1.15).abs() < 0.15), "{late:?}");

    // Recordings without targets are distinguished from damaged ones.
    let other = directory.path().join("other.yaml");
    let wrong = ["axis", "--markers", "aruco:5x5_50", "--calibration", rig.to_str().unwrap()];
    refused(&wrong, &turning, &other, &["known position: 0", "no marker"]);
    let joint = [&axis[..], &["--joint", "elbow"]].concat();
    refused(&joint, &turning, &other, &["elbow"]);
    refused(&[&["camera"][..], &TARGET].concat(), &turning, &other, &["no picture shows"]);
}
