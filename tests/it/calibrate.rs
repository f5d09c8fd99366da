//! `laser_profiler calibrate camera`, `plane` and `axis`: on rendered boards and markers whose truth is known, on bad input,
//! and on real recordings.

mod axis;
mod camera;
mod charuco;
mod circles;
mod fisheye;
mod hard_boards;
mod plane;
mod real;
mod render;
mod warped_boards;

use std::path::Path;

use serde_json::Value as Json;

use crate::program::{Ended, end, laser_profiler};

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

/// Returns the reason why the view whose name contains `view` was not used.
fn reason(json: &Json, view: &str) -> String {
    let all = json["views_rejected"].as_array().unwrap();
    let found = all.iter().find(|one| one["view"].as_str().unwrap().contains(view));
    found.unwrap_or_else(|| panic!("{view} in {all:?}"))["reason"].as_str().unwrap().to_owned()
}
