mod lens;
mod profiles;

use super::*;
use crate::{metrology::student::NORMAL_95, scanner::params::StripeDirection};
use nalgebra::{Rotation3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A pinhole camera built from vectors, independent of the formulas under test. It looks down at a vertical laser
/// plane.
pub(super) struct Pinhole {
    lens: Vector3<f64>,
    /// Right, down, forward.
    axes: [Vector3<f64>; 3],
    focal_px: f64,
    middle_px: [f64; 2],
    distortion: Distorted,
}

/// Coefficients of the lens, as OpenCV has them: k1, p1 and p2, on the plane z = 1.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Distorted {
    pub(super) k1: f64,
    pub(super) tangential: [f64; 2],
    /// Where the lens is centred, on the plane z = 1.
    pub(super) centre: [f64; 2],
}

/// a, pixel pitch, b, β of the paper's rig.
const RIG: [f64; 4] = [0.026, 4.8e-6, 0.3, 0.5];

impl Pinhole {
    pub(super) fn new(roll_rad: f64) -> Self {
        let [a, pitch, b, beta] = RIG;
        let lens = Vector3::new(0.0, beta.sin(), beta.cos()) * b;
        let forward = -lens.normalize();
        let right = Vector3::x();
        let down = forward.cross(&right);
        let roll = Rotation3::from_axis_angle(&nalgebra::Unit::new_normalize(forward), roll_rad);
        let axes = [roll * right, roll * down, forward];
        Self {
            lens,
            axes,
            focal_px: a / pitch,
            middle_px: [1295.5, 1023.5],
            distortion: Distorted::default(),
        }
    }

    /// The same camera with another lens.
    pub(super) fn behind(self, distortion: Distorted) -> Self {
        Self { distortion, ..self }
    }

    /// Column and row of a point of the laser plane.
    pub(super) fn see(&self, x_m: f64, z_m: f64) -> [f64; 2] {
        let ray = Vector3::new(x_m, 0.0, z_m) - self.lens;
        let depth = ray.dot(&self.axes[2]);
        let [x, y] = [0, 1].map(|i| ray.dot(&self.axes[i]) / depth);
        let Distorted { k1, tangential: [p1, p2], centre } = self.distortion;
        let [x, y] = [x - centre[0], y - centre[1]];
        let (r2, xy) = (x * x + y * y, 2.0 * x * y);
        let seen = [
            x * (1.0 + k1 * r2) + p1 * xy + p2 * (r2 + 2.0 * x * x),
            y * (1.0 + k1 * r2) + p2 * xy + p1 * (r2 + 2.0 * y * y),
        ];
        [0, 1].map(|i| self.middle_px[i] + self.focal_px * (seen[i] + centre[i]))
    }

    /// x of the point at a height that a column shows, metres, and its row.
    pub(super) fn lit(&self, column: f64, z_m: f64) -> [f64; 2] {
        let metres_per_px = RIG[2] / self.focal_px;
        let mut x_m = (column - self.middle_px[0]) * metres_per_px;
        for _ in 0..30 {
            x_m -= (self.see(x_m, z_m)[0] - column) * metres_per_px;
        }
        [x_m, self.see(x_m, z_m)[1]]
    }

    /// Returns the image of a flat at a height, column by column, with noise in pixels.
    pub(super) fn plateau(
        &self,
        height_m: f64,
        columns: [f64; 2],
        noise_px: f64,
        seed: u64,
    ) -> Plateau {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let points: Vec<[f64; 2]> = (columns[0] as i32..columns[1] as i32)
            .map(f64::from)
            .map(|u| [u, self.lit(u, height_m)[1] + noise_px * normal()])
            .collect();
        Plateau::fit(&points, &(0..points.len()), GaugeHeight::of(height_m)).unwrap()
    }

    fn whole(&self, heights_m: &[f64], noise_px: f64, seed: u64) -> Vec<Plateau> {
        let plateau = |(i, height): (usize, &f64)| {
            self.plateau(*height, [300.0, 2300.0], noise_px, 100 * seed + i as u64)
        };
        heights_m.iter().enumerate().map(plateau).collect()
    }
}

/// The pictures of the pinhole camera.
pub(super) const PICTURE: GaugePicture =
    GaugePicture { size_px: [2592, 2048], direction: StripeDirection::Horizontal };

fn request(terms: Option<HeightTerms>) -> StepsRequest {
    StepsRequest { terms, reference: HeightReference::Common, picture: PICTURE }
}

fn calibrate(
    plateaus: &[Plateau],
    terms: Option<HeightTerms>,
) -> Result<StepsCalibration, StepsError> {
    calibrate_steps(plateaus, &request(terms))
}

const HEIGHTS_M: [f64; 5] = [0.0, 0.002, 0.005, 0.009, 0.012];

#[test]
fn three_parameters_fit_a_camera_without_roll() {
    let pinhole = Pinhole::new(0.0);
    let result = calibrate(&pinhole.whole(&HEIGHTS_M, 0.0, 0), None).unwrap();
    assert!(result.rms_m < 1e-12, "{}", result.rms_m);
    for z_m in [-0.002, 0.007, 0.015] {
        let measured = result.model.height_m(pinhole.see(0.004, z_m)).unwrap();
        assert!((measured - z_m).abs() < 1e-10, "{measured}");
    }
}

#[test]
fn a_rolled_camera_gets_terms_along_the_stripe() {
    let pinhole = Pinhole::new(0.02);
    let plateaus = pinhole.whole(&HEIGHTS_M, 0.02, 1);
    let result = calibrate(&plateaus, None).unwrap();
    assert_eq!(result.model.term, HeightTerms::Both);
    for (x_m, z_m) in [(-0.015, 0.001), (0.0, 0.006), (0.015, 0.011)] {
        let measured = result.model.height_m(pinhole.see(x_m, z_m)).unwrap();
        assert!((measured - z_m).abs() < 2e-6, "{measured} {z_m}");
    }
    let level = calibrate(&Pinhole::new(0.0).whole(&HEIGHTS_M, 0.02, 1), None).unwrap();
    assert_eq!(level.model.term, HeightTerms::Across, "nothing to gain");
}

#[test]
fn rows_are_the_map() {
    let plateaus = Pinhole::new(0.02).whole(&HEIGHTS_M, 0.02, 2);
    let model = calibrate(&plateaus, None).unwrap().model;
    let [z, w] = model.rows();
    for place in [[300.0, 900.0], [2000.0, 700.0]] {
        let row = |row: [f64; 3]| row[0] * place[0] + row[1] * place[1] + row[2];
        assert!((row(z) / row(w) - model.height_m(place).unwrap()).abs() < 1e-12);
    }
}

#[test]
fn the_stated_uncertainty_of_a_height_covers_the_truth() {
    let pinhole = Pinhole::new(0.0);
    let (mut covered, num) = (0, 400);
    for seed in 0..num {
        let result =
            calibrate(&pinhole.whole(&HEIGHTS_M, 0.3, seed), Some(HeightTerms::Across)).unwrap();
        let place = pinhole.see(0.0, 0.007);
        let error = result.model.height_m(place).unwrap() - 0.007;
        let u95 = NORMAL_95 * result.model.sigma_m(place).unwrap();
        covered += u32::from(error.abs() < u95);
    }
    let share = f64::from(covered) / num as f64;
    // The coverage is never less than stated; it may be more, because noise is added to an estimate that contains it.
    assert!((0.92..=1.0).contains(&share), "{share}");
}

#[test]
fn one_more_length_determines_the_geometry_of_formula_6() {
    let pinhole = Pinhole::new(0.0);
    let plateaus = pinhole.whole(&[0.0, 0.01, 0.02, 0.03, 0.045], 0.005, 3);
    let model = calibrate(&plateaus, Some(HeightTerms::Across)).unwrap().model;
    let [a, pitch, b, beta] = RIG;
    for known in [KnownDistance::ImageDistance(a), KnownDistance::ObjectDistance(b)] {
        let found = vertical_incidence(&model, pitch, known).unwrap();
        let values = [
            (found.image_distance_m, a),
            (found.object_distance_m, b),
            (found.beta_rad, beta),
            (found.base_px, 1023.5),
        ];
        for ([value, sigma], truth) in values {
            assert!((value - truth).abs() < 4.0 * sigma + 1e-9, "{value} ± {sigma}, {truth}");
            assert!(sigma < 0.1 * value, "{value} ± {sigma}");
        }
        let rises = pinhole.see(0.0, 0.01)[1] > pinhole.see(0.0, 0.0)[1];
        assert_eq!(found.height_sign == 1, rises);
    }
    let error = vertical_incidence(&model, pitch, KnownDistance::ObjectDistance(0.6)).unwrap_err();
    assert!(error.to_string().contains("contradicts"), "{error}");
}

#[test]
fn flat_perspective_is_an_error() {
    let plateaus = Pinhole::new(0.0).whole(&[0.0, 0.0002, 0.0004, 0.0006], 0.5, 4);
    let model = calibrate(&plateaus, Some(HeightTerms::Across)).unwrap().model;
    let error =
        vertical_incidence(&model, 4.8e-6, KnownDistance::ImageDistance(0.026)).unwrap_err();
    assert!(matches!(error, VerticalIncidenceError::NotIdentified { .. }), "{error}");
}

#[test]
fn wrong_heights_are_detected() {
    let pinhole = Pinhole::new(0.0);
    let mut plateaus = pinhole.whole(&HEIGHTS_M, 0.02, 5);
    plateaus[2].height.height_m += 50e-6;
    let result = calibrate(&plateaus, None).unwrap();
    let left_out = |i: usize| {
        let check = &result.checks[i];
        (check.left_out_m.unwrap() - check.plateau.height.height_m).abs()
    };
    assert!(left_out(2) > 45e-6 && left_out(2) > left_out(1), "{} {}", left_out(2), left_out(1));
    assert!(result.rms_m > 10e-6);

    assert_eq!(calibrate(&plateaus[..2], None).unwrap_err(), StepsError::TooFew { found: 2 });
    plateaus[1].height.height_m = 0.02;
    let error = calibrate(&plateaus, None).unwrap_err().to_string();
    assert!(error.contains("0.02 m") && error.contains("order"), "{error}");
}
