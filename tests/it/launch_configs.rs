//! The node accepts every parameter file in `launch_configs/` and its calibration.

use std::{
    fs,
    path::{Path, PathBuf},
};

use laser_profiler::{
    ros::{
        arguments::RosArguments, camera_params::CameraParams, names::NodeNames,
        node_params::NodeParams, parameters::Parameters,
    },
    scanner::{
        calibration::{Calibration, VerticalIncidence},
        channel::SearchedRegion,
        params::{Channel, StripeDirection},
    },
};

fn directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("launch_configs")
}

/// The files of a directory whose names end so.
fn files_ending(end: &str) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> =
        fs::read_dir(directory()).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.to_string_lossy().ends_with(end));
    files.sort();
    files
}

fn load(path: &Path) -> Vec<CameraParams> {
    let arguments =
        RosArguments { parameter_files: vec![path.to_owned()], ..RosArguments::default() };
    let values = Parameters::load(&NodeNames::new("laser_profiler", &[]).unwrap(), &arguments)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    assert_ne!(values, Parameters::default(), "{} sets nothing", path.display());
    let params = NodeParams::new(&values);
    params.unwrap_or_else(|error| panic!("{}: {error}", path.display())).cameras
}

#[test]
fn every_parameter_file_is_taken() {
    let files: Vec<PathBuf> = files_ending(".yaml")
        .into_iter()
        .filter(|path| {
            let is = |ending| path.to_string_lossy().ends_with(ending);
            !is(".calibration.yaml") && !is(".launch.yaml")
        })
        .collect();
    assert!(files.len() >= 3, "{files:?}");
    for path in &files {
        for calibration in load(path).into_iter().filter_map(|camera| camera.calibration_file) {
            assert!(calibration.is_file(), "{}: {}", path.display(), calibration.display());
        }
    }
}

#[test]
fn every_calibration_is_valid() {
    let files = files_ending(".calibration.yaml");
    assert!(!files.is_empty());
    for path in files {
        Calibration::from_yaml(&fs::read_to_string(&path).unwrap())
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
}

fn calibration(camera: &CameraParams) -> VerticalIncidence {
    let yaml = fs::read_to_string(camera.calibration_file.as_ref().unwrap()).unwrap();
    let calibration = Calibration::from_yaml(&yaml).unwrap();
    let Calibration::VerticalIncidence(rig) = calibration else { panic!("{calibration:?}") };
    rig
}

/// Table and the top of a cell of 10 mm lie in the part of 2592 x 2048 pixels that is searched.
fn sees_the_cell(camera: &CameraParams) {
    let searched = SearchedRegion::new(camera.scanner.roi, 2592, 2048).unwrap();
    for z_m in [0.0, 0.010] {
        let (_, row_px) = calibration(camera).project(0.0, z_m).unwrap();
        let rows = searched.y as f64..(searched.y + searched.height) as f64;
        assert!(rows.contains(&row_px), "{}: {z_m} m is seen in row {row_px}", camera.name);
    }
}

#[test]
fn they_fit_the_cameras_that_they_name() {
    sees_the_cell(&load(&directory().join("cell.yaml"))[0]);
    let turntable = load(&directory().join("turntable.yaml")).remove(0).scanner;
    assert!(SearchedRegion::new(turntable.roi, 640, 480).is_ok());
    assert_eq!(
        (turntable.stripe_direction, turntable.channel),
        (StripeDirection::Vertical, Channel::Green)
    );
}

#[test]
fn two_cameras_are_two() {
    let cameras = load(&directory().join("two_cameras.yaml"));
    let frames = cameras.iter().map(|camera| {
        sees_the_cell(camera);
        (camera.name.clone(), calibration(camera).frame_id)
    });
    let pair = |name: &str, frame: &str| (name.to_owned(), frame.to_owned());
    assert_eq!(
        frames.collect::<Vec<_>>(),
        [pair("left", "left_laser_plane"), pair("right", "right_laser_plane")]
    );
}
