//! `calibrate steps` on pictures of a gauge whose geometry it does not know.

use std::path::{Path, PathBuf};

use image::{GrayImage, Luma};
use laser_profiler::scanner::{
    calibration::{Calibration, Lines},
    params::StripeDirection,
    profile::Profile,
    stripe::Centerline,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value as Json;

use crate::{
    program::{Ended, end, laser_profiler},
    recordings::{image_of_file, record_images},
};

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;
/// Pixels, and metres a pixel.
const FOCAL_PX: f64 = 2000.0;
const PITCH_M: f64 = 6e-6;
/// From the lens to the base point, metres, and the angle there.
const OBJECT_DISTANCE_M: f64 = 0.2;
const BETA_RAD: f64 = 0.6;

/// Row and metres a pixel along the stripe, of a height: a camera that looks at the base point, by its similar
/// triangles (depth and offset of the point along and across the optical axis).
fn seen(height_m: f64) -> (f64, f64) {
    let depth_m = OBJECT_DISTANCE_M - height_m * BETA_RAD.cos();
    let row = 300.0 - FOCAL_PX * height_m * BETA_RAD.sin() / depth_m;
    (row, depth_m / FOCAL_PX)
}

/// A picture of plateaus side by side, each (height in metres, last column); stripe 3 pixels wide, noise of 2 levels.
fn picture(plateaus: &[(f64, u32)], seed: u64) -> GrayImage {
    picture_of(seed, |column| {
        let (height_m, _) = plateaus.iter().find(|(_, last)| column <= *last).unwrap();
        seen(*height_m).0
    })
}

/// A picture of a line in the given row of each column.
fn picture_of(seed: u64, row_of: impl Fn(u32) -> f64) -> GrayImage {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    GrayImage::from_fn(WIDTH, HEIGHT, |column, row| {
        let from_middle = f64::from(row) - row_of(column);
        let normal: f64 = StandardNormal.sample(&mut random);
        let level = 10.0 + 200.0 * (-0.5 * (from_middle / 2.0).powi(2)).exp() + 2.0 * normal;
        Luma([level.round().clamp(0.0, 255.0) as u8])
    })
}

fn save(directory: &Path, name: &str, picture: &GrayImage) -> PathBuf {
    let path = directory.join(name);
    picture.save(&path).unwrap();
    path
}

fn calibrate(sources: &[String], arguments: &[&str]) -> Ended {
    let mut command = laser_profiler(&["calibrate", "steps"]);
    end(command.args(sources).args(arguments))
}

fn json(ended: &Ended) -> Json {
    assert_eq!(ended.code, Some(0), "{ended:?}");
    serde_json::from_str(&ended.stdout).unwrap()
}

const HEIGHTS_MM: [f64; 4] = [0.0, 2.0, 5.0, 9.0];

/// Four pictures, one height each, as PNG files.
fn four_pictures(directory: &Path) -> Vec<String> {
    let pictures = HEIGHTS_MM.iter().enumerate().map(|(i, mm)| {
        let picture = picture(&[(1e-3 * mm, WIDTH)], i as u64);
        format!("{}={mm}mm", save(directory, &format!("{i}.png"), &picture).display())
    });
    pictures.collect()
}

/// The position that a calibration file assigns to a pixel.
fn place(file: &Path, column: f32, row: f64) -> (f64, f64) {
    let calibration = Calibration::from_yaml(&std::fs::read_to_string(file).unwrap()).unwrap();
    let line = Centerline {
        u_px: vec![column],
        v_px: vec![row as f32],
        intensity: vec![1.0],
        sigma_px: vec![0.1],
        flags: vec![0],
        ..Centerline::default()
    };
    let lines = Lines { direction: StripeDirection::Horizontal, first: 0, count: WIDTH as usize };
    let mut profile = Profile::default();
    calibration.triangulate(&line, &lines, 255, &mut profile);
    let at = column as usize;
    (f64::from(profile.x_m[at]), f64::from(profile.z_m[at]))
}

#[test]
fn four_pictures_calibrate_heights_and_with_a_scale_the_profile() {
    let directory = tempfile::tempdir().unwrap();
    let sources = four_pictures(directory.path());
    let file = directory.path().join("calibration.yaml");
    let lateral = format!("{}", OBJECT_DISTANCE_M / FOCAL_PX);
    let output = file.display().to_string();
    let reported = json(&calibrate(&sources, &["--lateral", &lateral, "-o", &output, "--json"]));
    assert!(reported["rms_m"].as_f64().unwrap() < 1e-6, "{reported}");
    assert!(reported["rms_left_out_m"].as_f64().unwrap() < 4e-6, "{reported}");
    assert!(reported["linearity"].as_f64().unwrap() < 2e-4, "{reported}");
    assert_eq!(reported["heights"].as_array().unwrap().len(), 4);
    // A pixel is some 0.17 mm of height: a hundredth of it.
    for height_m in [0.001, 0.0035, 0.007] {
        let (row, lateral_m) = seen(height_m);
        let (x_m, z_m) = place(&file, 600.0, row);
        assert!((z_m - height_m).abs() < 2e-6, "{z_m} {height_m}");
        assert!((x_m - 280.5 * lateral_m).abs() < 5e-6, "{x_m} {}", 280.5 * lateral_m);
    }
}

/// A lens of radial distortion k1 bends the line of a flat: it is reported, and the file states what it does to heights.
#[test]
fn a_curved_line_is_a_warning_and_widens_the_uncertainty() {
    let directory = tempfile::tempdir().unwrap();
    let calibrated = |name: &str, k1: f64| {
        // Where the distorted image of a flat lies in a column; the small change along the stripe moves nothing of it.
        let row_of = |height_m: f64, column: u32| {
            let (x, y) =
                ((f64::from(column) - 319.5) / FOCAL_PX, (seen(height_m).0 - 140.0) / FOCAL_PX);
            140.0 + FOCAL_PX * y * (1.0 + k1 * (x * x + y * y))
        };
        let sources = HEIGHTS_MM.iter().enumerate().map(|(i, mm)| {
            let picture = picture_of(i as u64, |column| row_of(1e-3 * mm, column));
            let file = format!("{name}_{i}.png");
            format!("{}={mm}mm", save(directory.path(), &file, &picture).display())
        });
        let file = directory.path().join(format!("{name}.yaml"));
        let output = file.display().to_string();
        let arguments = ["--lateral", "0.1mm", "-o", &output, "--json"];
        let ended = calibrate(&sources.collect::<Vec<_>>(), &arguments);
        (json(&ended), ended.stderr, std::fs::read_to_string(file).unwrap())
    };
    let (reported, warning, file) = calibrated("straight", 0.0);
    assert_eq!(reported["line_curvature_significant"], false, "{reported}");
    assert!(!warning.contains("curved") && !file.contains("bow"), "{warning} {file}");
    let straight_u95_m = reported["u95_m"].as_f64().unwrap();

    let (reported, warning, file) = calibrated("curved", -0.1);
    let curvature_m = reported["line_curvature_m"].as_f64().unwrap();
    // Over the inner two thirds of the columns: k1 (213 px / f)² of 160 px are 0.18 px of 0.17 mm.
    assert!((curvature_m - 31e-6).abs() < 5e-6, "{reported}");
    assert_eq!(reported["line_curvature_significant"], true);
    assert!(reported["u95_m"].as_f64().unwrap() > straight_u95_m + 10e-6, "{reported}");
    assert!(warning.contains("curved by") && warning.contains("calibrate plane"), "{warning}");
    assert!(file.contains("bow"), "{file}");
}

/// Recordings serve as pictures do: the same pixels, the same heights.
#[test]
fn recordings_and_pictures_of_heights_agree() {
    let directory = tempfile::tempdir().unwrap();
    let pictures = four_pictures(directory.path());
    let bags: Vec<_> = HEIGHTS_MM
        .iter()
        .enumerate()
        .map(|(i, mm)| {
            let bag = directory.path().join(format!("bag_{i}"));
            record_images(&bag, &[image_of_file(&directory.path().join(format!("{i}.png")), 0)]);
            format!("{}={mm}mm", bag.display())
        })
        .collect();
    let [of_pictures, of_bags] =
        [&pictures, &bags].map(|sources| json(&calibrate(sources, &["--json"])));
    let heights = |reported: &Json| -> Vec<f64> {
        let all = reported["heights"].as_array().unwrap();
        all.iter().map(|height| height["measured_m"].as_f64().unwrap()).collect()
    };
    assert_eq!(heights(&of_pictures), heights(&of_bags));
    assert!(of_bags["rms_m"].as_f64().unwrap() < 1e-6, "{of_bags}");
    let twice = [&bags[..3], &[bags[3].replace("=9mm", "=4mm")]].concat();
    let refused = calibrate(&twice, &[]);
    assert!(refused.code == Some(2) && refused.stderr.contains("steadily"), "{refused:?}");
}

#[test]
fn known_optics_reproduce_formula_6() {
    let directory = tempfile::tempdir().unwrap();
    let sources = four_pictures(directory.path());
    let file = directory.path().join("calibration.yaml");
    let (output, distance) = (file.display().to_string(), (FOCAL_PX * PITCH_M).to_string());
    let arguments =
        ["--pixel-pitch", "6um", "--image-distance", &distance, "-o", &output, "--json"];
    let reported = json(&calibrate(&sources, &arguments));
    let geometry = &reported["geometry"];
    for (key, truth) in [("object_distance_m", OBJECT_DISTANCE_M), ("beta_rad", BETA_RAD)] {
        let value = geometry[key]["value"].as_f64().unwrap();
        assert!((value / truth - 1.0).abs() < 0.02, "{key}: {value}");
    }
    let (_, z_m) = place(&file, 320.0, seen(0.0035).0);
    assert!((z_m - 0.0035).abs() < 2e-6, "{z_m}");
}

#[test]
fn one_picture_of_a_stair_gauge_gives_heights_and_scale() {
    let directory = tempfile::tempdir().unwrap();
    // Steps 8 mm wide, each as wide in pixels as its height makes it.
    let mut column = 10.0;
    let stair: Vec<_> = [0.0, 1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3]
        .map(|height_m| {
            column += 8e-3 / seen(height_m).1;
            (height_m, column as u32)
        })
        .to_vec();
    let mut stair = stair;
    stair[6].1 = WIDTH;
    let path = save(directory.path(), "stair.png", &picture(&stair, 9));
    let sources = [format!("{}=0mm,1mm,2mm,3mm,4mm,5mm,6mm", path.display())];
    let reported = json(&calibrate(&sources, &["--pitch", "8mm", "--json"]));
    assert!(reported["rms_m"].as_f64().unwrap() < 2e-6, "{reported}");
    let lateral_m = reported["lateral_m_per_px"].as_f64().unwrap();
    assert!((lateral_m * FOCAL_PX / OBJECT_DISTANCE_M - 1.0).abs() < 0.01, "{lateral_m}");
}

/// A stripe in the other direction is named, in a picture and in a recording.
#[test]
fn a_stripe_in_the_other_direction_is_named() {
    let directory = tempfile::tempdir().unwrap();
    let stair = picture(&[(0.0, 200), (0.002, 400), (0.005, WIDTH)], 1);
    let turned = image::imageops::rotate90(&stair);
    let file = save(directory.path(), "turned.png", &turned);
    let recording = directory.path().join("turned");
    record_images(&recording, &[image_of_file(&file, 0)]);
    for source in [file, recording] {
        let source = format!("{}=0mm,2mm,5mm", source.display());
        let vertical = ["--gauge-sigma", "1um", "--ros-args", "-p", "stripe_direction:=vertical"];
        json(&calibrate(std::slice::from_ref(&source), &[&["--json"], &vertical[..]].concat()));
        let ended = calibrate(&[source], &["--gauge-sigma", "1um"]);
        assert_eq!(ended.code, Some(1), "{ended:?}");
        assert!(ended.stderr.contains("set stripe_direction: vertical"), "{ended:?}");
    }
}

#[test]
fn unsuitable_heights_are_errors() {
    let directory = tempfile::tempdir().unwrap();
    let sources = four_pictures(directory.path());
    let (black, two) = (GrayImage::new(WIDTH, HEIGHT), picture(&[(0.0, 300), (0.004, WIDTH)], 5));
    let [black, two] = [("black.png", black), ("two.png", two)]
        .map(|(name, picture)| save(directory.path(), name, &picture).display().to_string());
    let small = directory.path().join("small.png");
    GrayImage::from_fn(64, 48, |_, row| Luma([if row.abs_diff(20) < 6 { 200 } else { 0 }]))
        .save(&small)
        .unwrap();
    let with = |more: &str| [&sources[..3], &[more.to_owned()]].concat();
    let three = sources[..2].to_vec();
    for (sources, arguments, code, reported) in [
        (three, &[] as &[&str], 2, "2 different heights"),
        (sources.clone(), &["-o", "x.yaml"], 2, "--lateral"),
        (with(&format!("{two}=4mm")), &[], 2, "2 plateaus"),
        (with(&format!("{two}=4mm,5mm,6mm")), &[], 2, "fewer than 500 pixels"),
        (with(&format!("{black}=4mm")), &[], 1, "no stripe"),
        (with(&format!("{}=4mm", small.display())), &[], 2, "64 x 48"),
        (with("missing.png=4mm"), &[], 1, "missing.png"),
        (with("height.png"), &[], 2, "FILE=HEIGHT"),
        (with("a.png=two"), &[], 2, "2.5mm"),
        (with(&sources[3].replace("=9mm", "=1mm")), &[], 2, "order"),
    ] {
        let ended = calibrate(&sources, arguments);
        assert_eq!(ended.code, Some(code), "{reported}: {ended:?}");
        assert!(ended.stderr.contains(reported), "{reported}: {ended:?}");
    }
}
