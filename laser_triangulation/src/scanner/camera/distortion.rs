//! Lens distortion on the plane z = 1: OpenCV's formulas (calib3d documentation, "Detailed Description"), the models
//! `plumb_bob` and `rational_polynomial` of ROS.
//!
//! `x'' = x' f + 2 p1 x' y' + p2 (r² + 2 x'²)`, `y'' = y' f + p1 (r² + 2 y'²) + 2 p2 x' y'`, `r² = x'² + y'²`,
//! `f = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)`.
//!
//! Far from the centre these formulas may fold back: two rays map to one pixel. Their Jacobian is symmetric, so they
//! are the gradient of a potential. On a disc about the centre in which the Jacobian is positive definite, the
//! potential is strictly convex, so no two points of the disc map to the same place. Points outside that disc are not
//! measured.

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
}

impl Distortion {
    /// Returns the model `name` with the coefficients `d` in ROS's order: k1, k2, p1, p2, k3, k4, k5, k6. Coefficients that are
    /// all zero give no distortion.
    ///
    /// # Errors
    /// `None` for an unknown model; a description of the model's coefficients if `d` has another length.
    pub fn from_coefficients(name: &str, d: &[f64]) -> Result<Self, Option<&'static str>> {
        if !matches!(name, "plumb_bob" | "rational_polynomial") {
            return Err(None);
        }
        if d.iter().all(|value| *value == 0.0) {
            return Ok(Self::None);
        }
        match (name, d) {
            ("plumb_bob", &[k1, k2, p1, p2]) => Ok(Self::PlumbBob { k1, k2, p1, p2, k3: 0.0 }),
            ("plumb_bob", &[k1, k2, p1, p2, k3]) => Ok(Self::PlumbBob { k1, k2, p1, p2, k3 }),
            ("plumb_bob", _) => Err(Some("five numbers k1, k2, p1, p2, k3 for plumb_bob")),
            (_, &[k1, k2, p1, p2, k3, k4, k5, k6]) => {
                Ok(Self::RationalPolynomial { k1, k2, p1, p2, k3, k4, k5, k6 })
            }
            _ => Err(Some("eight numbers k1, k2, p1, p2, k3, k4, k5, k6 for rational_polynomial")),
        }
    }

    /// Returns ROS's name of the model.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::None | Self::PlumbBob { .. } => "plumb_bob",
            Self::RationalPolynomial { .. } => "rational_polynomial",
        }
    }

    /// Returns the coefficients in ROS's order: k1, k2, p1, p2, k3, and for the rational model k4, k5, k6.
    pub fn coefficients(&self) -> Vec<f64> {
        match *self {
            Self::None => vec![0.0; 5],
            Self::PlumbBob { k1, k2, p1, p2, k3 } => vec![k1, k2, p1, p2, k3],
            Self::RationalPolynomial { k1, k2, p1, p2, k3, k4, k5, k6 } => {
                vec![k1, k2, p1, p2, k3, k4, k5, k6]
            }
        }
    }

    /// Returns a coefficient by its name in the formula; `None` if the model has no such coefficient.
    pub(crate) fn coefficient_mut(&mut self, name: &str) -> Option<&mut f64> {
        if *self == Self::None {
            *self = Self::PlumbBob { k1: 0.0, k2: 0.0, p1: 0.0, p2: 0.0, k3: 0.0 };
        }
        match (self, name) {
            (Self::PlumbBob { k1, .. } | Self::RationalPolynomial { k1, .. }, "k1") => Some(k1),
            (Self::PlumbBob { k2, .. } | Self::RationalPolynomial { k2, .. }, "k2") => Some(k2),
            (Self::PlumbBob { p1, .. } | Self::RationalPolynomial { p1, .. }, "p1") => Some(p1),
            (Self::PlumbBob { p2, .. } | Self::RationalPolynomial { p2, .. }, "p2") => Some(p2),
            (Self::PlumbBob { k3, .. } | Self::RationalPolynomial { k3, .. }, "k3") => Some(k3),
            (Self::RationalPolynomial { k4, .. }, "k4") => Some(k4),
            (Self::RationalPolynomial { k5, .. }, "k5") => Some(k5),
            (Self::RationalPolynomial { k6, .. }, "k6") => Some(k6),
            _ => None,
        }
    }

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
        let mut start = bent;
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
        let Terms { p1, p2, .. } = self.terms();
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

    /// Returns the radial factor f and df/d(r²).
    fn radial(&self, s: f64) -> (f64, f64) {
        let Terms { above, below, .. } = self.terms();
        let (n, dn) = series(above, s);
        if below.iter().all(|coefficient| *coefficient == 0.0) {
            return (n, dn);
        }
        let (d, dd) = series(below, s);
        (n / d, (dn * d - n * dd) / (d * d))
    }

    /// True if the Jacobian is positive definite at every point with this r². Without the tangential terms its
    /// eigenvalues are f and f + 2 r² df/d(r²); the tangential terms reduce them by at most 6 r |p|.
    fn is_sound(&self, s: f64) -> bool {
        let Terms { below, p1, p2, .. } = self.terms();
        let (f, slope) = self.radial(s);
        let tangential = 6.0 * (s * (p1 * p1 + p2 * p2)).sqrt();
        series(below, s).0 > 0.0 && f.min(f + 2.0 * s * slope) > tangential
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

    fn terms(&self) -> Terms {
        match *self {
            Self::None => Terms { above: [0.0; 3], below: [0.0; 3], p1: 0.0, p2: 0.0 },
            Self::PlumbBob { k1, k2, p1, p2, k3 } => {
                Terms { above: [k1, k2, k3], below: [0.0; 3], p1, p2 }
            }
            Self::RationalPolynomial { k1, k2, p1, p2, k3, k4, k5, k6 } => {
                Terms { above: [k1, k2, k3], below: [k4, k5, k6], p1, p2 }
            }
        }
    }
}

/// The coefficients by their place in the formula.
struct Terms {
    above: [f64; 3],
    below: [f64; 3],
    p1: f64,
    p2: f64,
}

/// 1 + a s + b s² + c s³ and its derivative.
fn series([a, b, c]: [f64; 3], s: f64) -> (f64, f64) {
    (1.0 + s * (a + s * (b + s * c)), a + s * (2.0 * b + s * 3.0 * c))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Strong barrel, strong pincushion, and a wide lens of eight coefficients.
    const LENSES: [Distortion; 3] = [
        Distortion::PlumbBob { k1: -0.45, k2: 0.25, p1: 0.002, p2: -0.003, k3: -0.06 },
        Distortion::PlumbBob { k1: 0.35, k2: 0.2, p1: -0.004, p2: 0.002, k3: 0.1 },
        Distortion::RationalPolynomial {
            k1: 8.2,
            k2: 4.6,
            p1: -0.0002,
            p2: 0.0007,
            k3: 0.21,
            k4: 8.6,
            k5: 7.4,
            k6: 1.2,
        },
    ];

    /// Radius beyond which a lens is not measured.
    fn limit(lens: &Distortion) -> f64 {
        (1..8000)
            .map(|k| f64::from(k) * 1e-3)
            .take_while(|r| lens.is_before_fold(*r))
            .last()
            .unwrap()
    }

    proptest! {
        #[test]
        fn undistort_undoes_distort_up_to_the_fold(
            lens in 0..LENSES.len(), share in 0.0..0.999_f64, angle in 0.0..std::f64::consts::TAU,
        ) {
            let lens = LENSES[lens];
            let radius = share * limit(&lens);
            let straight = UndistortedPoint(Point2::new(radius * angle.cos(), radius * angle.sin()));
            let bent = lens.distort(straight).unwrap();
            let again = lens.distort(lens.undistort(bent).unwrap()).unwrap();
            let relative = (again.0 - bent.0).norm() / (1.0 + bent.0.coords.norm());
            prop_assert!(relative < 1e-11, "{bent:?} {again:?}");
        }

        #[test]
        fn the_jacobian_is_the_derivative(
            lens in 0..LENSES.len(), x in -0.6..0.6_f64, y in -0.6..0.6_f64,
        ) {
            let (lens, h) = (LENSES[lens], 1e-6);
            let bend = |step: Vector2<f64>| lens.bend(UndistortedPoint(Point2::new(x, y) + step));
            let jacobian = bend(Vector2::zeros()).1;
            for (column, step) in [Vector2::new(h, 0.0), Vector2::new(0.0, h)].into_iter().enumerate() {
                let at = |sign: f64| bend(step * sign).0.0;
                let difference = (at(1.0) - at(-1.0)) / (2.0 * h);
                prop_assert!((jacobian.column(column) - difference).norm() < 1e-8);
            }
        }

        /// Wherever an answer exists, it is the ray seen at that position.
        #[test]
        fn no_ray_is_wrong(lens in 0..LENSES.len(), x in -20.0..20.0_f64, y in -20.0..20.0_f64) {
            let (lens, bent) = (LENSES[lens], DistortedPoint(Point2::new(x, y)));
            if let Some(straight) = lens.undistort(bent) {
                prop_assert!((lens.distort(straight).unwrap().0 - bent.0).norm() < 1e-10);
            }
        }
    }

    #[test]
    fn beyond_the_fold_nothing_is_measured() {
        let barrel = Distortion::PlumbBob { k1: -0.3, k2: 0.0, p1: 0.0, p2: 0.0, k3: 0.0 };
        // r (1 - 0.3 r²) is largest at r² = 1 / 0.9, where it is 0.7027.
        let fold = (1.0_f64 / 0.9).sqrt();
        assert!(barrel.distort(UndistortedPoint(Point2::new(fold - 1e-6, 0.0))).is_some());
        assert!(barrel.distort(UndistortedPoint(Point2::new(0.0, fold + 1e-6))).is_none());
        let edge = fold * 2.0 / 3.0;
        let near_edge = |step: f64| barrel.undistort(DistortedPoint(Point2::new(edge + step, 0.0)));
        let UndistortedPoint(straight) = near_edge(-1e-6).unwrap();
        assert!((fold - 0.01..fold).contains(&straight.x), "{straight}");
        assert!(near_edge(1e-6).is_none());
    }

    #[test]
    fn what_is_no_place_has_no_ray() {
        for lens in LENSES {
            for bent in [f64::NAN, f64::INFINITY, 1e300] {
                assert!(lens.undistort(DistortedPoint(Point2::new(bent, 0.0))).is_none());
                assert!(lens.distort(UndistortedPoint(Point2::new(bent, 0.0))).is_none());
            }
        }
    }
}
