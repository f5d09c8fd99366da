use super::*;
use crate::metrology::{
    noise::{share, surface},
    surface::Surface,
};

const SIGMA_M: f64 = 3e-6;
const RADIUS_M: f64 = 5e-3;

/// Returns a cap of a sphere whose centre lies at (0.1, -0.2, -4) mm; noise along z.
fn cap(sigma_m: f64, smooth: usize, seed: u64) -> Surface {
    let z = |x: f64, y: f64| {
        let square = RADIUS_M.powi(2) - (x - 1e-4).powi(2) - (y + 2e-4).powi(2);
        square.sqrt() - 4e-3
    };
    surface(z, sigma_m, smooth, seed)
}

#[test]
fn without_noise_the_sphere_is_exact() {
    let sphere = fit(&cap(0.0, 1, 0)).unwrap();
    assert!((sphere.radius_m - RADIUS_M).abs() < 1e-11, "{}", sphere.radius_m);
    assert!((sphere.center_m - Point3::new(1e-4, -2e-4, -4e-3)).norm() < 1e-11);
    assert!(sphere.form.peak_to_valley_m < 1e-11);
}

#[test]
fn the_stated_uncertainty_covers_the_truth() {
    for smooth in [1, 4] {
        let fits: Vec<_> = (0..200).map(|seed| fit(&cap(SIGMA_M, smooth, seed)).unwrap()).collect();
        let radius = share(200, |seed| {
            let sphere = &fits[seed as usize];
            (sphere.radius_m - RADIUS_M).abs() < 1.96 * sphere.radius_sigma_m()
        });
        let center = share(200, |seed| {
            let sphere = &fits[seed as usize];
            (sphere.center_m.x - 1e-4).abs() < 1.96 * sphere.center_sigma_m()[0]
        });
        assert!((radius - 0.95).abs() <= 0.03, "smoothed over {smooth}: radius {radius}");
        assert!((center - 0.95).abs() <= 0.03, "smoothed over {smooth}: centre {center}");
    }
}

#[test]
fn the_distance_of_two_has_the_uncertainty_of_both() {
    let moved = |seed: u64| {
        let mut other = cap(SIGMA_M, 1, seed + 1000);
        other.points.iter_mut().for_each(|point| *point += Vector3::new(0.03, 0.04, 0.0));
        fit(&other).unwrap()
    };
    let covered = share(200, |seed| {
        let [distance, sigma] = distance_m(&fit(&cap(SIGMA_M, 1, seed)).unwrap(), &moved(seed));
        (distance - 0.05).abs() < 1.96 * sigma
    });
    assert!((covered - 0.95).abs() <= 0.03, "{covered}");
}

#[test]
fn outliers_do_not_move_a_sphere_and_a_plane_is_rejected() {
    let mut dirty = cap(SIGMA_M, 1, 3);
    dirty.points.iter_mut().step_by(9).for_each(|point| point.z += 5e-4);
    let sphere = fit(&dirty).unwrap();
    assert!((sphere.radius_m - RADIUS_M).abs() < 5e-6, "{}", sphere.radius_m);
    let flat = surface(|x, _| 0.1 * x, 0.0, 1, 1);
    assert!(matches!(fit(&flat), Err(FormError::Degenerate { .. })));
    let few = Surface { width: 5, points: dirty.points[..5].to_vec() };
    assert_eq!(fit(&few).unwrap_err(), FormError::TooFew { found: 5, needed: 20 });
}
