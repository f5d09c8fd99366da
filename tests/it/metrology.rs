//! Rendered gauges through the whole chain with the commands that users have: simulate, calibrate, replay, measure. The
//! ground truth is in the scenarios of `tests/data/metrology`; `docs/metrology.md` has the results.

use std::path::{Path, PathBuf};

use laser_profiler::{
    bag::{BagReader, Filter, ReadOptions},
    msg::{cdr, laser_profiler_msgs::Profile},
};
use serde_json::Value as Json;

use crate::program::{end, laser_profiler};

const STEP_M: f64 = 100e-6;
const HEIGHT_RANGE_M: f64 = 0.030;
const SPHERES_APART_M: f64 = 0.050;
/// Width, in standard deviations, of the band that contains 95 % of normal deviates.
const D95_SIGMAS: f64 = 3.92;

fn data(name: &str) -> String {
    format!("tests/data/metrology/{name}")
}

/// Runs a command, which must succeed; returns its standard output.
fn run(arguments: &[&str]) -> String {
    let ended = end(&mut laser_profiler(arguments));
    assert_eq!(ended.code, Some(0), "{arguments:?}: {ended:?}");
    ended.stdout
}

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Renders a scenario into a directory; returns the path of the recording.
fn simulate(directory: &Path, name: &str) -> PathBuf {
    let bag = directory.join(name);
    run(&["simulate", &data(&format!("{name}.scenario.yaml")), "-o", path(&bag)]);
    bag
}

/// Results of a replay with a calibration.
fn scan(directory: &Path, name: &str, calibration: Option<&Path>) -> PathBuf {
    let bag = simulate(directory, name);
    let results = directory.join(format!("{name}_results"));
    let params = data(if name == "spheres" { "replay_spheres.yaml" } else { "replay_scan.yaml" });
    // By default the true calibration, which is stored beside the recording.
    let own = bag.join("calibration.yaml");
    let file = format!("calibration_file:={}", path(calibration.unwrap_or(&own)));
    let arguments = ["replay", path(&bag), "-o", path(&results), "--params-file", &params];
    run(&[&arguments[..], &["--ros-args", "-p", &file]].concat());
    results
}

fn measure(tool: &str, results: &Path, regions: &[&str]) -> Json {
    let mut arguments = vec!["measure", tool, path(results), "--json"];
    for region in regions {
        arguments.extend(["--region", region]);
    }
    serde_json::from_str(&run(&arguments)).unwrap()
}

fn value(figure: &Json) -> f64 {
    figure["value"].as_f64().unwrap_or_else(|| panic!("{figure}"))
}

/// One standard deviation of the heights as the noise of the images explains it: the median of all points, metres.
fn noise_m(results: &Path) -> f64 {
    let reader = BagReader::open(results, &ReadOptions::default()).unwrap();
    let mut sigmas = Vec::new();
    for message in reader.messages(&Filter::topics(["/laser_profiler/profile"])) {
        let message = message.unwrap();
        let profile: Profile<'_> = cdr::decode(&message.data).unwrap();
        sigmas.extend(profile.sigma_z.iter().copied().filter(|sigma| sigma.is_finite()));
    }
    assert!(sigmas.len() > 1000);
    sigmas.sort_by(f32::total_cmp);
    f64::from(sigmas[sigmas.len() / 2])
}

/// Errors of the whole chain on the gauges.
#[derive(Debug)]
struct Judged {
    /// Measured less true depth of the groove, metres.
    step_error_m: f64,
    /// Flatness D95 % relative to that explained by noise.
    flatness_ratio: f64,
    /// Largest departure of a plateau from the best straight line, as a share of the range.
    linearity: f64,
    /// Error of the height of one metre, metres.
    scale: f64,
    /// Relative error of the distance of the spheres.
    distance: f64,
    /// Largest form D95 % of a sphere relative to that explained by noise.
    form_ratio: f64,
}

fn judge(calibration: Option<&Path>) -> Judged {
    let directory = tempfile::tempdir().unwrap();
    let scan = |name| scan(directory.path(), name, calibration);
    let step = measure("step", &scan("step"), &["-30mm,0,30mm,25mm"]);
    let flat = scan("flat");
    let flatness = value(&measure("plane", &flat, &[])["flatness_d95_m"]);
    let (linearity, scale) = heights(&scan("stairs"));
    let spheres = scan("spheres");
    let apart = measure("spheres", &spheres, &["-32mm,3mm,-18mm,17mm", "18mm,3mm,32mm,17mm"]);
    let form = |sphere: &Json| value(&sphere["form_d95_m"]) / (D95_SIGMAS * noise_m(&spheres));
    let judged = Judged {
        step_error_m: value(&step["height_m"]).abs() - STEP_M,
        flatness_ratio: flatness / (D95_SIGMAS * noise_m(&flat)),
        linearity,
        scale,
        distance: value(&apart["distance_m"]) / SPHERES_APART_M - 1.0,
        form_ratio: form(&apart["spheres"][0]).max(form(&apart["spheres"][1])),
    };
    eprintln!("{judged:#?}");
    judged
}

/// Deviation from a straight line, and scale error, of seven plateaus, each 5 mm above the previous one,
/// on a gauge that rises by 0.01 along x and by 0.02 along y.
fn heights(results: &Path) -> (f64, f64) {
    let errors: Vec<[f64; 2]> = (0..7)
        .map(|number| {
            let middle_m = 0.015 * (f64::from(number) - 3.0);
            let region = format!("{},0,{},0.02", middle_m - 0.004, middle_m + 0.004);
            let plane = measure("plane", results, &[&region]);
            let [x_m, y_m, z_m] = [0, 1, 2].map(|axis| plane["center_m"][axis].as_f64().unwrap());
            let true_m = 0.005 * f64::from(number) + 0.01 * x_m + 0.02 * y_m;
            [true_m, z_m - true_m]
        })
        .collect();
    let mean = |axis: usize| errors.iter().map(|error| error[axis]).sum::<f64>() / 7.0;
    let (height_m, error_m) = (mean(0), mean(1));
    let spread: f64 = errors.iter().map(|error| (error[0] - height_m).powi(2)).sum();
    let together: f64 =
        errors.iter().map(|error| (error[0] - height_m) * (error[1] - error_m)).sum();
    let scale = together / spread;
    let off_m =
        errors.iter().map(|[true_m, z_m]| (z_m - error_m - scale * (true_m - height_m)).abs());
    (off_m.fold(0.0, f64::max) / HEIGHT_RANGE_M, scale)
}

/// Errors with a perfect calibration: those of extraction, triangulation and the measuring tools.
#[test]
fn gauges_are_measured_correctly_with_the_true_calibration() {
    let judged = judge(None);
    assert!(judged.step_error_m.abs() < 0.3e-6, "{judged:?}");
    assert!(judged.flatness_ratio < 1.2, "{judged:?}");
    assert!(judged.form_ratio < 1.2, "{judged:?}");
    assert!(judged.linearity < 1e-5 && judged.scale.abs() < 1e-5, "{judged:?}");
    assert!(judged.distance.abs() < 1e-5, "{judged:?}");
}

/// Boards, then gauges: nothing is known but the size of the squares.
#[cfg(feature = "calibrate")]
#[test]
fn gauges_are_measured_correctly_with_a_calibration_from_boards() {
    let directory = tempfile::tempdir().unwrap();
    let [camera, rig] = ["camera.yaml", "rig.yaml"].map(|name| directory.path().join(name));
    let boards = simulate(directory.path(), "boards");
    let target = ["--target", "checkerboard:8x6:0.003"];
    run(&[&["calibrate", "camera", path(&boards), "-o", path(&camera)], &target[..]].concat());
    let lines = simulate(directory.path(), "boards_with_line");
    let plane = ["calibrate", "plane", path(&lines), "--camera", path(&camera), "-o", path(&rig)];
    run(&[&plane[..], &target[..]].concat());
    let judged = judge(Some(&rig));
    assert!(judged.step_error_m.abs() < 2e-6, "{judged:?}");
    assert!(judged.flatness_ratio < 1.5, "{judged:?}");
    assert!(judged.form_ratio < 1.5, "{judged:?}");
    assert!(judged.linearity < 2e-4, "{judged:?}");
    assert!(judged.distance.abs() < 1e-4, "{judged:?}");
}
