//! The part of a distortion that depends on the distance from the centre only.

use super::Distortion;

/// Squared radius below which `equidistant` is its series: the next term is below the precision of a float.
const NEAR_AXIS: f64 = 1e-9;

impl Distortion {
    /// Returns the radial factor f and df/d(r²) at that r². NaN beyond a pole of the rational model.
    pub(super) fn radial(&self, s: f64) -> (f64, f64) {
        match *self {
            Self::None => (1.0, 0.0),
            Self::PlumbBob { k1, k2, k3, .. } => series([k1, k2, k3], s),
            Self::RationalPolynomial { k1, k2, k3, k4, k5, k6, .. } => {
                let (n, dn) = series([k1, k2, k3], s);
                let (d, dd) = series([k4, k5, k6], s);
                if d.is_nan() || d <= 0.0 {
                    return (f64::NAN, f64::NAN);
                }
                (n / d, (dn * d - n * dd) / (d * d))
            }
            Self::Equidistant { k1, k2, k3, k4 } => equidistant([k1, k2, k3, k4], s),
        }
    }

    /// Returns the tangential coefficients p1 and p2.
    pub(super) const fn tangential(&self) -> (f64, f64) {
        match *self {
            Self::None | Self::Equidistant { .. } => (0.0, 0.0),
            Self::PlumbBob { p1, p2, .. } | Self::RationalPolynomial { p1, p2, .. } => (p1, p2),
        }
    }
}

/// 1 + a s + b s² + c s³ and its derivative.
fn series([a, b, c]: [f64; 3], s: f64) -> (f64, f64) {
    (1.0 + s * (a + s * (b + s * c)), a + s * (2.0 * b + s * 3.0 * c))
}

/// f = θ' / r and df/d(r²), from d(r f)/dr = dθ'/dθ / (1 + r²).
fn equidistant([k1, k2, k3, k4]: [f64; 4], s: f64) -> (f64, f64) {
    if s < NEAR_AXIS {
        let slope = k1 - 1.0 / 3.0;
        return (1.0 + s * slope, slope);
    }
    let r = s.sqrt();
    let angle = r.atan();
    let t = angle * angle;
    let bent = angle * (1.0 + t * (k1 + t * (k2 + t * (k3 + t * k4))));
    let bent_per_angle = 1.0 + t * (3.0 * k1 + t * (5.0 * k2 + t * (7.0 * k3 + t * 9.0 * k4)));
    let f = bent / r;
    (f, (bent_per_angle / (1.0 + s) - f) / (2.0 * s))
}
