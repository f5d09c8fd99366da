//! What stands out of the part's smooth shape: connected places above or below a surface of second order.

use nalgebra::{SMatrix, SVector};

use super::surface::{Surface, is_measured};
use crate::scanner::scan::Point;

/// Rounds of fitting and leaving out.
const ROUNDS: usize = 30;
/// Points further from the reference than so many standard deviations do not shape it.
const OUTLIER_SIGMAS: f64 = 2.0;
/// From the median absolute deviation to the standard deviation of a normal distribution.
const SIGMA_PER_MAD: f64 = 1.4826;
/// A reference never follows the points closer than this, metres: a noise-free scan must not leave out everything.
const MIN_SIGMA_M: f64 = 1e-7;

/// z over (x, y), lengths in millimetres so that the equations are well conditioned.
type Coefficients = SVector<f64, 6>;

/// A connected place that leaves the reference by more than the threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// Where it is, the mean of its points (x, y), metres.
    pub center_m: [f64; 2],
    /// Largest distance from the reference, metres; negative: below it.
    pub height_m: f64,
    /// Area, square metres.
    pub area_m2: f64,
}

/// Finds the places on the upper half of the scan that leave its smooth shape by more than `threshold_m` over more than
/// `min_area_m2`, the highest first. A place that reaches the edge of the part belongs to its shape.
pub fn deviations(surface: &Surface, threshold_m: f64, min_area_m2: f64) -> Vec<Deviation> {
    let on_part = surface.on_part();
    let Some(reference) = fit_reference(surface, &on_part) else { return Vec::new() };
    let residuals_m: Vec<f64> = (surface.points.iter().zip(&on_part))
        .map(|(point, &on_part)| if on_part { residual_m(&reference, point) } else { f64::NAN })
        .collect();
    let [along_x_m, along_y_m] = surface.pitch_m().map(f64::from);
    let mut found: Vec<Deviation> = Regions::new(surface, &residuals_m, threshold_m)
        .filter_map(|region| {
            let area_m2 = region.len() as f64 * along_x_m * along_y_m;
            (area_m2 >= min_area_m2).then(|| summary(surface, &residuals_m, &region, area_m2))
        })
        .collect();
    found.sort_by(|a, b| b.height_m.total_cmp(&a.height_m));
    found
}

fn summary(surface: &Surface, residuals_m: &[f64], region: &[usize], area_m2: f64) -> Deviation {
    let mean_m = |axis: usize| {
        let sum: f64 = region.iter().map(|&at| f64::from(surface.points[at][axis])).sum();
        sum / region.len() as f64
    };
    let height_m = (region.iter().map(|&at| residuals_m[at]))
        .fold(0.0_f64, |highest, r| if r.abs() > highest.abs() { r } else { highest });
    Deviation { center_m: [mean_m(0), mean_m(1)], height_m, area_m2 }
}

/// Least squares over the part, again and again without what lies too far off.
fn fit_reference(surface: &Surface, on_part: &[bool]) -> Option<Coefficients> {
    let mut used: Vec<&Point> =
        surface.points.iter().zip(on_part).filter(|(_, on)| **on).map(|(point, _)| point).collect();
    let all = used.clone();
    let mut reference = least_squares(&used)?;
    for _ in 0..ROUNDS {
        let mut distances: Vec<f64> =
            all.iter().map(|point| residual_m(&reference, point).abs()).collect();
        distances.sort_by(f64::total_cmp);
        let sigma_m = (SIGMA_PER_MAD * distances[distances.len() / 2]).max(MIN_SIGMA_M);
        used.clear();
        used.extend(
            all.iter()
                .filter(|point| residual_m(&reference, point).abs() <= OUTLIER_SIGMAS * sigma_m),
        );
        reference = least_squares(&used)?;
    }
    Some(reference)
}

fn terms(point: &Point) -> Coefficients {
    let [x, y] = [point[0], point[1]].map(|metres| 1e3 * f64::from(metres));
    Coefficients::from([1.0, x, y, x * x, x * y, y * y])
}

fn residual_m(reference: &Coefficients, point: &Point) -> f64 {
    f64::from(point[2]) - 1e-3 * reference.dot(&terms(point))
}

fn least_squares(points: &[&Point]) -> Option<Coefficients> {
    let mut normal = SMatrix::<f64, 6, 6>::zeros();
    let mut right = Coefficients::zeros();
    for point in points {
        let terms = terms(point);
        normal += terms * terms.transpose();
        right += terms * (1e3 * f64::from(point[2]));
    }
    normal.cholesky().map(|factor| factor.solve(&right))
}

/// Connected sets of points whose residuals leave the threshold on the same side, each as indices.
struct Regions<'a> {
    surface: &'a Surface,
    residuals_m: &'a [f64],
    threshold_m: f64,
    visited: Vec<bool>,
    next: usize,
}

impl<'a> Regions<'a> {
    fn new(surface: &'a Surface, residuals_m: &'a [f64], threshold_m: f64) -> Self {
        let visited = vec![false; residuals_m.len()];
        Self { surface, residuals_m, threshold_m, visited, next: 0 }
    }

    /// All points connected to `seed`, and whether they reach the table or the border of the scan.
    fn grow(&mut self, seed: usize) -> (Vec<usize>, bool) {
        let (width, len) = (self.surface.width, self.residuals_m.len());
        let raised = self.residuals_m[seed] > 0.0;
        let (mut region, mut at_edge) = (vec![seed], false);
        let mut grown = 0;
        while let Some(&at) = region.get(grown) {
            grown += 1;
            let column = at % width;
            at_edge |= column == 0 || column == width - 1 || at < width || at + width >= len;
            let sideways = [(column > 0).then(|| at - 1), (column + 1 < width).then_some(at + 1)];
            let lengthways = [at.checked_sub(width), Some(at + width).filter(|&next| next < len)];
            for next in sideways.into_iter().chain(lengthways).flatten() {
                // No residual, but measured: the table.
                at_edge |=
                    self.residuals_m[next].is_nan() && is_measured(&self.surface.points[next]);
                if self.leaves(next)
                    && (self.residuals_m[next] > 0.0) == raised
                    && !self.visited[next]
                {
                    self.visited[next] = true;
                    region.push(next);
                }
            }
        }
        (region, at_edge)
    }

    fn leaves(&self, at: usize) -> bool {
        self.residuals_m[at].abs() > self.threshold_m
    }
}

impl Iterator for Regions<'_> {
    type Item = Vec<usize>;

    fn next(&mut self) -> Option<Vec<usize>> {
        while self.next < self.residuals_m.len() {
            let seed = self.next;
            self.next += 1;
            if self.visited[seed] || !self.leaves(seed) {
                continue;
            }
            self.visited[seed] = true;
            let (region, at_edge) = self.grow(seed);
            if !at_edge {
                return Some(region);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::{super::surface::tests::surface, *};

    /// A warped top 2 mm over a table, 8 x 14 mm in the middle of the scan, in metres over millimetres.
    fn warped_m(x: f32, y: f32) -> f32 {
        if x.abs() > 4.0 || (y - 8.0).abs() > 7.0 {
            return 0.0;
        }
        1e-3 * (2.0 + 0.01 * x + 0.02 * y + 0.003 * x * x - 0.001 * x * y)
    }

    fn within(x: f32, y: f32, center: (f32, f32), radius: f32) -> bool {
        (x - center.0).hypot(y - center.1) < radius
    }

    #[test]
    fn a_warp_alone_is_no_deviation() {
        assert_eq!(deviations(&surface(warped_m), 5e-6, 0.0), []);
    }

    #[test]
    fn steps_up_and_down_are_found_where_they_are() {
        let scan = surface(|x, y| {
            let raised = if within(x, y, (1.0, 5.0), 1.0) { 2e-4 } else { 0.0 };
            let sunken = if within(x, y, (-2.0, 11.0), 0.8) { -1e-4 } else { 0.0 };
            let hole = within(x, y, (1.0, 5.0), 0.15);
            if hole { f32::NAN } else { warped_m(x, y) + raised + sunken }
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
            let rim = x.abs() > 3.5 && warped_m(x, y) > 0.0;
            warped_m(x, y) - if rim { 1.5e-4 } else { 0.0 }
        });
        assert_eq!(deviations(&scan, 5e-5, 0.0), []);
    }

    #[test]
    fn nothing_measured_is_nothing_found() {
        assert_eq!(deviations(&surface(|_, _| f32::NAN), 1e-5, 0.0), []);
        assert_eq!(deviations(&Surface::default(), 1e-5, 0.0), []);
    }
}
