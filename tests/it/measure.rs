//! `measure` and `export` on the results of a recording, and on scans whose geometry is a formula.

use std::path::{Path, PathBuf};

use laser_profiler::{
    bag::{Attachment, Compression, RecordOptions, Recorder, Times, Topic},
    msg::convert::cloud,
    msg::{
        cdr, laser_profiler_msgs::Centerline, qos::QosProfile, schema::Message as _,
        sensor_msgs::PointCloud2,
    },
    scanner::{
        calibration::{Calibration, Projective, StepsQuality},
        scan::{Point, Slice},
    },
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde_json::Value as Json;

use crate::{
    interop,
    program::{Ended, end, laser_profiler, replay},
    recordings::bundled,
};

const WIDTH: usize = 200;
const PITCH_M: f64 = 1e-4;
const SIGMA_M: f64 = 2e-6;

/// A recording of one scan in slices of 50 profiles: 200 x 150 points 0.1 mm apart from (0, 0), noise 2 µm.
fn record(directory: &Path, height_m: impl Fn(f64, f64) -> f64) -> PathBuf {
    record_with(directory, None, height_m)
}

/// The same with a calibration in it.
fn record_with(
    directory: &Path,
    calibration: Option<&Calibration>,
    height_m: impl Fn(f64, f64) -> f64,
) -> PathBuf {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    std::fs::create_dir_all(directory).unwrap();
    let bag = directory.join("results");
    let options = RecordOptions { compression: Compression::None, force: false };
    let mut recorder = Recorder::create(&bag, options).unwrap();
    let qos = QosProfile::reliable(10);
    let topic = Topic::new("/laser_profiler/points", PointCloud2::TYPE, qos);
    let id = recorder.add_topic(&topic).unwrap();
    let topic = Topic::new("/laser_profiler/centerline", Centerline::TYPE, qos);
    let line_id = recorder.add_topic(&topic).unwrap();
    if let Some(calibration) = calibration {
        let attachment = Attachment {
            name: "calibration.yaml".into(),
            media_type: "application/yaml".into(),
            log_time_ns: 0,
            create_time_ns: 0,
            data: calibration.to_yaml().into_bytes(),
        };
        recorder.attach(&attachment).unwrap();
    }
    let mut data = Vec::new();
    let line =
        Centerline { stripe_direction: Centerline::STRIPE_HORIZONTAL, ..Centerline::default() };
    cdr::encode(&line, &mut data).unwrap();
    recorder.write(line_id, Times { log_ns: 0, publish_ns: 0, sequence: 1 }, &data).unwrap();
    for number in 0..3 {
        let points = (0..50 * WIDTH).map(|at| -> Point {
            let x = (at % WIDTH) as f64 * PITCH_M;
            let y = (at / WIDTH + 50 * number) as f64 * PITCH_M;
            let normal: f64 = StandardNormal.sample(&mut random);
            let z = height_m(x, y) + SIGMA_M * normal;
            if z.is_nan() { [f32::NAN; 4] } else { [x as f32, y as f32, z as f32, 0.5] }
        });
        let slice =
            Slice { width: WIDTH as u32, height: 50, points: points.collect(), ..Slice::default() };
        cdr::encode(&cloud::organised("laser_plane", &slice), &mut data).unwrap();
        let times = Times { log_ns: number as i64, publish_ns: number as i64, sequence: 1 };
        recorder.write(id, times, &data).unwrap();
    }
    recorder.finish().unwrap();
    bag
}

fn run(arguments: &[&str]) -> Ended {
    end(&mut laser_profiler(arguments))
}

fn json(arguments: &[&str]) -> Json {
    let ended = run(&[arguments, &["--json"]].concat());
    assert_eq!(ended.code, Some(0), "{ended:?}");
    serde_json::from_str(&ended.stdout).unwrap()
}

/// The ground truth lies within four standard deviations, which do not exceed `sigma`.
fn holds(figure: &Json, truth: f64, sigma: f64) {
    let [value, stated] = ["value", "sigma"].map(|key| figure[key].as_f64().unwrap());
    assert!((value - truth).abs() < 4.0 * stated, "{figure}, {truth}");
    assert!(stated < sigma, "{figure}");
}

#[test]
fn planes_and_steps_have_their_height() {
    let directory = tempfile::tempdir().unwrap();
    let bag = record(directory.path(), |x, y| {
        0.01 * y + if (8e-3..12e-3).contains(&x) { 1e-4 } else { 0.0 }
    });
    let bag = bag.display().to_string();
    let reported = json(&["measure", "step", &bag]);
    holds(&reported["height_m"], 1e-4, 1e-7);
    assert_eq!(reported["profiles_used"], 150);
    let given = json(&["measure", "step", &bag, "--edges", "8mm,12mm", "--region", "0,1mm,1,2mm"]);
    holds(&given["height_m"], 1e-4, 3e-7);
    let reported = json(&["measure", "plane", &bag, "--region", "0,0,7.9mm,1"]);
    holds(&reported["tilt_rad"], 0.01_f64.atan(), 1e-5);
    let scatter = reported["scatter_m"].as_f64().unwrap();
    assert!((scatter / SIGMA_M - 1.0).abs() < 0.05, "{reported}");
    let flatness = reported["flatness_d95_m"]["value"].as_f64().unwrap();
    assert!((flatness / (3.92 * SIGMA_M) - 1.0).abs() < 0.05, "{reported}");
    let text = run(&["measure", "plane", &bag]).stdout;
    assert!(text.contains("flatness D95 %") && text.contains("µm"), "{text}");
}

#[test]
fn spheres_have_their_size_and_distance() {
    let directory = tempfile::tempdir().unwrap();
    let cap = |x: f64, y: f64| {
        let square = 5e-3_f64.powi(2) - (x - 4.5e-3).powi(2) - (y - 7e-3).powi(2);
        if square > 1.2e-5 { square.sqrt() } else { f64::NAN }
    };
    let bag = record(directory.path(), |x, y| {
        let (left, right) = (cap(x, y), cap(x - 1e-2, y));
        if left.is_nan() { right } else { left }
    });
    let bag = bag.display().to_string();
    let regions = ["--region", "0,0,9.5mm,20mm", "--region", "9.6mm,0,20mm,20mm"];
    let reported = json(&[&["measure", "spheres", &bag], &regions[..]].concat());
    holds(&reported["distance_m"], 1e-2, 3e-7);
    holds(&reported["spheres"][0]["radius_m"], 5e-3, 5e-7);
    let reported = json(&["measure", "sphere", &bag, "--region", "0,0,9.5mm,20mm"]);
    holds(&reported["center_x_m"], 4.5e-3, 3e-7);
    let once = run(&["measure", "spheres", &bag, "--region", "0,0,1,1"]);
    assert_eq!(once.code, Some(2), "{once:?}");
}

#[test]
fn a_volume_is_measured_above_its_reference() {
    let directory = tempfile::tempdir().unwrap();
    let bag = record(directory.path(), |x, y| {
        let square = (x - 1e-2).powi(2) + (y - 7e-3).powi(2);
        0.02 * x + if square < 4e-6 { 1e-4 * (1.0 - square / 4e-6) } else { 0.0 }
    });
    let bag = bag.display().to_string();
    let reported = json(&["measure", "volume", &bag, "--region", "7mm,4mm,13mm,10mm"]);
    // A paraboloid has half the volume of its cylinder.
    let truth = 0.5 * 1e-4 * std::f64::consts::PI * 4e-6;
    let [value, sigma] = ["value", "sigma"].map(|key| reported["volume_m3"][key].as_f64().unwrap());
    assert!((value - truth).abs() < 4.0 * sigma + 0.005 * truth, "{reported} {truth}");
    assert!(sigma < 0.01 * truth, "{reported}");
}

/// Heights and a step whose scale has an uncertainty of 1 %.
#[test]
fn the_calibration_has_its_share_in_the_uncertainty() {
    let directory = tempfile::tempdir().unwrap();
    let mut covariance = vec![0.0; 81];
    covariance[4 * 9 + 4] = (2e-6_f64).powi(2);
    let calibration = Calibration::Projective(Box::new(Projective {
        frame_id: "laser_plane".into(),
        width_px: 640,
        height_px: 480,
        homography: [1e-4, 0.0, 0.0, 0.0, 2e-4, 0.0, 0.0, 0.0, 1.0],
        quality: Some(StepsQuality {
            rms_m: 0.0,
            heights_used: 5,
            covariance,
            volume: None,
            bow: None,
        }),
        calibrated_at: None,
    }));
    let step = |x: f64, _| if (8e-3..12e-3).contains(&x) { 1e-4 } else { 0.0 };
    let bag = record_with(directory.path(), Some(&calibration), step).display().to_string();
    let reported = json(&["measure", "step", &bag]);
    let figure = |key: &str| reported["height_m"][key].as_f64().unwrap();
    assert!((figure("sigma_calibration") / 1e-6 - 1.0).abs() < 1e-3, "{reported}");
    assert!(figure("sigma") > 1e-6 && figure("u95") > 1.95e-6, "{reported}");
    assert!(run(&["measure", "step", &bag]).stdout.contains("calibration 1.000"));
    let without = record(&directory.path().join("without"), step).display().to_string();
    let reported = json(&["measure", "step", &without]);
    assert!(reported["height_m"]["sigma_calibration"].is_null(), "{reported}");
    assert!(
        reported["calibration_unknown"].as_str().unwrap().contains("no calibration"),
        "{reported}"
    );
}

#[test]
fn unmeasurable_input_is_an_error() {
    let directory = tempfile::tempdir().unwrap();
    let bag = record(directory.path(), |x, _| 0.02 * x);
    let bag = bag.display().to_string();
    let film = bundled("film_defects").display().to_string();
    let out = |name: &str| directory.path().join(name).display().to_string();
    for (arguments, code, reported) in [
        (vec!["measure", "plane", &film], 1, "no point clouds"),
        (
            vec!["measure", "plane", &bag, "--region", "1,1,2,2"],
            1,
            "no point was measured in the region",
        ),
        (vec!["measure", "plane", &bag, "--region", "0,0,0.2mm,0.2mm"], 1, "20 or more"),
        (vec!["measure", "plane", &bag, "--region", "0,0,1"], 2, "x0,y0,x1,y1"),
        (vec!["measure", "sphere", &bag], 1, "a sphere"),
        (vec!["measure", "step", &bag], 1, "no ridge or groove"),
        (vec!["measure", "plane", &bag, "--scan", "3"], 2, "--scan"),
        (vec!["measure", "plane", &bag, "--topic", "/other"], 2, "/laser_profiler/points"),
        (vec!["export", &bag, "-o", &out("scan.obj")], 2, ".ply, .pcd, .csv, .png or .tif"),
        (vec!["export", &bag], 2, "--output"),
        (vec!["export", &bag, "-o", &out("a.png"), "--cell", "1nm"], 1, "choose cells of"),
        (vec!["export", &bag, "-o", &out("a.ply"), "--region", "5,5,6,6"], 1, "no measured point"),
        (vec!["export", &bag, "-o", "/nowhere/a.ply"], 1, "/nowhere/a.ply"),
    ] {
        let ended = run(&arguments);
        assert_eq!(ended.code, Some(code), "{reported}: {ended:?}");
        assert!(ended.stderr.contains(reported), "{reported}: {ended:?}");
    }
    assert!(!Path::new(&out("a.ply")).exists() && !Path::new(&out("a.png")).exists());
}

#[test]
fn a_truncated_recording_is_measured_and_reported() {
    let directory = tempfile::tempdir().unwrap();
    let bag = record(directory.path(), |x, _| 0.02 * x);
    let file = bag.join("results_0.mcap");
    let bytes = std::fs::read(&file).unwrap();
    std::fs::write(&file, &bytes[..bytes.len() * 9 / 10]).unwrap();
    let ended = run(&["measure", "plane", &bag.display().to_string(), "--json"]);
    assert!(matches!(ended.code, Some(0 | 3)), "{ended:?}");
    let reported: Json = serde_json::from_str(&ended.stdout).unwrap();
    assert!(reported["profiles"].as_u64().unwrap() < 150, "{reported}");
    holds(&reported["tilt_rad"], 0.02_f64.atan(), 1e-5);
}

/// Exported files of a real chain of results, opened by third-party readers.
#[test]
fn third_party_readers_open_exported_files() {
    let Some(python) = interop::python() else { return };
    let directory = tempfile::tempdir().unwrap();
    let results = directory.path().join("results");
    replay(
        &bundled("film_defects"),
        &results,
        3,
        &["--params-file", "bags/film_defects.params.yaml"],
    );
    let mut command = laser_profiler(&["export"]);
    command.arg(&results).args(["--color", "height", "--cell", "0.4mm"]);
    for ending in ["ply", "pcd", "csv", "png", "tif"] {
        command.arg("-o").arg(directory.path().join(format!("scan.{ending}")));
    }
    let ended = end(command.arg("--picture").arg(directory.path().join("picture.png")));
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert!(image::open(directory.path().join("picture.png")).unwrap().width() > 500);
    let mut check = std::process::Command::new(python);
    check.arg(interop::interop("check_export.py")).arg(&results).arg("/laser_profiler/points");
    let ended = end(check.arg(directory.path()));
    assert_eq!(ended.code, Some(0), "{}\n{}", ended.stdout, ended.stderr);
}

#[test]
fn filled_cells_are_flagged_and_a_level_scan_has_height_0() {
    let directory = tempfile::tempdir().unwrap();
    let bag = record(directory.path(), |x, _| {
        if (8e-3..8.3e-3).contains(&x) { f64::NAN } else { 0.05 * x + 1e-3 }
    });
    let file = directory.path().join("map.png");
    let (bag, output) = (bag.display().to_string(), file.display().to_string());
    let reported = json(&["export", &bag, "-o", &output, "--fill", "6", "--level"]);
    assert!(reported["files"][0]["filled"].as_u64().unwrap() > 100, "{reported}");
    let mask = image::open(directory.path().join("map.png.mask.png")).unwrap().to_luma8();
    let count = |state: u8| mask.pixels().filter(|pixel| pixel.0[0] == state).count() as u64;
    assert_eq!(reported["files"][0]["filled"], count(2));
    assert_eq!(reported["files"][0]["measured"], count(1));
    let [low, high] = ["from_m", "to_m"].map(|key| reported[key][2].as_f64().unwrap());
    assert!(low > -20e-6 && high < 20e-6, "{reported}");
    let flat = ["--level-on", "0,0,5mm,5mm", "--force"];
    let reported = json(&[&["export", &bag, "-o", &output][..], &flat].concat());
    assert!(reported["to_m"][2].as_f64().unwrap().abs() < 40e-6, "{reported}");
    let again = run(&["export", &bag, "-o", &output]);
    assert!(again.code == Some(1) && again.stderr.contains("--force"), "{again:?}");
}
