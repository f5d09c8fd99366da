//! Tests that profiles state the calibration's share in their heights truly.

use nalgebra::Point3;

use super::{rig::SimulatedRig, *};
use crate::scanner::{
    calibration::{Calibration, Lines, Triangulator},
    params::StripeDirection,
    profile::Profile,
    stripe::Centerline,
};

/// Places along the stripe, and heights, as shares of the laser plane's distance.
const PLACES: [f64; 5] = [-0.1, -0.05, 0.0, 0.05, 0.1];
const HEIGHTS: [f64; 3] = [-0.1, 0.0, 0.1];
/// One number for each of the points.
type PerPoint = [f64; PLACES.len() * HEIGHTS.len()];

impl SimulatedRig {
    /// Returns the errors of the heights that a calibration measures, in units of what its profiles state.
    pub(super) fn judged_heights(&self, found: &CameraAndPlane) -> PerPoint {
        let truth = CameraAndPlane { plane: self.plane(), ..found.clone() };
        let camera_from_laser = truth.camera_from_laser(self.direction);
        let calibration = Calibration::CameraAndPlane(Box::new(found.clone()));
        let mut triangulator = Triangulator::new(calibration);
        triangulator.prepare(self.direction, self.size_px.into());
        std::array::from_fn(|at| {
            let [x_m, z_m] = [PLACES[at % PLACES.len()], HEIGHTS[at / PLACES.len()]]
                .map(|share| share * self.distance_m);
            let seen = self.sees(camera_from_laser * Point3::new(x_m, 0.0, z_m)).unwrap();
            let profile = measured(&triangulator, self.direction, [seen.x, seen.y]);
            let error_m = f64::from(profile.z_m[0]) - z_m;
            error_m / f64::from(profile.calibration_sigma_z_m[0])
        })
    }
}

/// Returns the profile of one point of a stripe.
fn measured(triangulator: &Triangulator, direction: StripeDirection, seen: [f64; 2]) -> Profile {
    let [column, row] = seen.map(|px| px as f32);
    let centerline = Centerline {
        u_px: vec![column],
        v_px: vec![row],
        intensity: vec![100.0],
        sigma_px: vec![0.0],
        flags: vec![0],
        ..Centerline::default()
    };
    let along = match direction {
        StripeDirection::Horizontal => column,
        StripeDirection::Vertical => row,
    };
    let lines = Lines { direction, first: along as usize, count: 1 };
    let mut profile = Profile::default();
    triangulator.triangulate(&centerline, &lines, 255, &mut profile);
    profile
}

/// Root mean square of the errors over what is stated: over all calibrations and points, and the smallest and largest of
/// one point.
#[expect(clippy::print_stderr, reason = "prints the figures of docs/metrology.md")]
fn figures(name: &str, rig: &SimulatedRig) -> [f64; 3] {
    let trials: Vec<PerPoint> = (0..TRIALS)
        .map(|number| {
            let random = &mut frame_rng(2031, number);
            let camera = rig.calibrated_camera(random);
            let lines = rig.lines(&camera.camera, &rig.target().parse().unwrap(), random);
            let fit = calibrate_plane(&lines, camera.quality.as_ref()).unwrap();
            rig.judged_heights(&fit.calibration(camera, "laser_plane"))
        })
        .collect();
    let all = rms(trials.as_flattened());
    let of_point = |at: usize| rms(&trials.iter().map(|trial| trial[at]).collect::<Vec<_>>());
    let points: Vec<_> = (0..trials[0].len()).map(of_point).collect();
    let smallest = points.iter().copied().fold(f64::INFINITY, f64::min);
    let largest = points.iter().copied().fold(0.0, f64::max);
    eprintln!("{name}, heights of profiles: {all:.2}, of one point {smallest:.2} to {largest:.2}");
    [all, smallest, largest]
}

fn assert_true(name: &str, rig: &SimulatedRig) {
    let [all, smallest, largest] = figures(name, rig);
    for found in [all, smallest, largest] {
        assert!((0.8..=1.25).contains(&found), "{name}: {found}");
    }
}

#[test]
fn heights_of_profiles_are_as_uncertain_as_stated() {
    assert_true("twenty views", &SimulatedRig::with_many_views());
}

#[test]
fn heights_by_a_wide_lens_and_a_vertical_stripe_too() {
    assert_true("wide", &SimulatedRig::wide());
}

#[test]
fn heights_by_a_long_lens_and_noise_too() {
    assert_true("long", &SimulatedRig::long());
}

#[test]
fn heights_by_few_views_too() {
    assert_true("few views", &SimulatedRig::with_few_views());
}
