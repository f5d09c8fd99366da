//! The rotary axis, from rendered markers that turn.

use std::{fs, path::PathBuf};

use laser_profiler::{
    bag::{Compression, RecordOptions, Recorder, Times},
    msg::{
        builtin_interfaces::Time, cdr, laser_profiler_msgs::EncoderStamped, schema::Message as _,
        sensor_msgs::Image, std_msgs::Header,
    },
    scanner::{
        axis::AxisKind,
        calibration::{Calibration, CameraAndPlane},
        laser_plane::LaserPlane,
    },
};
use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use tempfile::TempDir;

use super::{
    calibrate, number, refused,
    render::{self, Renderer, Surface, save},
    vector,
};
use crate::recordings::{image_of_file, stamp_ns, topic};

/// Markers 0 to 3 of `DICT_4X4_50`, their bits row by row, 1 is white (OpenCV's `predefined_dictionaries.hpp`).
const MARKERS: [u16; 4] = [0xb532, 0x0f9a, 0x332d, 0x9946];
const SIDE_M: f64 = 0.03;
const RADIUS_M: f64 = 0.06;
const STEP_RAD: f64 = 0.3;
const FRAMES: usize = 21;

/// A white disk with four markers, turned by an angle.
struct Table {
    turned_rad: f64,
}

impl Surface for Table {
    fn albedo(&self, x: f64, y: f64) -> Option<f64> {
        let (sin, cos) = self.turned_rad.sin_cos();
        let (x, y) = (cos * x + sin * y, -sin * x + cos * y);
        if x.hypot(y) > 0.1 {
            return None;
        }
        for (at, bits) in MARKERS.iter().enumerate() {
            let (sin, cos) = (at as f64 * std::f64::consts::FRAC_PI_2).sin_cos();
            let (x, y) = (cos * x + sin * y - RADIUS_M, -sin * x + cos * y);
            let cell = |along: f64| (along / SIDE_M + 0.5) * 6.0;
            let (column, row) = (cell(x).floor(), cell(y).floor());
            if (0.0..6.0).contains(&column) && (0.0..6.0).contains(&row) {
                let inner = (1.0..5.0).contains(&column) && (1.0..5.0).contains(&row);
                let bit = (4.0 * (row - 1.0) + column - 1.0) as u32;
                let is_white = inner && bits & (0x8000_u16 >> bit.min(15)) != 0;
                return Some(if is_white { 0.85 } else { 0.08 });
            }
        }
        Some(0.85)
    }
}

/// The disk's frame: z along the axis, towards the camera; x of the image's kind, so that markers are not mirrored.
fn camera_from_table() -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_euler_angles(0.65, 0.1, 0.0);
    Isometry3::from_parts(Translation3::new(0.005, 0.01, 0.42), rotation)
}

fn direction() -> Vector3<f64> {
    camera_from_table().rotation * Vector3::z()
}

/// A plane of light through the table.
fn laser() -> LaserPlane {
    let middle = camera_from_table() * Point3::origin();
    let normal = Unit::new_normalize(Vector3::new(1.0, 0.05, 0.3));
    LaserPlane { normal, distance_m: normal.dot(&middle.coords) }
}

/// A table that turns by `STEP_RAD` per picture, except for the lags of `lag`.
fn scene(lag_rad: impl Fn(usize) -> f64) -> TempDir {
    let directory = with_rig();
    let renderer = Renderer::new();
    for frame in 0..FRAMES {
        let table = Table { turned_rad: STEP_RAD * frame as f64 - lag_rad(frame) };
        let picture = renderer.render(&table, &camera_from_table(), Some(&laser()));
        save(&picture, &directory.path().join("pictures"), &format!("{frame:02}.png"));
    }
    directory
}

/// A directory for pictures and the rig's calibration beside it.
pub(super) fn with_rig() -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    fs::create_dir(directory.path().join("pictures")).unwrap();
    let geometry = CameraAndPlane {
        frame_id: "laser_plane".to_owned(),
        camera_name: "rendered".to_owned(),
        camera: render::camera(),
        camera_quality: None,
        plane: laser(),
        plane_quality: None,
        alignment: None,
        part: None,
        axis: None,
        axis_quality: None,
        calibrated_at: None,
    };
    let text = Calibration::CameraAndPlane(Box::new(geometry)).to_yaml();
    fs::write(directory.path().join("rig.yaml"), text).unwrap();
    directory
}

fn arguments<'a>(rig: &'a str, markers: &'a str, step: &'a str) -> Vec<&'a str> {
    let own = ["axis", "--calibration", rig, "--markers", markers, "--step", step];
    own.into_iter().chain(["--ros-args", "-p", "stripe_direction:=vertical"]).collect()
}

#[test]
fn a_rendered_axis_is_found_again_and_pictures_that_lag_are_named() {
    let scene = scene(|frame| if (4..7).contains(&frame) { 0.03 } else { 0.0 });
    let (pictures, rig) = (scene.path().join("pictures"), scene.path().join("rig.yaml"));
    let truth = direction();
    let middle = (camera_from_table() * Point3::origin()).coords;
    for (markers, tolerance_m) in [("aruco:4x4_50:0.030", 2e-3), ("aruco:4x4_50", 0.5e-3)] {
        let output = scene.path().join(format!("{tolerance_m}.yaml"));
        let found =
            calibrate(&arguments(rig.to_str().unwrap(), markers, "0.3"), &pictures, &output);
        assert_eq!(found["circles"]["markers"], serde_json::json!([0, 1, 2, 3]));
        let axis = vector(&found, "direction");
        assert!(axis.angle(&truth).to_degrees() < 0.1, "{axis} {truth}");
        // Any point of the axis would do; its distance from the table's centre matters.
        let off = vector(&found, "point_m") - middle;
        let beside = (off - axis * axis.dot(&off)).norm();
        assert!(beside < tolerance_m, "{beside} m beside the axis with {markers}");
        let late = found["suspicious"].as_array().unwrap();
        let names: Vec<_> = late.iter().map(|one| one["view"].as_str().unwrap()).collect();
        assert_eq!(names.len(), 3, "{names:?}");
        for (name, frame) in names.iter().zip(4..) {
            assert!(name.ends_with(&format!("{frame:02}.png")), "{names:?}");
        }
        assert!((number(&late[0], "off") + 0.03).abs() < 2e-3, "{late:?}");

        let text = fs::read_to_string(&output).unwrap();
        let Calibration::CameraAndPlane(read) = Calibration::from_yaml(&text).unwrap() else {
            panic!("{text}")
        };
        let axis = read.axis.unwrap();
        assert_eq!((axis.kind, axis.scale), (AxisKind::Revolute, 1.0));
    }
}

#[test]
fn an_axis_that_runs_the_other_way_points_the_other_way() {
    let scene = scene(|_| 0.0);
    let (pictures, rig) = (scene.path().join("pictures"), scene.path().join("rig.yaml"));
    let output = scene.path().join("axis.yaml");
    let reversed =
        calibrate(&arguments(rig.to_str().unwrap(), "aruco:4x4_50", "-0.3"), &pictures, &output);
    let axis = vector(&reversed, "direction");
    assert!(axis.angle(&-direction()).to_degrees() < 0.1, "{axis}");
    assert_eq!(reversed["suspicious"], serde_json::json!([]));
}

/// The pictures as a recording, with an encoder of 16 bits that states 0.1 mrad a count and wraps on the way.
fn recorded(scene: &TempDir, scale: f64) -> PathBuf {
    let bag = scene.path().join(format!("bag_{scale}"));
    let options = RecordOptions { compression: Compression::None, force: false };
    let mut recorder = Recorder::create(&bag, options).unwrap();
    let topics = [("/image_raw", Image::TYPE), ("/table/encoder", EncoderStamped::TYPE)];
    let [images, counts] =
        topics.map(|(name, kind)| recorder.add_topic(&topic(name, kind)).unwrap());
    for number in 0..FRAMES {
        let at_ns = stamp_ns(number);
        let times = Times { log_ns: at_ns, publish_ns: at_ns, sequence: number as u32 + 1 };
        let header = Header { stamp: Time::from_ns(at_ns), frame_id: "".into() };
        let turned = (1e4 * STEP_RAD * number as f64).round() as i64;
        let sample = EncoderStamped {
            header,
            counts: (60_000 + turned) % 65_536,
            scale,
            ..EncoderStamped::default()
        };
        let mut bytes = Vec::new();
        cdr::encode(&sample, &mut bytes).unwrap();
        recorder.write(counts, times, &bytes).unwrap();
        let picture = scene.path().join(format!("pictures/{number:02}.png"));
        recorder.write(images, times, &image_of_file(&picture, number)).unwrap();
    }
    recorder.finish().unwrap();
    bag
}

#[test]
fn an_encoder_states_positions_too() {
    let scene = scene(|_| 0.0);
    let rig = scene.path().join("rig.yaml");
    let axis = ["axis", "--calibration", rig.to_str().unwrap(), "--markers", "aruco:4x4_50"];
    let ros = ["--ros-args", "-p", "stripe_direction:=vertical", "-p", "motion.encoder_bits:=16"];
    let arguments = [&axis[..], &ros].concat();
    let found = calibrate(&arguments, &recorded(&scene, 1e-4), &scene.path().join("axis.yaml"));
    let off = vector(&found, "direction").angle(&direction()).to_degrees();
    assert!(off < 0.1, "{found}");
    assert_eq!(found["suspicious"], serde_json::json!([]));
    let silent = scene.path().join("silent.yaml");
    refused(&arguments, &recorded(&scene, 0.0), &silent, &["motion.scale"]);
}

#[test]
fn pictures_that_do_not_turn_are_refused() {
    let scene = scene(|frame| STEP_RAD * frame as f64);
    let (pictures, rig) = (scene.path().join("pictures"), scene.path().join("rig.yaml"));
    let arguments = arguments(rig.to_str().unwrap(), "aruco:4x4_50", "0.3");
    refused(&arguments, &pictures, &scene.path().join("axis.yaml"), &["axis"]);
    let unknown = self::arguments(rig.to_str().unwrap(), "aruco:9x9", "0.3");
    refused(&unknown, &pictures, &scene.path().join("axis.yaml"), &["aruco:4x4_50:0.030"]);
}
