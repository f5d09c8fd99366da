use super::*;
use crate::metrology::noise::{share, surface};

const SIGMA_M: f64 = 3e-6;
const STEP_M: f64 = 100e-6;

/// A ridge 1.6 mm wide on an inclined base.
fn ridge(sigma_m: f64, smooth: usize, seed: u64) -> Surface {
    let z = |x: f64, _| 0.02 * x + if x.abs() < 0.8e-3 { STEP_M } else { 0.0 };
    surface(z, sigma_m, smooth, seed)
}

#[test]
fn a_ridge_and_a_groove_have_their_height() {
    let found = measure(&ridge(0.0, 1, 0), None).unwrap();
    assert!((found.height_m - STEP_M).abs() < 1e-12, "{}", found.height_m);
    assert!(
        found
            .edges_m
            .iter()
            .zip([-0.8e-3, 0.8e-3])
            .all(|(edge, truth)| (edge - truth).abs() < 1e-4)
    );
    let mut groove = ridge(SIGMA_M, 1, 4);
    groove.points.iter_mut().for_each(|point| point.z = -point.z);
    let found = measure(&groove, None).unwrap();
    assert!((found.height_m + STEP_M).abs() < 1e-6, "{}", found.height_m);
    assert_eq!((found.num_profiles, found.num_rejected), (50, 0));
}

#[test]
fn the_inclination_of_the_base_is_that_of_the_surface() {
    for [along, across] in [[0.02, 0.0], [0.0, 0.5], [-0.1, 0.3]] {
        let z =
            |x: f64, y: f64| along * x + across * y + if x.abs() < 0.8e-3 { STEP_M } else { 0.0 };
        let expected_rad = f64::hypot(along, across).atan();
        let mut inclined = surface(z, SIGMA_M, 1, 3);
        let found = measure(&inclined, Some([-0.8e-3, 0.8e-3])).unwrap();
        assert!((found.inclination_rad - expected_rad).abs() < 3e-3, "{found:?}");
        // All profiles at one place: the inclination along them is what is known.
        inclined.points.iter_mut().for_each(|point| point.y = 0.0);
        let found = measure(&inclined, Some([-0.8e-3, 0.8e-3])).unwrap();
        assert!((found.inclination_rad - along.abs().atan()).abs() < 3e-3, "{found:?}");
    }
}

#[test]
fn the_stated_uncertainty_covers_the_truth() {
    for smooth in [1, 4] {
        let covered = share(300, |seed| {
            let found = measure(&ridge(SIGMA_M, smooth, seed), None).unwrap();
            (found.height_m - STEP_M).abs() < found.u95_m
        });
        assert!((covered - 0.95).abs() <= 0.03, "smoothed over {smooth}: {covered}");
    }
}

#[test]
fn a_single_profile_uses_its_own_noise() {
    let covered = share(300, |seed| {
        let mut surface = ridge(SIGMA_M, 1, seed);
        surface.points.truncate(60);
        let found = measure(&surface, Some([-0.8e-3, 0.8e-3])).unwrap();
        (found.height_m - STEP_M).abs() < found.u95_m
    });
    // 38 points and three unknowns: the normal distribution is slightly too narrow.
    assert!((0.90..=0.98).contains(&covered), "{covered}");
}

#[test]
fn a_surface_without_a_step_is_an_error() {
    let flat = surface(|_, _| 0.0, SIGMA_M, 1, 1);
    let error = measure(&flat, None).unwrap_err().to_string();
    assert!(error.contains("has 1 level part (-2.950 to 2.950 mm), three"), "{error}");
    let stair = surface(|x, _| ((x + 3e-3) / 2e-3).floor() * STEP_M, SIGMA_M, 1, 1);
    assert!(matches!(measure(&stair, None), Err(StepHeightError::Stair { .. })));
    let beside = measure(&ridge(SIGMA_M, 1, 1), Some([0.01, 0.02]));
    assert!(matches!(beside, Err(StepHeightError::TooFew(50))));
}

#[test]
fn edges_are_found_without_noise() {
    for height_m in [3e-3, 0.3e-3, 1.0] {
        for blur_m in [0.0, 0.15e-3] {
            let z = |x: f64, _| {
                let inside: f64 = 0.8e-3 - x.abs();
                let share = if blur_m > 0.0 { 0.5 + 0.5 * (inside / blur_m).tanh() } else { 0.0 };
                height_m * if blur_m > 0.0 { share } else { f64::from(u8::from(inside > 0.0)) }
            };
            let found = measure(&surface(z, 0.0, 1, 0), None).unwrap();
            assert!((found.height_m / height_m - 1.0).abs() < 1e-3, "{height_m} {found:?}");
            let off = found.edges_m.map(|edge| (edge.abs() - 0.8e-3).abs());
            assert!(off.iter().all(|off| *off < 1.5e-4), "{found:?}");
        }
    }
    let level = surface(|_, _| 0.25, 0.0, 1, 0);
    assert!(matches!(measure(&level, None), Err(StepHeightError::Edges { .. })));
}
