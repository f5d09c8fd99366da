//! The camera, from rendered boards.

use std::{fs, path::Path};

use image::{DynamicImage, imageops};
use laser_profiler::scanner::calibration::CameraCalibration;
use tempfile::TempDir;

use super::{
    calibrate, number, reason, refused,
    render::{self, Checkerboard, Renderer, VIEWS, pose, save},
    run,
};

const BOARD: Checkerboard = Checkerboard { columns: 8, rows: 5, square_m: 0.03 };
const CAMERA: [&str; 3] = ["camera", "--target", "checkerboard:8x5:0.030"];

fn rendered(views: &[[[f64; 3]; 2]]) -> TempDir {
    let directory = tempfile::tempdir().unwrap();
    let renderer = Renderer::new();
    for (i, &[middle, turned]) in views.iter().enumerate() {
        let picture = renderer.render(&BOARD, &pose(&BOARD, middle, turned), None);
        save(&picture, directory.path(), &format!("view_{i:02}.png"));
    }
    directory
}

#[test]
fn a_rendered_camera_is_found_again_beside_bad_pictures() {
    let pictures = rendered(&VIEWS);
    let at = |name: &str| pictures.path().join(name);
    let good = image::open(at("view_05.png")).unwrap();
    DynamicImage::new_luma8(480, 360).save(at("x_dark.png")).unwrap();
    good.resize_exact(240, 180, imageops::FilterType::Triangle).save(at("x_half.png")).unwrap();
    good.blur(12.0).save(at("x_blurred.png")).unwrap();
    // A board that is bent: its right half is seen somewhere else.
    let mut bent = good.to_rgb8();
    let right = imageops::crop_imm(&bent, 240, 0, 240, 360).to_image();
    imageops::replace(&mut bent, &right, 240, 3);
    bent.save(at("x_bent.png")).unwrap();

    let results = tempfile::tempdir().unwrap();
    let (output, report) = (results.path().join("camera.yaml"), results.path().join("report.png"));
    let report_flag = ["--report", report.to_str().unwrap()];
    let found = calibrate(&[&CAMERA[..], &report_flag].concat(), pictures.path(), &output);
    assert_eq!(found["views_used"], 12, "{found}");
    assert!(number(&found, "rms_px") < 0.08, "{found}");
    let truth = render::camera();
    for (name, wanted) in
        [("fx", truth.fx_px), ("fy", truth.fy_px), ("cx", truth.cx_px), ("cy", truth.cy_px)]
    {
        let off = number(&found["intrinsics"], name) - wanted;
        let sigma = number(&found["uncertainties"], name);
        assert!(off.abs() < 1.0 && sigma < 2.0, "{name}: {off} ± {sigma}");
    }
    assert!((number(&found["distortion"], "k1") + 0.12).abs() < 0.02, "{found}");
    assert!(reason(&found, "x_dark").contains("no board"));
    assert!(reason(&found, "x_half").contains("240 x 180"));
    assert!(!reason(&found, "x_blurred").is_empty());
    assert!(!reason(&found, "x_bent").is_empty());
    assert_eq!(image::open(&report).unwrap().width(), 1280);

    let read = CameraCalibration::from_yaml(&fs::read_to_string(&output).unwrap()).unwrap();
    assert!((read.camera.fx_px - number(&found["intrinsics"], "fx")).abs() < 1e-9);
    assert_eq!((read.camera.width_px, read.camera.height_px), (480, 360));

    // Nothing is overwritten without --force, and the same pictures give the same numbers.
    let again = run(&CAMERA, pictures.path(), &output);
    assert!(again.code == Some(1) && again.stderr.contains("--force"), "{again:?}");
    let forced = calibrate(&[&CAMERA[..], &["--force"]].concat(), pictures.path(), &output);
    assert_eq!(forced["intrinsics"], found["intrinsics"]);
}

#[test]
fn a_mirrored_camera_is_calibrated_as_seen() {
    let pictures = rendered(&VIEWS);
    for (i, _) in VIEWS.iter().enumerate() {
        let path = pictures.path().join(format!("view_{i:02}.png"));
        image::open(&path).unwrap().fliph().save(&path).unwrap();
    }
    let found = calibrate(&CAMERA, pictures.path(), &pictures.path().join("camera.yaml"));
    let wanted = f64::from(render::camera().width_px - 1) - render::camera().cx_px;
    assert!((number(&found["intrinsics"], "cx") - wanted).abs() < 1.0, "{found}");
}

/// The rendered lens has a narrow view, which does not determine a model with many terms:
/// that is reported; the usual model is not.
#[test]
fn undetermined_lens_terms_are_reported() {
    let pictures = rendered(&VIEWS);
    let output = pictures.path().join("camera.yaml");
    let model = ["--model", "rational_polynomial", "--force"];
    let wide = run(&[&CAMERA[..], &model].concat(), pictures.path(), &output);
    if wide.code == Some(1) {
        // The same is reported without any covariance.
        assert!(wide.stderr.contains("do not determine"), "{wide:?}");
    } else {
        assert!(
            wide.stderr.contains("--model plumb_bob") && wide.stdout.contains("k6"),
            "{wide:?}"
        );
    }
    let usual = run(&[&CAMERA[..], &["--force"]].concat(), pictures.path(), &output);
    assert!(usual.code == Some(0) && !usual.stderr.contains("narrow"), "{usual:?}");
}

#[test]
fn damaged_pictures_are_data_lost() {
    let pictures = rendered(&VIEWS);
    let whole = fs::read(pictures.path().join("view_00.png")).unwrap();
    fs::write(pictures.path().join("cut.png"), &whole[..whole.len() / 2]).unwrap();
    let ended = run(&CAMERA, pictures.path(), &pictures.path().join("camera.yaml"));
    assert_eq!(ended.code, Some(3), "{ended:?}");
    assert!(ended.stdout.contains("cut.png"), "{ended:?}");
}

fn refused_views(views: &[[[f64; 3]; 2]], reported: &[&str]) {
    let pictures = rendered(views);
    refused(&CAMERA, pictures.path(), &pictures.path().join("camera.yaml"), reported);
}

#[test]
fn too_few_views_are_refused() {
    refused_views(&VIEWS[..3], &["usable views: 3", "20 are good"]);
}

#[test]
fn parallel_boards_are_refused() {
    let flat = VIEWS.map(|[middle, [_, _, z]]| [middle, [12.0, 8.0, z]]);
    refused_views(&flat, &["parallel", "tilt the board by 20 to 40 degrees"]);
}

#[test]
fn boards_tilted_about_one_axis_only_are_refused() {
    let one_way = VIEWS.map(|[middle, [_, y, z]]| [middle, [0.0, 1.3 * y, 0.2 * z]]);
    refused_views(&one_way, &["horizontal axis", "forwards and backwards"]);
}

#[test]
fn boards_in_one_part_of_the_image_are_refused() {
    let corner = VIEWS.map(|[[x, y, _], turned]| [[-0.5 + x, -0.38 + y, 1.5], turned]);
    refused_views(&corner, &["no view has corners of the board in these parts", "bottom right"]);
}

#[test]
fn a_board_other_than_the_target_is_refused() {
    let pictures = rendered(&VIEWS[..6]);
    let output = pictures.path().join("camera.yaml");
    let with = |target: &str, reported: &[&str]| {
        refused(&["camera", "--target", target], pictures.path(), &output, reported);
    };
    with("checkerboard:7x5:0.030", &["larger board", "8 x 5"]);
    with("checkerboard:9x6:0.030", &["no picture shows the whole board", "8 x 5"]);
    with("checkerboard:8x5", &["checkerboard:8x6:0.040"]);
}

#[test]
fn a_directory_without_pictures_is_refused() {
    let empty = tempfile::tempdir().unwrap();
    refused(&CAMERA, empty.path(), &empty.path().join("camera.yaml"), &["nor pictures"]);
    let nowhere = Path::new("/nowhere/pictures");
    refused(&CAMERA, nowhere, &empty.path().join("camera.yaml"), &["/nowhere/pictures"]);
}
