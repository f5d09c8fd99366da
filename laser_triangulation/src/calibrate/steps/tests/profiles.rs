//! Tests that profiles state the calibration's share in their heights truly, within the gauge and far beyond it.

use super::{
    super::coverage::{CALIBRATIONS, Case, GAUGE_SIGMA_M, Stated, WHOLE, calibrated},
    *,
};
use crate::scanner::{
    calibration::{Lines, Triangulator},
    profile::Profile,
    stripe::{Centerline, flag},
};

/// Where points are measured: x and z, metres.
const INSIDE_M: [[f64; 2]; 4] = [[-0.006, 0.0005], [0.0, 0.004], [0.004, 0.008], [0.006, 0.0115]];
/// Above and below the gauge of 12 mm.
const OUTSIDE_M: [[f64; 2]; 4] = [[0.0, -0.012], [0.0, -0.006], [0.004, 0.018], [0.0, 0.026]];

/// A measured height: its error and its stated standard deviation, metres.
struct Judged {
    error_m: f64,
    sigma_m: f64,
}

/// Returns the heights of points as a calibration measures them, and checks which carry the flag of extrapolation.
fn judged<const N: usize>(case: &Case<'_>, seed: u64, points_m: &[[f64; 2]; N]) -> [Judged; N] {
    let (pinhole, calibration) = calibrated(case, seed);
    let mut triangulator = Triangulator::new(calibration);
    let direction = StripeDirection::Horizontal;
    triangulator.prepare(direction, PICTURE.size_px.into());
    points_m.each_ref().map(|[x_m, z_m]| {
        let [column, row] = pinhole.see(*x_m, *z_m).map(|px| px as f32);
        let centerline = Centerline {
            u_px: vec![column],
            v_px: vec![row],
            intensity: vec![100.0],
            sigma_px: vec![0.0],
            flags: vec![0],
            ..Centerline::default()
        };
        let lines = Lines { direction, first: column as usize, count: 1 };
        let mut profile = Profile::default();
        triangulator.triangulate(&centerline, &lines, 255, &mut profile);
        let is_outside = !(0.0..=0.012).contains(z_m);
        assert_eq!(profile.flags[0] & flag::OUTSIDE_CALIBRATION != 0, is_outside, "{z_m}");
        Judged {
            error_m: f64::from(profile.z_m[0]) - z_m,
            sigma_m: f64::from(profile.calibration_sigma_z_m[0]),
        }
    })
}

/// Returns the root mean square of errors over their stated standard deviations at each point, and the stated ones
/// themselves, over `GAUGE_SIGMA_M`.
#[expect(clippy::print_stderr, reason = "prints the figures of docs/metrology.md")]
fn figures<const N: usize>(name: &str, case: &Case<'_>, points_m: &[[f64; 2]; N]) -> [[f64; 2]; N] {
    let all: Vec<_> = (0..CALIBRATIONS).map(|seed| judged(case, seed, points_m)).collect();
    let rms = |values: &dyn Fn(&Judged) -> f64, at: usize| {
        let squares = all.iter().map(|points| values(&points[at]).powi(2));
        (squares.sum::<f64>() / all.len() as f64).sqrt()
    };
    let found = std::array::from_fn(|at| {
        let ratio = rms(&|point| point.error_m / point.sigma_m, at);
        [ratio, rms(&|point| point.sigma_m, at) / GAUGE_SIGMA_M]
    });
    for ([ratio, sigma], [x_m, z_m]) in found.iter().zip(points_m) {
        let [x_mm, z_mm] = [1e3 * x_m, 1e3 * z_m];
        eprintln!("{name}, x {x_mm:.1} mm, z {z_mm:.1} mm: {ratio:.2}, stated {sigma:.1} gauges");
    }
    found
}

fn assert_true(name: &str, found: &[[f64; 2]]) {
    for [ratio, _] in found {
        assert!((0.8..=1.25).contains(ratio), "{name}: {ratio}");
    }
}

#[test]
fn heights_within_the_gauge_are_as_uncertain_as_stated() {
    let blocks: [Stated<'_>; 3] = [&[0.0, 0.012, 0.0], &[0.0, 0.004, 0.0], &[0.0, 0.0085, 0.0]];
    let rolled = Case { roll_rad: 0.01, terms: Some(HeightTerms::Both), ..WHOLE };
    for (name, case) in [
        ("one height a picture", WHOLE),
        ("a rolled camera", rolled),
        ("blocks on a base", Case { pictures: &blocks, ..WHOLE }),
    ] {
        assert_true(name, &figures(name, &case, &INSIDE_M));
    }
}

/// Three heights and a stated gauge, the fewest that are accepted: the extrapolated uncertainty grows as the errors do.
#[test]
fn beyond_the_gauge_the_uncertainty_grows_as_the_errors_do() {
    let three = Case { pictures: &[&[0.0], &[0.005], &[0.012]], ..WHOLE };
    for (name, case) in [("three heights", three), ("five heights", WHOLE)] {
        let inside = figures(name, &case, &INSIDE_M);
        let outside = figures(name, &case, &OUTSIDE_M);
        assert_true(name, &outside);
        let within = inside.iter().map(|[_, sigma]| *sigma).fold(0.0, f64::max);
        assert!(outside[1][1] > 1.5 * within && outside[0][1] > outside[1][1], "{outside:?}");
        assert!(outside[3][1] > 3.0 * within && outside[3][1] > outside[2][1], "{outside:?}");
    }
}
