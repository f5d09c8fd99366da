//! A sphere through measured points: position, radius and roundness; and the distance of two spheres.

use nalgebra::{Matrix4, Point3, Vector3};

use super::{
    correlation::inflation,
    form::{Form, form},
    plane::FormError,
    robust::{self, Equation},
    surface::Surface,
};

const MAX_ROUNDS: usize = 50;
const MIN_POINTS: usize = 20;

/// A fitted sphere with its uncertainty.
#[derive(Clone, Debug)]
pub struct SphereFit {
    /// Centre, metres.
    pub center_m: Point3<f64>,
    /// Radius, metres.
    pub radius_m: f64,
    /// Covariance of centre and radius, square metres.
    pub covariance: Matrix4<f64>,
    /// Robust standard deviation of the points about the sphere, metres.
    pub scatter_m: f64,
    /// Roundness over all points, outliers included.
    pub form: Form,
    /// Number of points used.
    pub num_points: usize,
    /// Number of points with zero weight: farther away than 4.7 standard deviations.
    pub num_outliers: usize,
    /// Number of independent points with the same information: errors of neighbours are correlated.
    pub effective_points: f64,
}

impl SphereFit {
    /// Returns one standard deviation of the radius, metres.
    #[must_use]
    pub fn radius_sigma_m(&self) -> f64 {
        self.covariance[(3, 3)].sqrt()
    }

    /// Returns one standard deviation of each coordinate of the centre, metres.
    #[must_use]
    pub fn center_sigma_m(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.covariance[(i, i)].sqrt())
    }
}

/// Fits the sphere with the smallest distances from the points along its radii, by Tukey's weights: Gauss-Newton steps
/// from the algebraic sphere, each by robust least squares, until they converge.
///
/// # Errors
/// Too few points, points that are no surface ([`Surface::check`]), or points that are nearly flat.
pub fn fit(surface: &Surface) -> Result<SphereFit, FormError> {
    let points: Vec<Point3<f64>> = surface.measured().map(|(_, point)| *point).collect();
    let found = points.len();
    if found < MIN_POINTS {
        return Err(FormError::TooFew { found, needed: MIN_POINTS });
    }
    surface.check()?;
    let degenerate = || FormError::Degenerate { found, what: "a sphere" };
    let (mut center, mut radius) = algebraic(&points).ok_or_else(degenerate)?;
    for _ in 0..MAX_ROUNDS {
        let equations: Vec<Equation<4>> = points
            .iter()
            .map(|point| {
                let from = point - center;
                let distance = from.norm();
                let n = from / distance;
                Equation { row: [n.x, n.y, n.z, 1.0].into(), value: distance - radius }
            })
            .collect();
        let solved = robust::solve(&equations).ok_or_else(degenerate)?;
        center += Vector3::new(solved.x[0], solved.x[1], solved.x[2]);
        radius += solved.x[3];
        if radius.is_nan() || radius <= 0.0 {
            return Err(degenerate());
        }
        if solved.x.amax() < 1e-10 * radius {
            return Ok(finish(surface, &solved, center, radius));
        }
    }
    Err(degenerate())
}

fn finish(
    surface: &Surface,
    solved: &robust::Fit<4>,
    center_m: Point3<f64>,
    radius_m: f64,
) -> SphereFit {
    let residuals = surface.spread(&solved.residuals, &solved.weights);
    let [along, across] = inflation(&residuals, surface.width);
    let num_points = solved.residuals.len();
    let num_outliers = solved.weights.iter().filter(|weight| **weight <= 0.0).count();
    let effective_points = (num_points - num_outliers) as f64 / (along * across);
    let nothing = Form { d95_m: f64::NAN, d95_sigma_m: f64::NAN, peak_to_valley_m: f64::NAN };
    SphereFit {
        center_m,
        radius_m,
        covariance: solved.covariance * (along * across),
        scatter_m: solved.scale,
        form: form(&solved.residuals, effective_points).unwrap_or(nothing),
        num_points,
        num_outliers,
        effective_points,
    }
}

/// |p|² = 2 c·p + (R² - |c|²) is linear in the unknowns (Coope 1993).
fn algebraic(points: &[Point3<f64>]) -> Option<(Point3<f64>, f64)> {
    let middle = points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / points.len() as f64;
    let equations: Vec<Equation<4>> = points
        .iter()
        .map(|point| {
            let from = point.coords - middle;
            let row = [2.0 * from.x, 2.0 * from.y, 2.0 * from.z, 1.0].into();
            Equation { row, value: from.norm_squared() }
        })
        .collect();
    let x = robust::solve(&equations)?.x;
    let center = Vector3::new(x[0], x[1], x[2]);
    let square = x[3] + center.norm_squared();
    (square > 0.0 && square.is_finite()).then(|| (Point3::from(center + middle), square.sqrt()))
}

/// Returns the distance of two centres and one standard deviation of it, metres.
#[must_use]
pub fn distance_m(from: &SphereFit, to: &SphereFit) -> [f64; 2] {
    let between = to.center_m - from.center_m;
    let distance = between.norm();
    let along = between / distance;
    let covariance = from.covariance + to.covariance;
    let variance = (along.transpose() * covariance.fixed_view::<3, 3>(0, 0) * along)[(0, 0)];
    [distance, variance.max(0.0).sqrt()]
}

#[cfg(test)]
mod tests;
