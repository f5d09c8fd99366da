//! Tests that the uncertainty of a calibration is true: simulated calibrations, each with its own noise, measure
//! surfaces that are known.
//!
//! Camera and plane of each are estimated from noisy corners and stripes, by the functions behind `calibrate camera` and
//! `calibrate plane`. The surfaces are seen without noise: what is off is off because of the calibration.

mod boards;
mod profiles;
mod rig;
mod surfaces;

use super::*;
use crate::{
    calibrate::{BoardBend, Target},
    simulate::noise::frame_rng,
};
use rig::SimulatedRig;
use surfaces::{FIGURES, Figures};

/// Calibrations of each rig.
const TRIALS: u64 = 40;
/// Root mean square of errors over their standard deviations, which is 1 if these are true: three times its scatter of
/// 0.11 with 40 calibrations, and a little for what few views leave open.
const TRUE_RMS: std::ops::RangeInclusive<f64> = 0.65..=1.35;
/// About 95 % of the errors are within that many standard deviations.
const WITHIN: f64 = 2.2;
/// Fewest of 40 within it: fewer happen once in a hundred draws of 95 %.
const MIN_WITHIN: usize = 35;

/// Errors over stated standard deviations.
struct Trial {
    /// As stated.
    stated: Figures,
    /// If errors of camera, plane and axis were independent.
    independent: Figures,
}

fn trial(rig: &SimulatedRig, number: u64) -> Trial {
    let random = &mut frame_rng(2029, number);
    let target: Target = rig.target().parse().unwrap();
    let camera = rig.calibrated_camera(random);
    let lines = rig.lines(&camera.camera, &target, random);
    let fit = calibrate_plane(&lines, camera.quality.as_ref()).unwrap();
    let found = rig.with_axis(fit.calibration(camera, "laser_plane"), random);
    let mut independent = found.clone();
    independent.plane_quality.as_mut().unwrap().camera_response = None;
    if let Some(quality) = &mut independent.axis_quality {
        quality.camera_response = None;
    }
    Trial { stated: rig.judged(&found), independent: rig.judged(&independent) }
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len() as f64).sqrt()
}

/// The stated uncertainty of every figure is true, and that of the slope along the stripe would not be if errors of
/// camera and plane were independent.
#[expect(clippy::print_stderr, reason = "prints the figures of docs/metrology.md")]
fn assert_true(name: &str, rig: &SimulatedRig) {
    let trials: Vec<_> = (0..TRIALS).map(|number| trial(rig, number)).collect();
    for (at, figure) in FIGURES.into_iter().enumerate() {
        let stated: Vec<_> = trials.iter().map(|trial| trial.stated[at]).collect();
        let independent: Vec<_> = trials.iter().map(|trial| trial.independent[at]).collect();
        let within = stated.iter().filter(|error| error.abs() <= WITHIN).count();
        let [size, other] = [&stated, &independent].map(|errors| rms(errors));
        eprintln!("{name}, {figure}: {size:.2}, {within} within {WITHIN}; independent: {other:.2}");
        assert!(TRUE_RMS.contains(&size), "{name}, {figure}: {size}");
        assert!(within >= MIN_WITHIN, "{name}, {figure}: {within}");
        // An axis of its own adds the direction of the part's frame.
        if figure == FIGURES[0] && rig.axis.is_none() {
            assert!(other > 1.8, "{name}, {figure}: {other}");
        }
    }
}

#[test]
fn the_stated_uncertainty_is_true() {
    assert_true("few views", &SimulatedRig::with_few_views());
}

#[test]
fn with_a_wide_lens_and_a_vertical_stripe_too() {
    assert_true("wide", &SimulatedRig::wide());
}

#[test]
fn with_a_long_lens_and_noise_too() {
    assert_true("long", &SimulatedRig::long());
}

#[test]
fn on_a_turntable_too() {
    assert_true("turntable", &SimulatedRig::with_a_turntable());
}

#[test]
fn the_bend_widens_the_planes_uncertainty() {
    let lines = |rig: &SimulatedRig| {
        let random = &mut frame_rng(2030, 0);
        let camera = rig.calibrated_camera(random).camera;
        rig.lines(&camera, &rig.target().parse().unwrap(), random)
    };
    let more = |lines: &LaserLines, bend: BoardBend| {
        let covariance =
            |bend| calibrate_plane(&LaserLines { bend, ..lines.clone() }, None).unwrap().covariance;
        covariance(Some(bend)) - covariance(None)
    };
    let bent = lines(&SimulatedRig::with_a_bent_board());
    let bend = bent.bend.unwrap();
    let shared = more(&bent, BoardBend { is_shared: true, ..bend });
    assert!(shared.diagonal().min() > 0.0, "{shared:?}");
    // A bend on which the views do not agree: all of the difference that it would make.
    let flat = lines(&SimulatedRig::with_few_views());
    let own = more(&flat, BoardBend { is_shared: false, ..bend });
    assert!(own.diagonal().min() > 0.0 && own.trace() > shared.trace(), "{own:?} {shared:?}");
}
