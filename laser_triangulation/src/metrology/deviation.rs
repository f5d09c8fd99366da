//! Deviations of a part's upper side from its smooth shape: connected areas above or below a surface of second order.
//!
//! 1. The part is separated from the table (`on_part`).
//! 2. A surface of second order is fitted to it by least squares, again and again without the outliers.
//! 3. Neighbouring points that leave this reference on the same side by more than a threshold form an area.
//! 4. An area that reaches the edge of the part belongs to the part's shape and is dropped; so is a small one.

use nalgebra::{Point3, SMatrix, SVector};

use super::{
    part::on_part,
    surface::{Surface, is_measured},
};
use crate::statistics::sigma_about_zero;

/// Number of fits after the first, each without the outliers of the one before.
const NUM_REFITS: usize = 30;
/// Points farther from the reference than this many standard deviations are outliers.
const OUTLIER_SIGMAS: f64 = 2.0;
/// Smallest standard deviation, metres: keeps the points of a noise-free scan from becoming outliers.
const MIN_SIGMA_M: f64 = 1e-7;

/// Coefficients of z over (x, y), or the terms they multiply; lengths in millimetres, which conditions the equations.
type Quadratic = SVector<f64, 6>;

/// A connected area that leaves the reference by more than the threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// Mean of its points (x, y), metres in the frame of the part.
    pub center_m: [f64; 2],
    /// Largest distance from the reference along z, metres; negative below it.
    pub height_m: f64,
    /// Area seen from above, square metres.
    pub area_m2: f64,
}

/// Returns the areas on the part that leave its smooth shape by more than `threshold_m` over at least `min_area_m2`,
/// the highest first. Empty if the points do not determine a reference.
#[must_use]
pub fn deviations(surface: &Surface, threshold_m: f64, min_area_m2: f64) -> Vec<Deviation> {
    let on_part = on_part(surface);
    let Some(reference) = fit_reference(surface, &on_part) else { return Vec::new() };
    let residuals_m: Vec<f64> = (surface.points.iter().zip(&on_part))
        .map(|(point, &on_part)| if on_part { residual_m(&reference, point) } else { f64::NAN })
        .collect();
    let [along_x_m, along_y_m] = surface.pitch_m();
    let mut found: Vec<Deviation> = Areas::new(surface, &residuals_m, threshold_m)
        .filter(|area| !area.is_at_edge)
        .map(|area| {
            let area_m2 = area.points.len() as f64 * along_x_m * along_y_m;
            summary(surface, &residuals_m, &area.points, area_m2)
        })
        .filter(|deviation| deviation.area_m2 >= min_area_m2)
        .collect();
    found.sort_by(|a, b| b.height_m.total_cmp(&a.height_m));
    found
}

fn summary(surface: &Surface, residuals_m: &[f64], points: &[usize], area_m2: f64) -> Deviation {
    let mean_m = |axis: usize| {
        points.iter().map(|&at| surface.points[at][axis]).sum::<f64>() / points.len() as f64
    };
    let height_m = (points.iter().map(|&at| residuals_m[at]))
        .fold(0.0_f64, |highest, r| if r.abs() > highest.abs() { r } else { highest });
    Deviation { center_m: [mean_m(0), mean_m(1)], height_m, area_m2 }
}

/// Fits the reference to the points on the part, repeatedly without the outliers.
fn fit_reference(surface: &Surface, on_part: &[bool]) -> Option<Quadratic> {
    let all: Vec<&Point3<f64>> =
        surface.points.iter().zip(on_part).filter(|(_, on)| **on).map(|(point, _)| point).collect();
    let mut reference = least_squares(&all)?;
    for _ in 0..NUM_REFITS {
        let distance_m = |point: &Point3<f64>| residual_m(&reference, point).abs();
        let mut distances_m: Vec<f64> = all.iter().map(|point| distance_m(point)).collect();
        let limit_m = OUTLIER_SIGMAS * sigma_about_zero(&mut distances_m)?.max(MIN_SIGMA_M);
        let used: Vec<&Point3<f64>> =
            all.iter().copied().filter(|point| distance_m(point) <= limit_m).collect();
        reference = least_squares(&used)?;
    }
    Some(reference)
}

fn terms(point: &Point3<f64>) -> Quadratic {
    let [x, y] = [1e3 * point.x, 1e3 * point.y];
    Quadratic::from([1.0, x, y, x * x, x * y, y * y])
}

fn residual_m(reference: &Quadratic, point: &Point3<f64>) -> f64 {
    point.z - 1e-3 * reference.dot(&terms(point))
}

fn least_squares(points: &[&Point3<f64>]) -> Option<Quadratic> {
    let mut normal = SMatrix::<f64, 6, 6>::zeros();
    let mut right = Quadratic::zeros();
    for point in points {
        let terms = terms(point);
        normal += terms * terms.transpose();
        right += terms * (1e3 * point.z);
    }
    normal.cholesky().map(|factor| factor.solve(&right))
}

/// Neighbouring points whose residuals leave the threshold on the same side.
struct Area {
    /// Indices of the points.
    points: Vec<usize>,
    /// True if one of them is next to the table or on the border of the scan.
    is_at_edge: bool,
}

/// Iterator over the areas of a scan.
struct Areas<'a> {
    surface: &'a Surface,
    /// NaN off the part.
    residuals_m: &'a [f64],
    threshold_m: f64,
    visited: Vec<bool>,
    next: usize,
}

impl<'a> Areas<'a> {
    fn new(surface: &'a Surface, residuals_m: &'a [f64], threshold_m: f64) -> Self {
        let visited = vec![false; residuals_m.len()];
        Self { surface, residuals_m, threshold_m, visited, next: 0 }
    }

    /// Collects all points connected to `seed`.
    fn grow(&mut self, seed: usize) -> Area {
        let (width, len) = (self.surface.width, self.residuals_m.len());
        let is_raised = self.residuals_m[seed] > 0.0;
        let mut area = Area { points: vec![seed], is_at_edge: false };
        let mut grown = 0;
        while let Some(&at) = area.points.get(grown) {
            grown += 1;
            let column = at % width;
            area.is_at_edge |=
                column == 0 || column == width - 1 || at < width || at + width >= len;
            let in_row = [(column > 0).then(|| at - 1), (column + 1 < width).then_some(at + 1)];
            let in_column = [at.checked_sub(width), Some(at + width).filter(|&next| next < len)];
            for next in in_row.into_iter().chain(in_column).flatten() {
                // A measured point without a residual is on the table.
                area.is_at_edge |=
                    self.residuals_m[next].is_nan() && is_measured(&self.surface.points[next]);
                if self.is_unvisited(next) && (self.residuals_m[next] > 0.0) == is_raised {
                    self.visited[next] = true;
                    area.points.push(next);
                }
            }
        }
        area
    }

    /// Returns true if a point leaves the threshold and is in no area yet.
    fn is_unvisited(&self, at: usize) -> bool {
        self.residuals_m[at].abs() > self.threshold_m && !self.visited[at]
    }
}

impl Iterator for Areas<'_> {
    type Item = Area;

    fn next(&mut self) -> Option<Area> {
        let seed = (self.next..self.residuals_m.len()).find(|&at| self.is_unvisited(at))?;
        self.next = seed + 1;
        self.visited[seed] = true;
        Some(self.grow(seed))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Returns 101 x 81 points 0.1 x 0.2 mm apart, 10 x 16 mm, from a height in metres over (x, y) in millimetres.
    pub(in crate::metrology) fn surface(height_m: impl Fn(f64, f64) -> f64) -> Surface {
        let mut surface = Surface { width: 101, points: Vec::new() };
        for row in 0..81_u8 {
            for column in 0..101_u8 {
                let (x, y) = (f64::from(column) * 0.1 - 5.0, f64::from(row) * 0.2);
                surface.points.push(Point3::new(x * 1e-3, y * 1e-3, height_m(x, y)));
            }
        }
        surface
    }

    /// Returns the height in metres of a warped top 2 mm above a table, 8 x 14 mm in the middle of the scan.
    fn warped_m(x: f64, y: f64) -> f64 {
        if x.abs() > 4.0 || (y - 8.0).abs() > 7.0 {
            return 0.0;
        }
        1e-3 * (2.0 + 0.01 * x + 0.02 * y + 0.003 * x * x - 0.001 * x * y)
    }

    #[test]
    fn a_warp_alone_is_no_deviation() {
        assert_eq!(deviations(&surface(warped_m), 5e-6, 0.0), []);
    }

    #[test]
    fn raised_and_sunken_areas_are_found_in_their_places() {
        let scan = surface(|x, y| {
            let within = |x0: f64, y0: f64, radius: f64| (x - x0).hypot(y - y0) < radius;
            let raised = if within(1.0, 5.0, 1.0) { 2e-4 } else { 0.0 };
            let sunken = if within(-2.0, 11.0, 0.8) { -1e-4 } else { 0.0 };
            let is_hole = within(1.0, 5.0, 0.15);
            if is_hole { f64::NAN } else { warped_m(x, y) + raised + sunken }
        });
        let found = deviations(&scan, 5e-5, 1e-7);
        let expected = [([1e-3, 5e-3], 2e-4, 3.07e-6), ([-2e-3, 11e-3], -1e-4, 2.01e-6)];
        assert_eq!(found.len(), 2, "{found:?}");
        for (found, (center_m, height_m, area_m2)) in found.iter().zip(expected) {
            assert!((found.center_m[0] - center_m[0]).abs() < 3e-5);
            assert!((found.center_m[1] - center_m[1]).abs() < 3e-5);
            assert!((found.height_m - height_m).abs() < 1e-6);
            assert!((found.area_m2 / area_m2 - 1.0).abs() < 0.1, "{found:?}");
        }
        assert_eq!(deviations(&scan, 1.5e-4, 1e-7).len(), 1, "threshold");
        assert_eq!(deviations(&scan, 5e-5, 2.5e-6).len(), 1, "area");
    }

    #[test]
    fn a_rim_belongs_to_the_part() {
        let scan = surface(|x, y| {
            let is_rim = x.abs() > 3.5 && warped_m(x, y) > 0.0;
            warped_m(x, y) - if is_rim { 1.5e-4 } else { 0.0 }
        });
        assert_eq!(deviations(&scan, 5e-5, 0.0), []);
    }

    #[test]
    fn an_empty_scan_has_no_deviations() {
        assert_eq!(deviations(&surface(|_, _| f64::NAN), 1e-5, 0.0), []);
        assert_eq!(deviations(&Surface::default(), 1e-5, 0.0), []);
    }
}
