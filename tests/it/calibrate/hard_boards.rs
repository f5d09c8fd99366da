//! Boards that make it hard: wide lenses, blur, and a laser line along the corners.

use std::fs;

use image::{Rgb, RgbImage, imageops};
use laser_profiler::scanner::laser_plane::LaserPlane;
use nalgebra::{Isometry3, Unit, Vector3};
use tempfile::TempDir;

use super::{
    calibrate, number, reason,
    render::{self, Checkerboard, Renderer, VIEWS, pose, save},
};
use crate::program::{end, laser_profiler};

const BOARD: Checkerboard = Checkerboard { columns: 8, rows: 5, square_m: 0.03 };
const CAMERA: [&str; 3] = ["camera", "--target", "checkerboard:8x5:0.030"];

/// Near boards: each corner is seen well.
fn views() -> impl ExactSizeIterator<Item = [[f64; 3]; 2]> {
    VIEWS.into_iter().take(9)
}

/// Sharp views through lenses that bend straight lines by up to a third of the picture.
#[test]
fn sharp_views_through_a_wide_lens_are_used() {
    for distortion in [[-0.25, 0.05], [-0.36, 0.12], [0.2, 0.05]] {
        let directory = tempfile::tempdir().unwrap();
        let scenario = format!(
            "rig:
  width_px: 1280
  height_px: 720
  read_noise: 1.5
  lens: {{focal_px: [724.0, 724.0], center_px: [650.0, 352.0], distortion: [{}, {}, 0, 0, 0, 0, 0, 0]}}
  laser_normal: [0.0, -0.866, 0.5]
  laser_distance_m: 0.15
laser: {{amplitude: 183.0, sigma_px: 2.3}}
frame_rate_hz: 50.0
start_time_ns: 1767225600000000000
seed: 11
frames: 16
boards: {{corners: [9, 6], square_m: 0.03, white: 170.0, black: 30.0, distance_m: [0.22, 0.3], max_tilt_rad: 0.55}}
",
            distortion[0], distortion[1]
        );
        let file = directory.path().join("wide.scenario.yaml");
        fs::write(&file, scenario).unwrap();
        let bag = directory.path().join("boards");
        let ended = end(laser_profiler(&["simulate"]).arg(&file).arg("-o").arg(&bag));
        assert_eq!(ended.code, Some(0), "{ended:?}");
        let target = ["camera", "--target", "checkerboard:9x6:0.030"];
        let found = calibrate(&target, &bag, &directory.path().join("camera.yaml"));
        // None is refused for its corners; one whose corners are off by a tenth of a pixel may contradict the others.
        assert!(number(&found, "views_used") >= 15.0, "{distortion:?}: {found}");
        assert!(!found["views_rejected"].to_string().contains("perspective"), "{found}");
        assert!(found["bend"].is_null(), "flat: {found}");
        for (name, truth) in [("fx", 724.0), ("fy", 724.0), ("cx", 650.0), ("cy", 352.0)] {
            let off = number(&found["intrinsics"], name) - truth;
            let sigma = number(&found["uncertainties"], name);
            assert!(off.abs() < 3.0 * sigma && sigma < 1.0, "{name}: {off} ± {sigma}: {found}");
        }
    }
}

/// Blurred by defocus and by motion, and with corners scattered as behind rough glass.
#[test]
fn blurred_views_are_refused() {
    let renderer = Renderer::new();
    let directory = tempfile::tempdir().unwrap();
    for (i, [middle, turned]) in views().enumerate() {
        let picture = renderer.render(&BOARD, &pose(&BOARD, middle, turned), None);
        save(&picture, directory.path(), &format!("view_{i}.png"));
    }
    let [middle, turned] = VIEWS[1];
    let sharp = renderer.render(&BOARD, &pose(&BOARD, middle, turned), None);
    save(&imageops::blur(&sharp, 16.0), directory.path(), "x_defocused.png");
    save(&swept(&sharp, 30), directory.path(), "x_moved.png");
    for (i, reach_px) in [2.0, 2.5, 3.0].into_iter().enumerate() {
        save(&behind_rough_glass(&sharp, reach_px), directory.path(), &format!("x_rough_{i}.png"));
    }
    let found = calibrate(&CAMERA, directory.path(), &directory.path().join("camera.yaml"));
    assert_eq!(found["views_used"], views().len(), "{found}");
    for i in 0..3 {
        let reason = reason(&found, &format!("x_rough_{i}"));
        assert!(reason.contains("where perspective and a lens put them"), "{reason}");
    }
    assert!(!reason(&found, "x_defocused").is_empty() && !reason(&found, "x_moved").is_empty());
}

/// The mean of the picture over a horizontal motion.
fn swept(sharp: &RgbImage, way_px: u32) -> RgbImage {
    RgbImage::from_fn(sharp.width(), sharp.height(), |u, v| {
        let level = |at: u32| u32::from(sharp.get_pixel(at.min(sharp.width() - 1), v).0[0]);
        let mean = (0..way_px).map(|step| level(u + step)).sum::<u32>() / way_px;
        Rgb([mean as u8; 3])
    })
}

/// Patches of 24 px, each shifted elsewhere.
fn behind_rough_glass(sharp: &RgbImage, reach_px: f64) -> RgbImage {
    RgbImage::from_fn(sharp.width(), sharp.height(), |u, v| {
        let patch = f64::from(u / 24) * 12.9898 + f64::from(v / 24) * 78.233;
        let shift = |phase: f64| (reach_px * (patch + phase).sin()).round() as i64;
        let at = |at: u32, shift: i64, size: u32| {
            (i64::from(at) + shift).clamp(0, i64::from(size) - 1) as u32
        };
        *sharp.get_pixel(at(u, shift(0.0), sharp.width()), at(v, shift(1.0), sharp.height()))
    })
}

/// The plane of a laser that meets the board along a line through a corner, `along` on the board, next to the corners.
fn laser_along(
    camera_from_board: &Isometry3<f64>,
    corner: [u32; 2],
    along: Vector3<f64>,
    beside_m: f64,
) -> LaserPlane {
    let side = along.cross(&Vector3::z()).normalize();
    let at = |corner: u32| f64::from(corner) * BOARD.square_m;
    let place = Vector3::new(at(corner[0]), at(corner[1]), 0.0) + side * beside_m;
    let through = (camera_from_board * nalgebra::Point3::from(place)).coords;
    let normal: Unit<Vector3<f64>> =
        Unit::new_normalize(camera_from_board.rotation * (side + 0.5 * Vector3::z()));
    let distance_m = normal.dot(&through);
    LaserPlane { normal, distance_m }
}

fn lit(along: Vector3<f64>, corner: [u32; 2]) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    let renderer = Renderer::new();
    for (i, [middle, turned]) in views().enumerate() {
        let pose = pose(&BOARD, middle, turned);
        let laser = laser_along(&pose, corner, along, 0.0012);
        save(&renderer.render(&BOARD, &pose, Some(&laser)), directory.path(), &format!("{i}.png"));
    }
    directory
}

fn assert_true(found: &serde_json::Value) {
    let truth = render::camera();
    for (name, truth) in [("fx", truth.fx_px), ("fy", truth.fy_px)] {
        let off = number(&found["intrinsics"], name) - truth;
        let sigma = number(&found["uncertainties"], name);
        assert!(off.abs() < 3.0 * sigma && sigma < 2.0, "{name}: {off} ± {sigma}: {found}");
    }
}

/// The line moves the corners next to it, and only those.
#[test]
fn corners_under_a_laser_line_are_left_out() {
    for (along, corner, most) in
        [(Vector3::y(), [3, 0], 5), (Vector3::x(), [0, 2], 8), (Vector3::y(), [7, 0], 5)]
    {
        let pictures = lit(along, corner);
        let found = calibrate(&CAMERA, pictures.path(), &pictures.path().join("camera.yaml"));
        assert_eq!(found["views_used"], views().len(), "{along}: {found}");
        let left_out = |view: &serde_json::Value| view["left_out"].as_u64().unwrap();
        let left_out: Vec<_> = found["views"].as_array().unwrap().iter().map(left_out).collect();
        assert!(left_out.iter().all(|count| *count <= most), "{left_out:?}");
        assert!(left_out.iter().sum::<u64>() > 0, "{left_out:?}");
        assert_true(&found);
    }
}
