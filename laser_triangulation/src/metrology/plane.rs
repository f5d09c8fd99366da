//! A plane through measured points, and its flatness.

use nalgebra::{Matrix3, Point3, Rotation3, Vector3};
use thiserror::Error;

use super::{
    correlation::inflation,
    form::{Form, form},
    no_surface::NoSurface,
    robust::{self, Equation},
    surface::Surface,
};
use crate::scanner::pose::perpendicular_basis;

/// Most rounds of rotating the frame to the plane; the second one changes little unless there are many outliers.
const MAX_ROUNDS: usize = 20;
/// Rotation below which the iteration has converged, radians.
const STANDSTILL_RAD: f64 = 1e-9;
const MIN_POINTS: usize = 20;
/// Largest inclination of a plane that a profiler can see, radians.
const STEEPEST_RAD: f64 = 1.4;

/// A fitted plane with its uncertainty.
#[derive(Clone, Debug)]
pub struct PlaneFit {
    /// Unit normal, pointing upwards.
    pub normal: Vector3<f64>,
    /// The plane's point over the middle of the points, metres.
    pub center_m: Point3<f64>,
    /// One standard deviation of the plane's height at `center_m`, along the normal, metres.
    pub sigma_m: f64,
    /// One standard deviation of the normal's tilts about the plane's two directions, radians.
    pub tilt_sigma_rad: [f64; 2],
    /// Covariance of height and of the slopes along `directions`, at `center_m`.
    pub covariance: Matrix3<f64>,
    /// Two directions in the plane, the first nearly along x.
    pub directions: [Vector3<f64>; 2],
    /// Robust standard deviation of the points about the plane, metres.
    pub scatter_m: f64,
    /// Flatness over all points, outliers included.
    pub flatness: Form,
    /// Number of points used.
    pub num_points: usize,
    /// Number of points with zero weight: farther away than 4.7 standard deviations.
    pub num_outliers: usize,
    /// Number of independent points with the same information: errors of neighbours are correlated.
    pub effective_points: f64,
}

/// The reason why no form can be fitted.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum FormError {
    /// Too few points.
    #[error("{found} measured points in the region, {needed} or more are needed")]
    TooFew {
        /// Points there.
        found: usize,
        /// Points needed.
        needed: usize,
    },
    /// The points are no surface.
    #[error(transparent)]
    NoSurface(#[from] NoSurface),
    /// The plane through the points stands upright: they extend further in height than across.
    #[error(
        "a plane through the {found} points stands upright: they differ more in height than they extend across; choose a wider \
         region, or more profiles"
    )]
    Upright {
        /// Points found.
        found: usize,
    },
    /// The points do not determine the form.
    #[error("the {found} points lie so that {what} through them is not determined")]
    Degenerate {
        /// Points found.
        found: usize,
        /// Name of the form.
        what: &'static str,
    },
}

impl PlaneFit {
    /// Returns the distance of a point from the plane, positive above it, metres.
    #[must_use]
    pub fn distance_m(&self, point: &Point3<f64>) -> f64 {
        (point - self.center_m).dot(&self.normal)
    }

    /// Returns the height of the plane at (x, y), metres.
    #[must_use]
    pub fn height_m(&self, x_m: f64, y_m: f64) -> f64 {
        let (dx, dy) = (x_m - self.center_m.x, y_m - self.center_m.y);
        self.center_m.z - (self.normal.x * dx + self.normal.y * dy) / self.normal.z
    }

    /// Returns the angle between the plane and the horizontal, radians.
    #[must_use]
    pub fn tilt_rad(&self) -> f64 {
        self.normal.xy().norm().atan2(self.normal.z)
    }

    /// Returns the number of independent points among `num_points` others, assuming the correlation of the plane's own.
    #[must_use]
    pub fn effective_among(&self, num_points: usize) -> f64 {
        let share = self.effective_points / (self.num_points - self.num_outliers).max(1) as f64;
        share * num_points as f64
    }
}

/// [`fit`] to the points of a surface for which `is_used` is true; both have the same order.
///
/// # Errors
/// Those of [`fit`].
pub fn fit_where(surface: &Surface, is_used: &[bool]) -> Result<PlaneFit, FormError> {
    let mut used = surface.clone();
    for (point, is_used) in used.points.iter_mut().zip(is_used) {
        if !is_used {
            point.z = f64::NAN;
        }
    }
    fit(&used)
}

/// Fits the plane with the smallest distances from the points along its normal, by Tukey's weights; see Huber 1981.
/// Uncertainties account for the correlation of neighbouring points' errors.
///
/// # Errors
/// Too few points, points that are no surface ([`Surface::check`]), points on one line within their noise, or a plane
/// steeper than 80°.
pub fn fit(surface: &Surface) -> Result<PlaneFit, FormError> {
    let points: Vec<Point3<f64>> = surface.measured().map(|(_, point)| *point).collect();
    let found = points.len();
    if found < MIN_POINTS {
        return Err(FormError::TooFew { found, needed: MIN_POINTS });
    }
    surface.check()?;
    let degenerate = || FormError::Degenerate { found, what: "a plane" };
    let middle = Point3::from(points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / found as f64);
    let mut normal = narrowest(&points, &middle).ok_or_else(degenerate)?;
    for round in 1..=MAX_ROUNDS {
        let directions = perpendicular_basis(&normal);
        let equations: Vec<Equation<3>> = points
            .iter()
            .map(|point| {
                let from = point - middle;
                let [u, v] = directions.map(|direction| from.dot(&direction));
                Equation { row: [1.0, u, v].into(), value: from.dot(&normal) }
            })
            .collect();
        let solved = robust::solve(&equations).ok_or_else(degenerate)?;
        let [height, along, across] = [solved.x[0], solved.x[1], solved.x[2]];
        normal = (normal - along * directions[0] - across * directions[1]).normalize();
        let turn_rad = along.hypot(across);
        if turn_rad < STANDSTILL_RAD || round == MAX_ROUNDS {
            let fit = finish(surface, &solved, normal, middle + height * normal);
            // Among scattered points the weights may change in every round: stop when the remaining rotation is below
            // the fit's uncertainty.
            let [about_x, about_y] = fit.tilt_sigma_rad;
            if turn_rad >= STANDSTILL_RAD.max(about_x.hypot(about_y)) {
                return Err(degenerate());
            }
            if fit.tilt_rad() > STEEPEST_RAD {
                return Err(FormError::Upright { found });
            }
            if surface.is_laser_plane(&normal) {
                return Err(NoSurface::OnePlace { profiles: surface.num_profiles() }.into());
            }
            return Ok(fit);
        }
    }
    Err(degenerate())
}

fn finish(
    surface: &Surface,
    solved: &robust::Fit<3>,
    normal: Vector3<f64>,
    center_m: Point3<f64>,
) -> PlaneFit {
    let residuals = surface.spread(&solved.residuals, &solved.weights);
    let [along, across] = inflation(&residuals, surface.width);
    let covariance = solved.covariance * (along * across);
    let num_points = solved.residuals.len();
    let num_outliers = solved.weights.iter().filter(|weight| **weight <= 0.0).count();
    let effective_points = (num_points - num_outliers) as f64 / (along * across);
    // The caller has checked that there are enough points.
    let flatness = form(&solved.residuals, effective_points).unwrap_or(Form {
        d95_m: f64::NAN,
        d95_sigma_m: f64::NAN,
        peak_to_valley_m: f64::NAN,
    });
    PlaneFit {
        normal,
        center_m,
        sigma_m: covariance[(0, 0)].sqrt(),
        tilt_sigma_rad: [covariance[(1, 1)].sqrt(), covariance[(2, 2)].sqrt()],
        covariance,
        directions: perpendicular_basis(&normal),
        scatter_m: solved.scale,
        flatness,
        num_points,
        num_outliers,
        effective_points,
    }
}

/// Returns the direction of the points' smallest extent, upwards; `None` if they extend in one direction only.
fn narrowest(points: &[Point3<f64>], middle: &Point3<f64>) -> Option<Vector3<f64>> {
    let mut spread = Matrix3::zeros();
    for point in points {
        let from = point - middle;
        spread += from * from.transpose();
    }
    let eigen = spread.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let [_, second, largest] = order.map(|i| eigen.eigenvalues[i].max(0.0));
    if second.is_nan() || second <= 1e-12 * largest {
        return None;
    }
    let normal = eigen.eigenvectors.column(order[0]).into_owned();
    Some(if normal.z < 0.0 { -normal } else { normal })
}

/// Returns the motion that levels a plane at height 0: the smallest rotation of its normal to z, about its middle.
#[must_use]
pub fn leveling(plane: &PlaneFit) -> nalgebra::Isometry3<f64> {
    let turn = Rotation3::rotation_between(&plane.normal, &Vector3::z())
        .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let target = Point3::new(plane.center_m.x, plane.center_m.y, 0.0);
    let shift = target - turn * plane.center_m;
    nalgebra::Isometry3::from_parts(shift.into(), turn.into())
}

#[cfg(test)]
mod tests;
