//! The axis from rendered boards of every kind that slide or turn.

use std::{fs, path::PathBuf};

use laser_profiler::scanner::axis::{Axis, AxisKind, RawPosition};
use nalgebra::{Isometry3, Point3, Unit, Vector3};
use serde_json::Value as Json;
use tempfile::TempDir;

use super::{
    axis::with_rig,
    calibrate,
    charuco::{self, PARTLY_HIDDEN},
    circles::{ASYMMETRIC, SYMMETRIC},
    number, refused,
    render::{Checkerboard, Renderer, Surface, Warped, pose, save},
    vector,
};

const FRAMES: u32 = 7;
const BOARD: Checkerboard = Checkerboard { columns: 8, rows: 6, square_m: 0.02 };
const TARGET: &str = "checkerboard:8x6:0.020";
/// Largest angle between the axis and the truth, degrees.
const MAX_OFF_DEG: f64 = 0.2;
/// Pictures that deviate more from their stated position lag, which none does: metres or radians.
const MAX_LAG: f64 = 5e-5;
/// Longest distance of a rotary axis from the truth, metres.
const MAX_BESIDE_M: f64 = 0.5e-3;

/// Pictures of a board that moves, beside the rig's calibration.
struct Scene {
    directory: TempDir,
    axis: Axis,
    step: f64,
}

fn arguments<'a>(rig: &'a str, target: &'a str, step: &'a str) -> [&'a str; 7] {
    ["axis", "--target", target, "--calibration", rig, "--step", step]
}

impl Scene {
    /// A linear axis, 12 mm from picture to picture.
    fn sliding(surface: &dyn Surface, start: &Isometry3<f64>) -> Self {
        let direction = Unit::new_normalize(Vector3::new(0.8, 0.2, 0.4));
        let axis =
            Axis { kind: AxisKind::Prismatic, point_m: Point3::origin(), direction, scale: 1.0 };
        Self::new(surface, start, axis, 0.012)
    }

    /// A turntable on which the board lies, about a point beside its middle.
    fn turning(surface: &dyn Surface, start: &Isometry3<f64>, step: f64) -> Self {
        let direction = Unit::new_normalize(start.rotation * -Vector3::z());
        let point_m = start * Point3::new(0.05, 0.03, 0.0);
        let axis = Axis { kind: AxisKind::Revolute, point_m, direction, scale: 1.0 };
        Self::new(surface, start, axis, step)
    }

    fn new(surface: &dyn Surface, start: &Isometry3<f64>, axis: Axis, step: f64) -> Self {
        let directory = with_rig();
        let renderer = Renderer::new();
        for frame in 0..FRAMES {
            let at = axis.pose(RawPosition(step * f64::from(frame))) * start;
            let picture = renderer.render(surface, &at, None);
            save(&picture, &directory.path().join("pictures"), &format!("{frame:02}.png"));
        }
        Self { directory, axis, step }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    /// Calibrates the axis, whose positions grow by `step` from picture to picture.
    fn calibrated(&self, target: &str, step: f64) -> Json {
        let (rig, step) = (self.file("rig.yaml"), step.to_string());
        let arguments = arguments(rig.to_str().unwrap(), target, &step);
        calibrate(&arguments, &self.file("pictures"), &self.file(&format!("{step}.yaml")))
    }

    /// Calibrates the axis and compares it with the truth.
    fn check(&self, target: &str) -> Json {
        let found = self.calibrated(target, self.step);
        let axis = vector(&found, "direction");
        let off_deg = axis.angle(&self.axis.direction).to_degrees();
        assert!(off_deg < MAX_OFF_DEG, "{target}: {off_deg} degrees: {found}");
        assert_eq!(found["scale"].as_f64(), Some(1.0), "{target}: {found}");
        for picture in found["suspicious"].as_array().unwrap() {
            let off = number(picture, "off").abs();
            assert!(off < MAX_LAG, "{target}: {picture}");
        }
        let kind = match self.axis.kind {
            AxisKind::Prismatic => "prismatic",
            AxisKind::Revolute => "revolute",
        };
        assert_eq!(found["kind"], kind, "{target}");
        if self.axis.kind == AxisKind::Revolute {
            let off = vector(&found, "point_m") - self.axis.point_m.coords;
            let beside = (off - axis * axis.dot(&off)).norm();
            assert!(beside < MAX_BESIDE_M, "{target}: {beside} m beside the axis: {found}");
        }
        found
    }
}

#[test]
fn a_checkerboard_that_slides_gives_direction_and_unit() {
    let scene = Scene::sliding(&BOARD, &pose(&BOARD, [-0.04, -0.01, 0.4], [20.0, -15.0, 5.0]));
    let found = scene.check(TARGET);
    assert!(found["bend"].is_null(), "{found}");
    // An encoder of 1000 counts a step: its unit is found.
    let counted = scene.calibrated(TARGET, -1000.0);
    assert!((number(&counted, "scale") / 12e-6 - 1.0).abs() < 5e-3, "{counted}");
    let back = vector(&counted, "direction").angle(&-scene.axis.direction.into_inner());
    assert!(back.to_degrees() < MAX_OFF_DEG, "{counted}");
}

#[test]
fn a_table_states_the_positions_of_pictures() {
    let scene = Scene::sliding(&BOARD, &pose(&BOARD, [-0.04, -0.01, 0.4], [20.0, -15.0, 5.0]));
    // The fourth picture has no row, and the order of the rows does not matter.
    let rows = (0..FRAMES).rev().filter(|frame| *frame != 3);
    let rows = rows.map(|frame| format!("{frame:02}.png,{}\n", 0.012 * f64::from(frame)));
    let (rig, table) = (scene.file("rig.yaml"), scene.file("positions.csv"));
    fs::write(&table, format!("file,position\n{}", rows.collect::<String>())).unwrap();
    let [axis, target, of_target, calibration, rig, ..] =
        arguments(rig.to_str().unwrap(), TARGET, "");
    let table = ["--positions", table.to_str().unwrap()];
    let arguments = [&[axis, target, of_target, calibration, rig], &table[..]].concat();
    let found = calibrate(&arguments, &scene.file("pictures"), &scene.file("axis.yaml"));
    assert_eq!((found["views_used"].as_u64(), found["scale"].as_f64()), (Some(6), Some(1.0)));
    let rejected = &found["views_rejected"][0];
    assert!(rejected["view"].as_str().unwrap().ends_with("03.png"), "{rejected}");
    assert_eq!(rejected["reason"], "no position is stated for it");
}

#[test]
fn grids_of_circles_slide_and_turn() {
    for grid in [SYMMETRIC, ASYMMETRIC] {
        let start = grid.pose([-0.03, -0.01, 0.5], [20.0, -15.0, 5.0]);
        Scene::sliding(&grid, &start).check(&grid.target());
        let start = grid.pose([0.0, 0.0, 0.6], [30.0, 10.0, 0.0]);
        Scene::turning(&grid, &start, 0.2).check(&grid.target());
    }
}

#[test]
fn a_charuco_board_may_be_partly_hidden_and_turn_by_more_than_a_quarter() {
    let start = PARTLY_HIDDEN.pose([-0.03, -0.01, 0.42], [20.0, -15.0, 5.0]);
    Scene::sliding(&PARTLY_HIDDEN, &start).check(charuco::TARGET);
    let start = PARTLY_HIDDEN.pose([0.0, 0.0, 0.42], [30.0, 10.0, 0.0]);
    Scene::turning(&PARTLY_HIDDEN, &start, 1.9).check(charuco::TARGET);
}

#[test]
fn a_bent_board_is_accounted_for() {
    for bend_per_m in [[0.2, 0.0, 0.0], [0.0, 0.0, -0.3], [0.0, 0.2, 0.0]] {
        let surface = Warped { board: BOARD, ratio: 1.0, bend_per_m };
        let start = pose(&BOARD, [-0.04, -0.01, 0.4], [20.0, -15.0, 5.0]);
        let slid = Scene::sliding(&surface, &start).check(TARGET);
        let start = pose(&BOARD, [0.0, 0.0, 0.4], [30.0, 10.0, 0.0]);
        let turned = Scene::turning(&surface, &start, 0.6).check(TARGET);
        for found in [slid, turned] {
            assert_eq!(found["bend"]["is_shared"], true, "{bend_per_m:?}: {found}");
        }
    }
}

#[test]
fn a_board_of_which_a_part_is_missing_is_refused_with_the_reason() {
    let far = pose(&BOARD, [0.1, 0.0, 0.3], [20.0, -15.0, 5.0]);
    let scene = Scene::sliding(&BOARD, &far);
    let rig = scene.file("rig.yaml");
    let partly = arguments(rig.to_str().unwrap(), TARGET, "0.012");
    let (pictures, output) = (scene.file("pictures"), scene.file("axis.yaml"));
    refused(&partly, &pictures, &output, &["corners of the board, at least 48 are needed"]);
    let unknown = arguments(rig.to_str().unwrap(), "board:8x6:0.020", "0.012");
    refused(&unknown, &pictures, &output, &["asymmetric-circles:4x11:0.020"]);
}
