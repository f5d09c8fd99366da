//! The volume between a measured surface and a plane.

use nalgebra::{Point3, Vector3};

use super::{height_map::RegularHeightMap, plane::PlaneFit, surface::Region};

/// A measured volume with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Volume {
    /// Volume above the plane minus volume below it, cubic metres.
    pub volume_m3: f64,
    /// Volume above the plane, cubic metres.
    pub above_m3: f64,
    /// Volume below the plane, positive, cubic metres.
    pub below_m3: f64,
    /// One standard deviation of `volume_m3` from the plane and from the scatter of the points, cubic metres.
    pub sigma_m3: f64,
    /// Measured area, square metres, seen from above.
    pub area_m2: f64,
    /// Area inside the region that was not measured, square metres: its volume is not in the sum.
    pub missing_m2: f64,
}

/// Sums the heights over the plane, over the cells whose middle lies in the region. `sigma_z_m` is one standard
/// deviation of a point; `effective_points` is the number of independent points.
#[must_use]
pub fn over_plane(
    map: &RegularHeightMap,
    region: &Region,
    plane: &PlaneFit,
    sigma_z_m: f64,
    effective_points: f64,
) -> Volume {
    let cell_m2 = map.layout.cell_m.powi(2);
    let width = map.layout.width as usize;
    let (mut above, mut below, mut num, mut num_missing) = (0.0, 0.0, 0_usize, 0_usize);
    // Derivatives of the sum with respect to the plane's height and its two slopes.
    let mut gradient = Vector3::zeros();
    for (at, z_m) in map.z_m.iter().enumerate() {
        let [x_m, y_m] = map.layout.center_m(at % width, at / width);
        if !region.contains(x_m, y_m) {
            continue;
        }
        if !z_m.is_finite() {
            num_missing += 1;
            continue;
        }
        let base_m = plane.height_m(x_m, y_m);
        let over = f64::from(*z_m) - base_m;
        above += over.max(0.0);
        below += (-over).max(0.0);
        num += 1;
        let from = Point3::new(x_m, y_m, base_m) - plane.center_m;
        gradient +=
            Vector3::new(1.0, from.dot(&plane.directions[0]), from.dot(&plane.directions[1]));
    }
    // Heights along z are 1/cos of those along the normal.
    let steep = 1.0 / plane.normal.z;
    let by_plane = (gradient.transpose() * plane.covariance * gradient)[(0, 0)] * steep * steep;
    let area_m2 = num as f64 * cell_m2;
    let by_points = num as f64 * sigma_z_m / effective_points.max(1.0).sqrt();
    Volume {
        volume_m3: (above - below) * cell_m2,
        above_m3: above * cell_m2,
        below_m3: below * cell_m2,
        sigma_m3: (by_plane + by_points.powi(2)).sqrt() * cell_m2,
        area_m2,
        missing_m2: num_missing as f64 * cell_m2,
    }
}

#[cfg(test)]
mod tests;
