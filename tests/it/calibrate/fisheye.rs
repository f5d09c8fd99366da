//! The camera of a fisheye lens, from rendered checkerboards.

use std::fs;

use laser_profiler::scanner::{
    calibration::CameraCalibration,
    camera::{Camera, DistortedPixel, Distortion},
};
use nalgebra::{Isometry3, Point2, Translation3, UnitQuaternion, Vector3};
use tempfile::TempDir;

use super::{
    assert_holds, calibrate, number,
    render::{Checkerboard, Renderer, blurred, save},
};

const BOARD: Checkerboard = Checkerboard { columns: 8, rows: 6, square_m: 0.02 };
const TARGET: [&str; 3] = ["camera", "--target", "checkerboard:8x6:0.020"];
const FISHEYE: [&str; 2] = ["--model", "equidistant"];

fn camera(focal_px: f64, [k1, k2, k3, k4]: [f64; 4]) -> Camera {
    Camera {
        width_px: 480,
        height_px: 360,
        fx_px: focal_px,
        fy_px: 0.997 * focal_px,
        cx_px: 243.0,
        cy_px: 176.0,
        distortion: Distortion::Equidistant { k1, k2, k3, k4 },
        tilt_rad: [0.0; 2],
    }
}

/// Boards all round the optical axis that face the lens, tilted each way.
fn poses(widest_rad: f64) -> Vec<Isometry3<f64>> {
    let pose = |i: i32| {
        let i = f64::from(i);
        // The golden angle spreads directions evenly.
        let (round, off) = (2.4 * i, widest_rad * (i / 19.0).sqrt());
        let direction = Vector3::new(off.sin() * round.cos(), off.sin() * round.sin(), off.cos());
        let facing = UnitQuaternion::rotation_between(&Vector3::z(), &direction).unwrap();
        let (x, y) = (0.5 * (2.1 * i).sin(), 0.5 * (1.3 * i).cos());
        let turned = facing * UnitQuaternion::from_euler_angles(x, y, 0.3 * (0.7 * i).sin());
        let distance_m = 0.24 + 0.04 * (1.7 * i).sin();
        let half = |corners: u32| f64::from(corners - 1) * BOARD.square_m / 2.0;
        let middle = Vector3::new(half(BOARD.columns), half(BOARD.rows), 0.0);
        let shift = direction * distance_m - turned * middle;
        Isometry3::from_parts(Translation3::from(shift), turned)
    };
    (0..20).map(pose).collect()
}

fn rendered(camera: Camera, widest_rad: f64, blur: Option<f32>) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    let renderer = Renderer::of(camera);
    for (i, pose) in poses(widest_rad).into_iter().enumerate() {
        let picture = renderer.render(&BOARD, &pose, None);
        let picture = blur.map_or(picture.clone(), |sigma| blurred(&picture, sigma, 2.0, i as u64));
        save(&picture, directory.path(), &format!("view_{i:02}.png"));
    }
    directory
}

#[test]
fn a_rendered_fisheye_is_found_again() {
    for (truth, widest_rad, blur) in [
        (camera(225.0, [0.0; 4]), 0.75, None),
        (camera(225.0, [-0.03, 0.01, -0.004, 0.0005]), 0.75, None),
        (camera(320.0, [0.05, -0.02, 0.0, 0.0]), 0.45, None),
        (camera(225.0, [-0.03, 0.01, -0.004, 0.0005]), 0.75, Some(0.8)),
    ] {
        let pictures = rendered(truth, widest_rad, blur);
        let output = pictures.path().join("camera.yaml");
        let found = calibrate(&[&TARGET[..], &FISHEYE].concat(), pictures.path(), &output);
        eprintln!("{} views, {:.3} px RMS", found["views_used"], number(&found, "rms_px"));
        assert!(number(&found, "views_used") >= 15.0, "{found}");
        assert!(number(&found, "rms_px") < 0.12, "{found}");
        assert_holds(&found, &truth, 1.0);
        let read = CameraCalibration::from_yaml(&fs::read_to_string(&output).unwrap()).unwrap();
        assert!(matches!(read.camera.distortion, Distortion::Equidistant { .. }));
        // Where there were boards, the lens bends as the true one.
        for u in [80.0, 240.0, 400.0] {
            let pixel = DistortedPixel(Point2::new(u, 60.0));
            let [ray, wanted] = [read.camera, truth].map(|camera| camera.ray(pixel).unwrap());
            assert!(ray.angle(&wanted) < 1e-3, "column {u}: {} rad", ray.angle(&wanted));
        }
    }
}
