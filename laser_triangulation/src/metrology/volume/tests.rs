use super::*;
use crate::metrology::{
    height_map::{GridLayout, Resampler},
    noise::{share, surface},
    plane,
    surface::{Region, Surface},
};

const SIGMA_M: f64 = 3e-6;

fn map(surface: &Surface, region: &Region) -> RegularHeightMap {
    let layout = GridLayout::covering(region, 1e-4).unwrap();
    let mut resampler = Resampler::new(layout, [1e-4; 2]);
    surface.rows().for_each(|row| resampler.push(row));
    resampler.finish()
}

#[test]
fn a_cushion_has_its_volume_and_the_stated_uncertainty_covers_it() {
    // cos² over 2 x 2 mm, 0.2 mm high, on an inclined base: its mean height is a quarter.
    let cushion = |x: f64, y: f64| {
        let inside = x.abs() < 1e-3 && y.abs() < 1e-3;
        let shape = |u: f64| (u * std::f64::consts::PI / 2e-3).cos().powi(2);
        0.05 * x + if inside { 2e-4 * shape(x) * shape(y) } else { 0.0 }
    };
    let truth = 2e-4 * 4e-6 / 4.0;
    let inner = Region { from_m: [-1.45e-3; 2], to_m: [1.44e-3; 2] };
    let covered = share(200, |seed| {
        let surface = surface(cushion, SIGMA_M, 1, seed);
        let outside = Region { from_m: [-3e-3, 1.2e-3], to_m: [3e-3, 3e-3] };
        let other = Region { from_m: [-3e-3, -3e-3], to_m: [3e-3, -1.2e-3] };
        let mut base = surface.clone();
        for point in &mut base.points {
            if !outside.contains(point.x, point.y) && !other.contains(point.x, point.y) {
                *point = Point3::new(f64::NAN, f64::NAN, f64::NAN);
            }
        }
        let plane = plane::fit(&base).unwrap();
        let points = surface.within(&inner).num_measured() as f64;
        let volume = over_plane(&map(&surface, &inner), &inner, &plane, plane.scatter_m, points);
        assert!((volume.volume_m3 / truth - 1.0).abs() < 0.03, "{volume:?}");
        (volume.volume_m3 - truth).abs() < 1.96 * volume.sigma_m3
    });
    assert!((covered - 0.95).abs() <= 0.03, "{covered}");
}

#[test]
fn missing_area_is_reported() {
    let mut surface = surface(|_, _| 1e-4, 0.0, 1, 1);
    for point in surface.points.iter_mut().filter(|point| point.x > 0.0) {
        *point = Point3::new(f64::NAN, f64::NAN, f64::NAN);
    }
    let plane = plane::fit(&surface).unwrap();
    let region = Region { from_m: [-2e-3, -2e-3], to_m: [1.99e-3, 1.99e-3] };
    let volume = over_plane(&map(&surface, &region), &region, &plane, 0.0, 1.0);
    assert!(volume.volume_m3.abs() < 1e-16, "{volume:?}");
    assert!(
        (volume.area_m2 - 8e-6).abs() < 0.5e-6 && (volume.missing_m2 - 8e-6).abs() < 0.5e-6,
        "{volume:?}"
    );
}
