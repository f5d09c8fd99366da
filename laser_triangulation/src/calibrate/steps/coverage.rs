//! Intervals of a measured step contain the truth as often as stated, for calibrations whose gauges are off.

use nalgebra::Point3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::{
    tests::{PICTURE, Pinhole},
    *,
};
use crate::{
    metrology::{NORMAL_95, calibration_error, surface::Surface},
    scanner::{calibration::Calibration, params::StripeDirection},
};

pub(super) const CALIBRATIONS: u64 = 600;
pub(super) const GAUGE_SIGMA_M: f64 = 8e-6;
const NOISE_PX: f64 = 0.03;

/// A picture of a gauge: stated heights, side by side.
pub(super) type Stated<'a> = &'a [f64];

/// A way to calibrate.
#[derive(Clone, Copy)]
pub(super) struct Case<'a> {
    pub(super) pictures: &'a [Stated<'a>],
    pub(super) terms: Option<HeightTerms>,
    pub(super) reference: HeightReference,
    pub(super) is_stated: bool,
    /// Angle between the camera's rows and the stripe, radians.
    pub(super) roll_rad: f64,
}

pub(super) const WHOLE: Case<'_> = Case {
    pictures: &[&[0.0], &[0.002], &[0.005], &[0.009], &[0.012]],
    terms: Some(HeightTerms::Across),
    reference: HeightReference::Common,
    is_stated: true,
    roll_rad: 0.0,
};

/// Pictures of the gauge, whose surfaces are off by random amounts; a bed that drifts if the reference says so.
fn plateaus(case: &Case<'_>, pinhole: &Pinhole, seed: u64) -> Vec<Plateau> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    // Each height is one surface of the gauge: it is wrong by the same amount wherever it is used.
    let mut errors: Vec<(f64, f64)> = Vec::new();
    let mut plateaus = Vec::new();
    for (picture, stated) in case.pictures.iter().enumerate() {
        let drift_m = match case.reference {
            HeightReference::EachPicture if picture > 0 => 1e-3 * normal(),
            _ => 0.0,
        };
        let width = 2000.0 / stated.len() as f64;
        for (at, &height_m) in stated.iter().enumerate() {
            let known = errors.iter().find(|(of_m, _)| of_m.total_cmp(&height_m).is_eq());
            let error_m = known.map_or_else(|| GAUGE_SIGMA_M * normal(), |(_, error)| *error);
            errors.push((height_m, error_m));
            let from = 300.0 + width * at as f64;
            let true_m = height_m + error_m + drift_m;
            let number = 1000 * seed + plateaus.len() as u64;
            let seen = pinhole.plateau(true_m, [from, from + 0.9 * width], NOISE_PX, number);
            let sigma_m = case.is_stated.then_some(GAUGE_SIGMA_M);
            plateaus.push(Plateau { height: GaugeHeight { height_m, sigma_m }, picture, ..seen });
        }
    }
    plateaus
}

/// Returns a camera, and its calibration as it is written and read.
pub(super) fn calibrated(case: &Case<'_>, seed: u64) -> (Pinhole, Calibration) {
    let pinhole = Pinhole::new(case.roll_rad);
    let Case { terms, reference, .. } = *case;
    let request = StepsRequest { terms, reference, picture: PICTURE };
    let result = calibrate_steps(&plateaus(case, &pinhole, seed), &request).unwrap();
    let scale = LateralScale { per_px: 5e-5, relative_sigma: 0.0 };
    let map = result.projective(&PICTURE, scale, "laser_plane");
    let text = Calibration::Projective(Box::new(map)).to_yaml();
    (pinhole, Calibration::from_yaml(&text).unwrap())
}

/// Returns a measured step minus the true one, and its stated half width, each over `GAUGE_SIGMA_M`.
fn step(case: &Case<'_>, seed: u64) -> [f64; 2] {
    let (pinhole, calibration) = calibrated(case, seed);
    let Calibration::Projective(map) = &calibration else { panic!("a homography was written") };
    let [low, high] = [(-0.006, 0.0015), (0.006, 0.0105)];
    let point = |(x_m, z_m): (f64, f64)| {
        let [u, v] = pinhole.see(x_m, z_m);
        let row = |r: usize| {
            map.homography[3 * r] * u + map.homography[3 * r + 1] * v + map.homography[3 * r + 2]
        };
        Point3::new(row(0) / row(2), 0.0, row(1) / row(2))
    };
    let surface = Surface { width: 2, points: vec![point(low), point(high)] };
    let direction = StripeDirection::Horizontal;
    let outside = calibration_error::num_outside(&calibration, direction, &surface, &[]);
    assert_eq!(outside, Some(0), "both points lie within the gauge");
    let height = |surface: &Surface| surface.points[1].z - surface.points[0].z;
    let all = calibration_error::perturbations(&calibration, direction).unwrap();
    let changes = all.iter().map(|one| height(&one.apply(&surface, &[])) - height(&surface));
    let sigma_m = changes.map(|change| change * change).sum::<f64>().sqrt();
    let error_m = height(&surface) - (high.1 - low.1);
    [error_m / GAUGE_SIGMA_M, NORMAL_95 * sigma_m / GAUGE_SIGMA_M]
}

/// Returns the share of calibrations whose interval contains the truth.
fn share(case: &Case<'_>) -> f64 {
    let covered = (0..CALIBRATIONS).filter(|seed| {
        let [error, u95] = step(case, *seed);
        error.abs() <= u95
    });
    covered.count() as f64 / CALIBRATIONS as f64
}

#[test]
fn a_stated_gauge_is_covered_as_stated() {
    let blocks: [Stated<'_>; 3] = [&[0.0, 0.012, 0.0], &[0.0, 0.004, 0.0], &[0.0, 0.0085, 0.0]];
    let cases = [
        ("one height a picture", WHOLE),
        ("a rolled camera", Case { roll_rad: 0.01, terms: Some(HeightTerms::Both), ..WHOLE }),
        ("terms by the fit", Case { roll_rad: 0.01, terms: None, ..WHOLE }),
        ("blocks on a base", Case { pictures: &blocks, ..WHOLE }),
        (
            "blocks on a base that drifts",
            Case { pictures: &blocks, reference: HeightReference::EachPicture, ..WHOLE },
        ),
        (
            "the same, rolled",
            Case {
                pictures: &blocks,
                reference: HeightReference::EachPicture,
                terms: Some(HeightTerms::Both),
                roll_rad: 0.01,
                ..WHOLE
            },
        ),
    ];
    for (name, case) in cases {
        let share = share(&case);
        assert!((0.93..=0.97).contains(&share), "{name}: {share}");
    }
}

#[test]
fn without_redundancy_the_stated_gauge_counts_and_an_unknown_one_is_refused() {
    let three = Case { pictures: &[&[0.0], &[0.005], &[0.012]], ..WHOLE };
    let covered = share(&three);
    assert!((0.93..=1.0).contains(&covered), "{covered}");
    let twice = Case {
        pictures: &[&[0.0], &[0.005], &[0.012], &[0.0], &[0.005], &[0.012]],
        is_stated: false,
        ..WHOLE
    };
    let pinhole = Pinhole::new(0.0);
    for case in [Case { is_stated: false, ..three }, twice] {
        let request =
            StepsRequest { terms: case.terms, reference: case.reference, picture: PICTURE };
        let error = calibrate_steps(&plateaus(&case, &pinhole, 1), &request).unwrap_err();
        assert_eq!(error, StepsError::NoRedundancy, "a repeated height is no check");
    }
}

#[test]
fn a_gauge_of_unknown_uncertainty_is_covered_by_its_residuals() {
    let four: [Stated<'_>; 4] = [&[0.0], &[0.004], &[0.008], &[0.012]];
    for pictures in [WHOLE.pictures, &four] {
        let share = share(&Case { pictures, is_stated: false, ..WHOLE });
        assert!(share >= 0.93, "{share}");
    }
}

#[test]
fn residuals_beyond_the_stated_uncertainty_widen_it() {
    let pinhole = Pinhole::new(0.0);
    let mut plateaus = plateaus(&WHOLE, &pinhole, 3);
    for plateau in &mut plateaus {
        plateau.height.sigma_m = Some(0.2e-6);
    }
    let request =
        StepsRequest { terms: None, reference: HeightReference::Common, picture: PICTURE };
    let result = calibrate_steps(&plateaus, &request).unwrap();
    assert!(result.excess.is_some_and(|excess| excess > 5.0), "{:?}", result.excess);
    assert!(result.u95_m > 3e-6, "{}", result.u95_m);
    plateaus[1].height.sigma_m = None;
    let error = calibrate_steps(&plateaus, &request).unwrap_err();
    assert_eq!(error, StepsError::PartlyStated { height_m: 0.002 });
}
