//! Repeatability of a plane's height between profiles.

use super::{plane::PlaneFit, robust::TUKEY, surface::Surface};

/// Heights of whole profiles over a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BetweenProfiles {
    /// Standard deviation of the profiles' mean distances from the plane, metres.
    pub sigma_m: f64,
    /// One standard deviation of that estimate, for normal and independent profiles, metres.
    pub of_sigma_m: f64,
    /// Number of profiles used.
    pub num_profiles: usize,
}

/// Compares the profiles' mean distances from their common plane, without its outliers. Leaves out profiles with less
/// than half as many points as the median profile: they show another part of the plane. Returns `None` if fewer than
/// three profiles remain.
///
/// The plane may be inclined: only deviations from it count.
#[must_use]
pub fn of(surface: &Surface, plane: &PlaneFit) -> Option<BetweenProfiles> {
    let is_plane = |distance: &f64| distance.abs() <= TUKEY * plane.scatter_m;
    let mut profiles: Vec<(usize, f64)> = Vec::new();
    for row in surface.rows() {
        // NaN fails every comparison.
        let distances = row.iter().map(|point| plane.distance_m(point)).filter(is_plane);
        let (num, sum) = distances.fold((0, 0.0), |(num, sum), d| (num + 1, sum + d));
        if num > 0 {
            profiles.push((num, sum / num as f64));
        }
    }
    profiles.sort_by_key(|(num, _)| *num);
    let (usual, _) = *profiles.get(profiles.len() / 2)?;
    let taken = profiles.iter().filter(|(num, _)| 2 * num >= usual);
    let means: Vec<f64> = taken.map(|(_, mean)| *mean).collect();
    let num_profiles = means.len();
    if num_profiles < 3 {
        return None;
    }
    let middle = means.iter().sum::<f64>() / num_profiles as f64;
    let squares: f64 = means.iter().map(|mean| (mean - middle).powi(2)).sum();
    // The plane fit has removed the mean of all, and an inclination from the first to the last.
    let freedom = (num_profiles - 2) as f64;
    let sigma_m = (squares / freedom).sqrt();
    // For a normal sample: the standard deviation of a standard deviation, to first order.
    Some(BetweenProfiles { sigma_m, of_sigma_m: sigma_m / (2.0 * freedom).sqrt(), num_profiles })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrology::{
        noise::{noise, share, surface},
        plane,
    };

    /// Returns an inclined plane whose rows jump by 3 µm, with a noise of 2 µm in their 60 points.
    fn jumping(seed: u64) -> Surface {
        let jumps = noise(1, 50, 1, 1000 + seed);
        let mut surface = surface(|x, y| 0.01 * x + 0.02 * y, 2e-6, 1, seed);
        for (at, point) in surface.points.iter_mut().enumerate() {
            point.z += 3e-6 * jumps[at / surface.width];
        }
        surface
    }

    #[test]
    fn the_scatter_of_rows_is_found_and_its_uncertainty_is_true() {
        let truth = 3e-6_f64.hypot(2e-6 / 60.0_f64.sqrt());
        let covered = share(300, |seed| {
            let surface = jumping(seed);
            let found = of(&surface, &plane::fit(&surface).unwrap()).unwrap();
            assert_eq!(found.num_profiles, 50);
            (found.sigma_m - truth).abs() < 1.96 * found.of_sigma_m
        });
        // 94 %: the interval is as wide as the estimate, which is as often too small as too large.
        assert!((0.90..=0.98).contains(&covered), "{covered}");
    }

    #[test]
    fn short_profiles_and_objects_on_the_plane_do_not_count() {
        let mut surface = jumping(1);
        let before = of(&surface, &plane::fit(&surface).unwrap()).unwrap();
        let width = surface.width;
        for point in &mut surface.points[..width - 20] {
            point.z = f64::NAN;
        }
        for point in &mut surface.points[width - 20..width] {
            point.z += 20e-6;
        }
        // 1 mm high, on every row.
        for row in surface.points.chunks_exact_mut(width) {
            row[30].z += 1e-3;
        }
        let plane = plane::fit(&surface).unwrap();
        let after = of(&surface, &plane).unwrap();
        assert_eq!(after.num_profiles, 49);
        assert!((after.sigma_m / before.sigma_m - 1.0).abs() < 0.1, "{before:?} {after:?}");
        surface.points.truncate(width);
        assert_eq!(of(&surface, &plane), None, "one profile repeats nothing");
    }
}
