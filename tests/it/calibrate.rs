//! `laser_profiler calibrate camera`, `plane` and `axis`: on rendered boards and markers whose truth is known, on bad input,
//! and on real recordings.

mod axis;
mod axis_boards;
mod camera;
mod charuco;
mod circles;
mod fisheye;
mod hard_boards;
mod plane;
mod real;
mod render;
mod warped_boards;

use std::{fs, path::Path};

use image::{DynamicImage, RgbImage};
use laser_profiler::{
    calibrate::{Board, GrayPicture, Target, TargetDetector},
    scanner::camera::Camera,
};
use nalgebra::Isometry3;
use serde_json::Value as Json;

use crate::program::{Ended, end, laser_profiler};
use render::{Renderer, Surface, save, save_camera};

/// Runs `calibrate` with `--json`; it must succeed.
fn calibrate(arguments: &[&str], input: &Path, output: &Path) -> Json {
    let ended = run(arguments, input, output);
    assert_eq!(ended.code, Some(0), "{ended:?}");
    serde_json::from_str(&ended.stdout).unwrap()
}

/// Runs `calibrate` with `--json`.
fn run(arguments: &[&str], input: &Path, output: &Path) -> Ended {
    let mut command = laser_profiler(&["calibrate"]);
    command.args(&arguments[..1]).arg(input).arg("--json").arg("-o").arg(output);
    end(command.args(&arguments[1..]))
}

/// Runs `calibrate`; it must fail, write nothing and report all of `reported`.
fn refused(arguments: &[&str], input: &Path, output: &Path, reported: &[&str]) {
    let ended = run(arguments, input, output);
    assert!(matches!(ended.code, Some(1 | 2)), "{ended:?}");
    assert!(!output.exists(), "no calibration is written");
    for text in reported {
        assert!(ended.stderr.contains(text), "{text:?} in {}", ended.stderr);
    }
}

fn number(json: &Json, key: &str) -> f64 {
    json[key].as_f64().unwrap_or_else(|| panic!("{key} in {json}"))
}

fn vector(json: &Json, key: &str) -> nalgebra::Vector3<f64> {
    nalgebra::Vector3::from_fn(|i, _| json[key][i].as_f64().unwrap())
}

/// The focal lengths lie within two stated standard deviations of the truth, the principal point within three, and no
/// standard deviation exceeds `most_px`.
fn assert_holds(found: &Json, truth: &Camera, most_px: f64) {
    for (name, wanted, sigmas) in [
        ("fx", truth.fx_px, 2.0),
        ("fy", truth.fy_px, 2.0),
        ("cx", truth.cx_px, 3.0),
        ("cy", truth.cy_px, 3.0),
    ] {
        let off = number(&found["intrinsics"], name) - wanted;
        let sigma = number(&found["uncertainties"], name);
        eprintln!("{name}: {off:.3} ± {sigma:.3}");
        let holds = off.abs() < sigmas * sigma && sigma < most_px;
        assert!(holds, "{name}: {off} ± {sigma}: {found}");
    }
}

/// Calibrates the plane of the rendered laser with the true camera, from pictures of a surface in these poses.
fn rendered_plane(
    surface: &dyn Surface,
    poses: impl IntoIterator<Item = Isometry3<f64>>,
    target: &str,
) -> Json {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    fs::create_dir(at("pictures")).unwrap();
    let renderer = Renderer::new();
    for (i, pose) in poses.into_iter().enumerate() {
        let picture = renderer.render(surface, &pose, Some(&render::laser()));
        save(&picture, &at("pictures"), &format!("view_{i:02}.png"));
    }
    save_camera(render::camera(), &at("camera.yaml"));
    let camera = at("camera.yaml").display().to_string();
    let plane = ["plane", "--target", target, "--camera", &camera];
    let vertical = ["--ros-args", "-p", "stripe_direction:=vertical"];
    calibrate(&[&plane[..], &vertical].concat(), &at("pictures"), &at("rig.yaml"))
}

/// Returns the angle between the found plane of the rendered laser and the true one, degrees, and the difference of their
/// distances, metres.
fn off_plane(found: &Json) -> [f64; 2] {
    let truth = render::laser();
    let off_deg = vector(found, "normal").angle(&truth.normal).to_degrees();
    [off_deg, (number(found, "distance_m") - truth.distance_m).abs()]
}

/// Detects a target in a picture.
fn found_in(picture: &RgbImage, target: &str) -> Result<Board, String> {
    let target: Target = target.parse().unwrap();
    let picture = DynamicImage::from(picture.clone()).into_luma8();
    let (width, height) = picture.dimensions();
    let picture = GrayPicture { width, height, levels: picture.into_raw() };
    let detector = TargetDetector::new(&target, 12).unwrap();
    detector.detect(&picture).map_err(|error| error.to_string())
}

/// Returns the reason why the view whose name contains `view` was not used.
fn reason(json: &Json, view: &str) -> String {
    let all = json["views_rejected"].as_array().unwrap();
    let found = all.iter().find(|one| one["view"].as_str().unwrap().contains(view));
    found.unwrap_or_else(|| panic!("{view} in {all:?}"))["reason"].as_str().unwrap().to_owned()
}
