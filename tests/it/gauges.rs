//! `calibrate steps` with tilted lines, drifting beds, unknown orders, stated uncertainties, and the volume it states.

use std::path::{Path, PathBuf};

use image::{GrayImage, Luma};
use laser_profiler::scanner::{
    calibration::{Calibration, Lines},
    params::StripeDirection,
    profile::Profile,
    stripe::{Centerline, flag},
};
use serde_json::Value as Json;

use crate::program::{Ended, end, laser_profiler};

const SIZE: [u32; 2] = [640, 480];
const PX_PER_M: f64 = 6200.0;

/// A line on three flats, the middle one higher; it runs along the columns, tilted in the picture.
#[derive(Clone, Copy)]
struct Rig {
    /// Rows by which the line falls from the left to the right end.
    tilt_px: f64,
    is_vertical: bool,
}

impl Rig {
    /// Position across the stripe of a height at a position along it: a camera far away.
    fn across_px(self, along_px: f64, height_m: f64) -> f64 {
        280.0 - PX_PER_M * height_m + self.tilt_px * (along_px / self.length_px() - 0.5)
    }

    fn length_px(self) -> f64 {
        f64::from(SIZE[usize::from(self.is_vertical)])
    }

    fn picture(self, flats_m: [f64; 3]) -> GrayImage {
        GrayImage::from_fn(SIZE[0], SIZE[1], |column, row| {
            let (along, across) = if self.is_vertical { (row, column) } else { (column, row) };
            let third = (3.0 * f64::from(along) / self.length_px()) as usize;
            let from_middle =
                f64::from(across) - self.across_px(f64::from(along), flats_m[third.min(2)]);
            let level = 10.0 + 200.0 * (-from_middle.powi(2) / 8.0).exp();
            Luma([level.round() as u8])
        })
    }

    fn save(self, directory: &Path, name: &str, flats_m: [f64; 3]) -> PathBuf {
        let path = directory.join(name);
        self.picture(flats_m).save(&path).unwrap();
        path
    }

    fn calibrate(self, sources: &[String], arguments: &[&str]) -> Ended {
        let direction = if self.is_vertical { "vertical" } else { "horizontal" };
        let mut command = laser_profiler(&["calibrate", "steps"]);
        command.args(sources).args(arguments);
        end(command.args(["--ros-args", "-p", &format!("stripe_direction:={direction}")]))
    }

    /// Heights and flags that a calibration file gives the places (along, height).
    fn measured(self, file: &Path, places: &[(f64, f64)]) -> Vec<(f64, u8)> {
        let text = std::fs::read_to_string(file).unwrap();
        let calibration = Calibration::from_yaml(&text).unwrap();
        let direction =
            if self.is_vertical { StripeDirection::Vertical } else { StripeDirection::Horizontal };
        let along: Vec<f32> = places.iter().map(|(along, _)| *along as f32).collect();
        let across: Vec<f32> = places
            .iter()
            .map(|(along, height_m)| self.across_px(*along, *height_m) as f32)
            .collect();
        let num = places.len();
        let (u_px, v_px) = if self.is_vertical { (across, along) } else { (along, across) };
        let line = Centerline {
            u_px,
            v_px,
            intensity: vec![1.0; num],
            sigma_px: vec![0.1; num],
            flags: vec![0; num],
            ..Centerline::default()
        };
        let mut profile = Profile::default();
        let lines = Lines { direction, first: 0, count: self.length_px() as usize };
        calibration.triangulate(&line, &lines, 255, &mut profile);
        let at = |(along, _): &(f64, f64)| {
            (f64::from(profile.z_m[*along as usize]), profile.flags[*along as usize])
        };
        places.iter().map(at).collect()
    }
}

fn json(ended: &Ended) -> Json {
    assert_eq!(ended.code, Some(0), "{ended:?}");
    serde_json::from_str(&ended.stdout).unwrap()
}

const RIGS: [Rig; 4] = [
    Rig { tilt_px: 2.0, is_vertical: true },
    Rig { tilt_px: -2.6, is_vertical: false },
    Rig { tilt_px: 8.0, is_vertical: false },
    Rig { tilt_px: 0.0, is_vertical: false },
];

const ONE_M: [f64; 3] = [0.0, 3.68e-3, 0.0];
const OTHER_M: [f64; 3] = [0.2e-3, 9.14e-3, 0.2e-3];

/// The same two pictures as sources with heights.
fn sources(directory: &Path, rig: Rig, heights: [&str; 2]) -> Vec<String> {
    let one = rig.save(directory, "one.png", ONE_M);
    let other = rig.save(directory, "other.png", OTHER_M);
    [(one, heights[0]), (other, heights[1])]
        .map(|(path, heights)| format!("{}={heights}", path.display()))
        .to_vec()
}

/// Heights 0.2 mm apart lie closer together than the tilt of the line, in one order or another.
#[test]
fn a_tilted_line_calibrates_whatever_the_order_of_the_heights() {
    for rig in RIGS {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("rig.yaml");
        let output = file.display().to_string();
        let in_order = ["0mm,3.68mm,0mm", "0.2mm,9.14mm,0.2mm"];
        let as_sets = ["0mm,0mm,3.68mm", "9.14mm,0.2mm,0.2mm"];
        for (heights, more) in [
            (in_order, &["--terms", "both"] as &[&str]),
            (in_order, &[]),
            (as_sets, &["--any-order"]),
            (as_sets, &["--any-order", "--height-sign", "-1"]),
        ] {
            let sources = sources(directory.path(), rig, heights);
            let arguments =
                [more, &["--lateral", "160um", "-o", &output, "--force", "--json"]].concat();
            let reported = json(&rig.calibrate(&sources, &arguments));
            assert!(reported["rms_m"].as_f64().unwrap() < 2e-6, "{reported}");
            let places = [(100.0, 0.5e-3), (300.0, 3e-3), (400.0, 8e-3)];
            for ((height_m, flags), (_, truth_m)) in
                rig.measured(&file, &places).into_iter().zip(places)
            {
                assert!((height_m - truth_m).abs() < 3e-6, "{height_m} {truth_m} {heights:?}");
                assert_eq!(flags, 0, "inside the gauge");
            }
        }
    }
}

/// The bed of the second picture lies 0.2 mm higher, which nobody stated.
#[test]
fn only_differences_within_a_picture_count_if_the_bed_drifts() {
    for rig in RIGS {
        let directory = tempfile::tempdir().unwrap();
        let sources = sources(directory.path(), rig, ["0mm,3.68mm±1um,0mm", "0mm,9.14mm+-1um,0mm"]);
        let reported = json(&rig.calibrate(&sources, &["--differences", "--json"]));
        let drift_m = reported["offsets_m"][1].as_f64().unwrap();
        // The perspective is known as well as the two blocks are.
        assert!((drift_m - 0.2e-3).abs() < 8e-6, "{reported}");
        let wrong = rig.calibrate(&sources, &["--json"]);
        let excess = json(&wrong)["excess"].as_f64();
        assert!(excess.is_some_and(|excess| excess > 5.0), "{wrong:?}");
        let unknown: Vec<_> =
            sources.iter().map(|s| s.replace("±1um", "").replace("+-1um", "")).collect();
        let refused = rig.calibrate(&unknown, &["--differences"]);
        assert_eq!(refused.code, Some(2), "{refused:?}");
        assert!(refused.stderr.contains("--gauge-sigma"), "{refused:?}");
    }
}

/// Three heights fit exactly: what they are worth must be stated, and they count only where they were.
#[test]
fn three_heights_need_a_stated_gauge_and_state_their_volume() {
    for rig in RIGS {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("rig.yaml");
        let output = file.display().to_string();
        let path = rig.save(directory.path(), "three.png", [0.0, 6e-3, 3e-3]);
        let exact = format!("{}=0mm,6mm,3mm", path.display());
        let scaled = ["--lateral", "160um", "-o", &output, "--json"];
        let refused = rig.calibrate(std::slice::from_ref(&exact), &scaled);
        assert_eq!(refused.code, Some(2), "{refused:?}");
        assert!(refused.stderr.contains("uncertainty of the gauge"), "{refused:?}");
        assert!(!file.exists(), "nothing is written");
        let stated = [&scaled[..], &["--gauge-sigma", "5um"]].concat();
        let reported = json(&rig.calibrate(&[exact], &stated));
        assert_eq!(reported["degrees_of_freedom"], 0, "{reported}");
        assert!(reported["u95_m"].as_f64().unwrap() > 8e-6, "{reported}");
        let places = [(100.0, 1e-3), (240.0, 5e-3), (400.0, 12e-3), (300.0, -3e-3)];
        let outside = rig.measured(&file, &places).into_iter().map(|(_, flags)| flags);
        let expected = [0, 0, flag::OUTSIDE_CALIBRATION, flag::OUTSIDE_CALIBRATION];
        assert_eq!(outside.collect::<Vec<_>>(), expected);
    }
}
