//! Recordings without a stripe: `replay` counts the frames and names the parameter that mends it.

use std::path::{Path, PathBuf};

use serde_json::Value as Json;
use tempfile::TempDir;

use crate::{
    program::replay,
    recordings::{WIDTH, image_of, picture, real, record_images, render_flat},
};

const FRAMES: u64 = 6;
fn rendered() -> (TempDir, PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let bag = directory.path().join("bag");
    render_flat(FRAMES, &bag);
    (directory, bag)
}

/// Frames without a stripe and the likely reason.
fn without_stripe(bag: &Path, parameters: &[&str]) -> (u64, String, String) {
    let directory = tempfile::tempdir().unwrap();
    let mut arguments = vec!["--ros-args"];
    arguments.extend(parameters.iter().flat_map(|value| ["-p", value]));
    let (summary, stderr) = replay(bag, &directory.path().join("results"), 0, &arguments);
    let found = &summary["without_stripe"];
    let text = |key: &str| found["reasons"][0][key].as_str().unwrap_or_default().to_owned();
    let reason = text("text");
    // The log shows the first such frame, the summary a later one: the figures may differ, the remedy may not.
    if let Some((_, remedy)) = reason.split_once("set ") {
        assert!(stderr.contains("Likely reason: ") && stderr.contains(remedy), "{stderr}");
    }
    eprintln!("{}: {found}", bag.display());
    (found["frames"].as_u64().unwrap(), text("reason"), reason)
}

#[test]
fn the_parameter_that_hides_the_line_is_named() {
    let (_directory, bag) = rendered();
    let cases: [(&[&str], &str, &str); 4] = [
        (&["stripe_direction:=vertical"], "stripe_direction", "stripe_direction: horizontal"),
        (
            &["extraction.segment_threshold:=240.0"],
            "threshold_too_high",
            "extraction.threshold: adaptive",
        ),
        (&["extraction.min_segment_area:=9000"], "min_segment_area", "set it to 200"),
        (&["roi.height:=30"], "roi", "roi.*"),
    ];
    for (parameters, reason, remedy) in cases {
        let (frames, found, text) = without_stripe(&bag, parameters);
        assert_eq!((frames, &*found), (FRAMES, reason), "{text}");
        assert!(text.contains(remedy), "{text}");
    }
    assert_eq!(without_stripe(&bag, &[]).0, 0, "as it should be");
}

/// An automatic exposure that hunts: every other frame is too dark for the threshold, and the last one is white.
#[test]
fn frames_of_a_changing_exposure_have_their_own_reasons() {
    let exposures = [1.0, 0.1, 1.0, 0.1, 1.0, 0.1, 100.0];
    let frames = (0..).zip(exposures).map(|(number, exposure)| {
        let expose = |level: u8| (f64::from(level) * exposure).min(255.0).round() as u8;
        // Higher than a stripe may be wide.
        let mut pixels = picture();
        pixels.resize((WIDTH * 240) as usize, 5);
        let pixels: Vec<u8> = pixels.into_iter().map(expose).collect();
        image_of(&pixels, number, |image| image.height = 240)
    });
    let directory = tempfile::tempdir().unwrap();
    let bag = directory.path().join("bag");
    record_images(&bag, &frames.collect::<Vec<_>>());
    let (summary, stderr) = replay(&bag, &directory.path().join("results"), 0, &[]);
    let found = &summary["without_stripe"];
    // The first, second and fourth are examined.
    assert_eq!((&found["frames"], &found["examined"]), (&4.into(), &3.into()), "{found}");
    let reasons = found["reasons"].as_array().unwrap();
    let named: Vec<_> =
        reasons.iter().map(|of| (of["reason"].as_str().unwrap(), of["frames"].as_u64())).collect();
    assert_eq!(named, [("threshold_too_high", Some(2)), ("saturated", Some(1))], "{found}");
    assert!(stderr.contains("set extraction.threshold: adaptive"), "{stderr}");
    assert!(stderr.contains("shorten the exposure"), "{stderr}");
}

#[test]
fn share_of_saturated_points_and_texture_are_in_the_summary() {
    let (directory, bag) = rendered();
    let (summary, _): (Json, _) = replay(&bag, &directory.path().join("results"), 0, &[]);
    assert_eq!(summary["points_saturated"], 0, "{summary}");
    let noise = summary["sigma_px"]["noise"].as_f64().unwrap();
    assert!(noise > 0.001 && noise < 0.1, "{summary}");
    // Neither speckle nor texture is rendered.
    assert!(summary["sigma_px"]["texture"].as_f64().unwrap() < noise, "{summary}");
}

#[test]
fn recordings_of_the_field() {
    for (name, reason, remedy) in [
        ("mono16_12bit.mcap", "full_scale", "set full_scale: 4095"),
        ("vertical_line.mcap", "stripe_direction", "stripe_direction: vertical"),
        ("auto_exposure.mcap", "threshold_too_high", "set extraction.threshold: adaptive"),
    ] {
        let Some(bag) = real(&format!("cases/nothing_found/{name}")) else { return };
        let (frames, found, text) = without_stripe(&bag, &[]);
        assert!(frames > 0, "{name}");
        assert_eq!(found, reason, "{name}: {text}");
        assert!(text.contains(remedy), "{name}: {text}");
    }
}
