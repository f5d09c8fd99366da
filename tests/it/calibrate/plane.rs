//! The laser plane, from rendered boards with its line on them.

use std::{fs, path::PathBuf};

use laser_profiler::scanner::{
    calibration::Calibration,
    camera::{Camera, Distortion},
    laser_plane::LaserPlane,
};
use nalgebra::Vector3;
use tempfile::TempDir;

use super::{
    calibrate, number, reason, refused,
    render::{self, Checkerboard, Renderer, pose, save, save_camera},
    vector,
};

const BOARD: Checkerboard = Checkerboard { columns: 8, rows: 5, square_m: 0.03 };
const TARGET: [&str; 2] = ["--target", "checkerboard:8x5:0.030"];
const VERTICAL: [&str; 3] = ["--ros-args", "-p", "stripe_direction:=vertical"];

/// Boards that the laser crosses, near and far and tilted.
const VIEWS: [[[f64; 3]; 2]; 7] = [
    [[0.0, 0.0, 0.5], [0.0, 0.0, 0.0]],
    [[0.02, 0.0, 0.44], [15.0, 5.0, 0.0]],
    [[-0.02, 0.01, 0.56], [-15.0, 8.0, 4.0]],
    [[0.0, -0.02, 0.47], [5.0, -18.0, 0.0]],
    [[0.0, 0.02, 0.53], [0.0, 18.0, -4.0]],
    [[0.01, 0.0, 0.42], [-10.0, -10.0, 3.0]],
    [[-0.02, 0.0, 0.6], [12.0, 12.0, 0.0]],
];

/// Pictures in a directory of their own, and a file of the camera beside it.
struct Scene {
    directory: TempDir,
    renderer: Renderer,
}

impl Scene {
    fn new() -> Self {
        let scene = Self { directory: tempfile::tempdir().unwrap(), renderer: Renderer::new() };
        fs::create_dir(scene.pictures()).unwrap();
        scene.write_camera(render::camera());
        scene
    }

    fn pictures(&self) -> PathBuf {
        self.directory.path().join("pictures")
    }

    fn output(&self) -> PathBuf {
        self.directory.path().join("rig.yaml")
    }

    fn write_camera(&self, camera: Camera) {
        save_camera(camera, &self.directory.path().join("camera.yaml"));
    }

    fn add(&self, name: &str, [middle, turned]: [[f64; 3]; 2], laser: Option<&LaserPlane>) {
        let picture = self.renderer.render(&BOARD, &pose(&BOARD, middle, turned), laser);
        save(&picture, &self.pictures(), name);
    }

    fn with(views: &[[[f64; 3]; 2]]) -> Self {
        let scene = Self::new();
        for (i, view) in views.iter().enumerate() {
            scene.add(&format!("view_{i}.png"), *view, Some(&render::laser()));
        }
        scene
    }

    fn arguments(&self) -> Vec<String> {
        let camera = self.directory.path().join("camera.yaml").display().to_string();
        let own = ["plane".to_owned(), "--camera".to_owned(), camera];
        own.into_iter().chain(TARGET.into_iter().chain(VERTICAL).map(str::to_owned)).collect()
    }

    fn refused(&self, reported: &[&str]) {
        let arguments = self.arguments();
        let arguments: Vec<_> = arguments.iter().map(String::as_str).collect();
        refused(&arguments, &self.pictures(), &self.output(), reported);
    }
}

#[test]
fn a_rendered_plane_is_found_again_beside_bad_pictures() {
    let scene = Scene::with(&VIEWS);
    scene.add("x_dark.png", VIEWS[1], None);
    // The board moved between its line and its corners: the line of another plane.
    let shifted = LaserPlane { distance_m: 0.225, ..render::laser() };
    scene.add("x_moved.png", VIEWS[3], Some(&shifted));
    let arguments = scene.arguments();
    let arguments: Vec<_> = arguments.iter().map(String::as_str).collect();
    let found = calibrate(&arguments, &scene.pictures(), &scene.output());
    assert_eq!(found["boards_used"], 7, "{found}");
    let truth = render::laser();
    let off_deg = vector(&found, "normal").angle(&truth.normal).to_degrees();
    assert!(off_deg < 0.05, "{off_deg} degrees: {found}");
    let off_m = (number(&found, "distance_m") - truth.distance_m).abs();
    let sigma_m = number(&found["uncertainties"], "distance_m");
    assert!(off_m < 3.0 * sigma_m && sigma_m < 0.25e-3, "{off_m} m: {found}");
    assert!(number(&found, "plane_rms_m") < 0.15e-3, "{found}");
    assert!(reason(&found, "x_dark").contains("no laser line"), "{found}");
    assert!(reason(&found, "x_moved").contains("from the other boards' plane"), "{found}");

    let text = fs::read_to_string(scene.output()).unwrap();
    let Calibration::CameraAndPlane(read) = Calibration::from_yaml(&text).unwrap() else {
        panic!("{text}")
    };
    assert!((read.plane.normal.into_inner() - vector(&found, "normal")).norm() < 1e-12);
    assert_eq!(read.plane_quality.unwrap().boards_used, 7);
}

#[test]
fn a_camera_of_another_size_is_refused() {
    let scene = Scene::with(&VIEWS);
    scene.write_camera(Camera { width_px: 640, height_px: 480, ..render::camera() });
    scene.refused(&["480 x 360", "640 x 480"]);
}

/// Its lens bends the other way: the corners lie a pixel and more from where this camera sees them, in every view.
#[test]
fn the_camera_of_another_lens_is_refused() {
    let scene = Scene::with(&VIEWS);
    let distortion = Distortion::PlumbBob { k1: 0.6, k2: 0.0, p1: 0.0, p2: 0.0, k3: 0.0 };
    scene.write_camera(Camera { distortion, ..render::camera() });
    scene.refused(&["6 not used", "px from where this camera sees the board"]);
}

#[test]
fn boards_in_one_place_determine_no_plane() {
    // Turned about the normal only: all lines lie in one.
    let one = [0.0, 10.0, -10.0, 5.0, -5.0].map(|z| [[0.0, 0.0, 0.5], [0.0, 0.0, z]]);
    Scene::with(&one).refused(&["one straight line in space", "nearer and farther"]);
}

#[test]
fn boards_without_a_laser_are_refused() {
    let scene = Scene::new();
    for (i, view) in VIEWS.iter().enumerate() {
        scene.add(&format!("view_{i}.png"), *view, None);
    }
    scene.refused(&["boards with a usable line: 0", "no laser line on the board"]);
}

#[test]
fn a_file_without_camera_is_refused() {
    let scene = Scene::with(&VIEWS[..1]);
    fs::write(scene.directory.path().join("camera.yaml"), "type: projective\n").unwrap();
    scene.refused(&["camera.yaml", "projective"]);
}

/// The ground truth is the renderer's input, not the camera's estimate.
#[test]
fn the_rendered_line_is_the_intersection_of_the_planes() {
    let renderer = Renderer::new();
    let laser = render::laser();
    let picture = renderer.render(&BOARD, &pose(&BOARD, [0.0, 0.0, 0.5], [0.0; 3]), Some(&laser));
    // On the board z = 0.5: 0.9 x - 0.1 y + 0.42 z = 0.21 / |n| · |n|.
    let scale = Vector3::new(0.9_f64, -0.1, 0.42).norm();
    let x = (laser.distance_m * scale - 0.42 * 0.5) / 0.9;
    let seen = render::camera().project(nalgebra::Point3::new(x, 0.0, 0.5));
    let at = seen.unwrap().0;
    let excess = |u: u32| {
        let image::Rgb([red, green, _]) = *picture.get_pixel(u, at.y.round() as u32);
        i32::from(green) - i32::from(red)
    };
    let brightest = (0..480).max_by_key(|&u| excess(u)).unwrap();
    assert!((f64::from(brightest) - at.x).abs() <= 1.0, "{brightest} {at}");
}
