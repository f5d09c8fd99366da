use super::*;
use crate::metrology::noise::{share, surface};

const SIGMA_M: f64 = 3e-6;

#[test]
fn the_stated_uncertainty_covers_the_truth() {
    for smooth in [1, 5] {
        let fits: Vec<_> = (0..300)
            .map(|seed| {
                fit(&surface(|x, y| 1e-3 + 0.05 * x - 0.1 * y, SIGMA_M, smooth, seed)).unwrap()
            })
            .collect();
        let height = share(300, |seed| {
            let plane = &fits[seed as usize];
            let error_m = plane.height_m(0.0, 0.0) - 1e-3;
            error_m.abs() < 1.96 * plane.sigma_m / plane.normal.z
        });
        let truth = Vector3::new(-0.05, 0.1, 1.0).normalize();
        let tilt = share(300, |seed| {
            let plane = &fits[seed as usize];
            (truth.dot(&plane.directions[1])).abs() < 1.96 * plane.tilt_sigma_rad[1]
        });
        assert!((height - 0.95).abs() <= 0.03, "smoothed over {smooth}: height {height}");
        assert!((tilt - 0.95).abs() <= 0.03, "smoothed over {smooth}: tilt {tilt}");
    }
}

#[test]
fn flatness_is_that_of_the_noise() {
    let widths: Vec<f64> = (0..200)
        .map(|seed| fit(&surface(|_, _| 0.0, SIGMA_M, 1, seed)).unwrap().flatness.d95_m)
        .collect();
    let mean = widths.iter().sum::<f64>() / 200.0;
    // 95 % of a normal distribution lie within 1.96 standard deviations on both sides.
    assert!((mean / (3.92 * SIGMA_M) - 1.0).abs() < 0.02, "{mean}");
    let spread = (widths.iter().map(|w| (w - mean).powi(2)).sum::<f64>() / 199.0).sqrt();
    let stated = fit(&surface(|_, _| 0.0, SIGMA_M, 1, 7)).unwrap().flatness.d95_sigma_m;
    assert!(stated > 0.6 * spread && stated < 1.7 * spread, "{stated} {spread}");
}

#[test]
fn a_tenth_of_outliers_changes_nothing() {
    let mut points = surface(|x, _| 0.2 * x, SIGMA_M, 1, 1);
    for point in points.points.iter_mut().step_by(10) {
        point.z += 1e-3;
    }
    let plane = fit(&points).unwrap();
    assert!((300..=310).contains(&plane.num_outliers), "{}", plane.num_outliers);
    assert!((plane.tilt_rad() - 0.2_f64.atan()).abs() < 2e-4, "{}", plane.tilt_rad());
    assert!(plane.flatness.peak_to_valley_m > 0.9e-3, "outliers are part of the form");
}

#[test]
fn a_wall_is_a_plane_too() {
    let mut wall = surface(|x, y| 0.3 * x + 0.1 * y, 0.0, 1, 1);
    for point in &mut wall.points {
        *point = Point3::new(point.z, point.y, point.x);
    }
    let plane = fit(&wall).unwrap();
    assert!(plane.flatness.peak_to_valley_m < 1e-12, "{:?}", plane.flatness);
}

#[test]
fn leveling_lays_the_plane_at_height_0() {
    let points = surface(|x, y| 2e-3 + 0.3 * x - 0.2 * y, 0.0, 1, 1);
    let motion = leveling(&fit(&points).unwrap());
    assert!(points.points.iter().all(|point| (motion * point).z.abs() < 1e-12));
}

#[test]
fn too_few_points_and_lines_are_errors() {
    let mut few = surface(|_, _| 0.0, SIGMA_M, 1, 1);
    few.points.truncate(12);
    assert_eq!(fit(&few).unwrap_err(), FormError::TooFew { found: 12, needed: 20 });
    let mut line = surface(|_, _| 0.0, 0.0, 1, 1);
    line.points.truncate(60);
    assert_eq!(fit(&line).unwrap_err(), NoSurface::OneProfile.into());
}

#[test]
fn a_strip_narrower_than_its_relief_has_no_plane() {
    for relief_m in [1e-3, 3e-3] {
        let mut strip = surface(|x, _| relief_m * (2e3 * x).cos(), SIGMA_M, 1, 3);
        strip.points.truncate(240);
        assert_eq!(strip.check(), Ok(()));
        assert_eq!(fit(&strip).unwrap_err(), FormError::Upright { found: 240 });
    }
}
