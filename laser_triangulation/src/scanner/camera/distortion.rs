//! Lens distortion on the plane z = 1: OpenCV's formulas (calib3d documentation, "Detailed Description" and "Fisheye
//! camera model"), the models `plumb_bob`, `rational_polynomial` and `equidistant` of ROS.
//!
//! `plumb_bob` and `rational_polynomial`:
//! `x'' = x' f + 2 p1 x' y' + p2 (r² + 2 x'²)`, `y'' = y' f + p1 (r² + 2 y'²) + 2 p2 x' y'`, `r² = x'² + y'²`,
//! `f = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)`.
//!
//! `equidistant` (Kannala and Brandt 2006, doi 10.1109/TPAMI.2006.153, as in OpenCV's `fisheye`): `x'' = x' θ' / r`,
//! `y'' = y' θ' / r`, `θ = atan r`, `θ' = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)`.
//!
//! Far from the centre these formulas may fold back: two rays map to one pixel. Their Jacobian is symmetric, so they
//! are the gradient of a potential. On a disc about the centre in which the Jacobian is positive definite, the
//! potential is strictly convex, so no two points of the disc map to the same place. Points outside that disc are not
//! measured.

mod coefficients;
mod radial;

use nalgebra::{Matrix2, Point2, Vector2};

use super::{DistortedPoint, UndistortedPoint};

/// Distance of the radii at which the Jacobian is checked.
const RADIUS_STEP: f64 = 1.0 / 64.0;
/// Largest radius measured through a distorting lens: 83 degrees off the axis.
const LARGEST_RADIUS: f64 = 8.0;
const MAX_ITERATIONS: u32 = 50;
/// Tolerance on the plane z = 1: with a focal length of 10,000 px it is 1e-8 px.
const TOLERANCE: f64 = 1e-12;

/// Deviation of a lens from a pinhole.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Distortion {
    /// No distortion.
    #[default]
    None,
    /// Radial and tangential, five coefficients.
    #[expect(missing_docs, reason = "names of the formula")]
    PlumbBob { k1: f64, k2: f64, p1: f64, p2: f64, k3: f64 },
    /// Rational radial part, and tangential, eight coefficients.
    #[expect(missing_docs, reason = "names of the formula")]
    RationalPolynomial { k1: f64, k2: f64, p1: f64, p2: f64, k3: f64, k4: f64, k5: f64, k6: f64 },
    /// Fisheye: polynomial in the angle from the optical axis, four coefficients. With all of them 0 it is not a
    /// pinhole: the distance from the centre is proportional to the angle.
    #[expect(missing_docs, reason = "names of the formula")]
    Equidistant { k1: f64, k2: f64, k3: f64, k4: f64 },
}

impl Distortion {
    /// Returns the distorted image of a point on the plane z = 1. `None` where the model folds back.
    pub(crate) fn distort(&self, straight: UndistortedPoint) -> Option<DistortedPoint> {
        if *self == Self::None {
            return Some(DistortedPoint(straight.0));
        }
        self.is_before_fold(straight.0.coords.norm()).then(|| self.bend(straight).0)
    }

    /// The point of the plane z = 1 that appears there: Newton's method with the exact Jacobian. `None` where there is no
    /// such point, or none before the model folds back.
    pub(crate) fn undistort(
        &self,
        DistortedPoint(bent): DistortedPoint,
    ) -> Option<UndistortedPoint> {
        if *self == Self::None {
            return Some(UndistortedPoint(bent));
        }
        if !bent.coords.norm().is_finite() {
            return None;
        }
        let mut start = match self {
            // As if the coefficients were 0.
            Self::Equidistant { .. } if bent.coords.norm() > 0.0 => {
                bent * (bent.coords.norm().min(LARGEST_RADIUS.atan()).tan() / bent.coords.norm())
            }
            _ => bent,
        };
        while !self.is_before_fold(start.coords.norm()) {
            start *= 0.5;
        }
        self.solve(bent, start).map(UndistortedPoint)
    }

    /// Newton's method; halves a step until it reduces the error and stays before the fold.
    fn solve(&self, bent: Point2<f64>, start: Point2<f64>) -> Option<Point2<f64>> {
        let mut straight = start;
        let (DistortedPoint(mut seen), mut jacobian) = self.bend(UndistortedPoint(straight));
        for _ in 0..MAX_ITERATIONS {
            let residual = bent - seen;
            let error = residual.norm();
            if error < TOLERANCE * (1.0 + bent.coords.norm()) {
                return Some(straight);
            }
            let mut step: Vector2<f64> = jacobian.try_inverse()? * residual;
            loop {
                let next = straight + step;
                if self.is_before_fold(next.coords.norm()) {
                    let (DistortedPoint(next_seen), next_jacobian) =
                        self.bend(UndistortedPoint(next));
                    if (bent - next_seen).norm() < error {
                        (straight, seen, jacobian) = (next, next_seen, next_jacobian);
                        break;
                    }
                }
                step *= 0.5;
                if step.norm() < TOLERANCE * 1e-3 {
                    return None;
                }
            }
        }
        None
    }

    /// Returns the distorted point and the Jacobian.
    pub(in crate::scanner) fn bend(
        &self,
        UndistortedPoint(straight): UndistortedPoint,
    ) -> (DistortedPoint, Matrix2<f64>) {
        let (p1, p2) = self.tangential();
        let (x, y) = (straight.x, straight.y);
        let s = x * x + y * y;
        let (f, slope) = self.radial(s);
        let bent = Point2::new(
            x * f + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
            y * f + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y,
        );
        let mixed = 2.0 * (slope * x * y + p1 * x + p2 * y);
        let jacobian = Matrix2::new(
            f + 2.0 * slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
            mixed,
            mixed,
            f + 2.0 * slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
        );
        (DistortedPoint(bent), jacobian)
    }

    /// True if the Jacobian is positive definite at every point with this r². Without the tangential terms its
    /// eigenvalues are f and f + 2 r² df/d(r²); the tangential terms reduce them by at most 6 r |p|.
    fn is_sound(&self, s: f64) -> bool {
        let (p1, p2) = self.tangential();
        let (f, slope) = self.radial(s);
        let tangential = 6.0 * (s * (p1 * p1 + p2 * p2)).sqrt();
        f.min(f + 2.0 * s * slope) > tangential
    }

    /// True if the Jacobian is positive definite everywhere up to this radius.
    fn is_before_fold(&self, radius: f64) -> bool {
        if radius.is_nan() || radius > LARGEST_RADIUS {
            return false;
        }
        let steps = (radius / RADIUS_STEP) as u32;
        self.is_sound(radius * radius)
            && (1..=steps).all(|step| self.is_sound((f64::from(step) * RADIUS_STEP).powi(2)))
    }

    /// Returns the radius on the plane z = 1 up to which the Jacobian is positive definite everywhere.
    pub(in crate::scanner) fn largest_radius(&self) -> f64 {
        if *self == Self::None {
            return f64::INFINITY;
        }
        let steps = 1..=(LARGEST_RADIUS / RADIUS_STEP) as u32;
        let mut radii = steps.map(|step| f64::from(step) * RADIUS_STEP);
        let Some(mut above) = radii.find(|radius| !self.is_sound(radius * radius)) else {
            return LARGEST_RADIUS;
        };
        let mut below = above - RADIUS_STEP;
        for _ in 0..MAX_ITERATIONS {
            let middle = 0.5 * (below + above);
            *(if self.is_sound(middle * middle) { &mut below } else { &mut above }) = middle;
        }
        below
    }
}

#[cfg(test)]
mod tests;
