//! The parameters of formula 6, from a map of heights and one length that is measured or taken from a data sheet.

use nalgebra::{DMatrix, DVector, Matrix4, Vector4};
use thiserror::Error;

use super::{HeightModel, model::AcrossModel};

/// The length that is known in addition to the heights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KnownDistance {
    /// a: from the lens to the sensor, near the focal length, metres.
    ImageDistance(f64),
    /// b: from the base point to the lens, metres.
    ObjectDistance(f64),
}

/// The parameters of formula 6 of Yao et al. 2023, each with one standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VerticalGeometry {
    /// a, metres.
    pub image_distance_m: [f64; 2],
    /// b, metres.
    pub object_distance_m: [f64; 2],
    /// β, radians.
    pub beta_rad: [f64; 2],
    /// Position of height 0 across the stripe, pixels.
    pub base_px: [f64; 2],
    /// -1: the stripe moves towards smaller positions when the surface rises; otherwise 1.
    pub height_sign: i8,
    /// One standard deviation of a, b, β and the base line, in their units.
    pub covariance: Matrix4<f64>,
}

/// The reason why heights do not determine the geometry.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum VerticalIncidenceError {
    /// The perspective is lost in the uncertainty.
    #[error(
        "the heights do not separate a, b and β: cos β / b is {value:.3} ± {sigma:.3} 1/m; use more height, or the projective model, which needs neither"
    )]
    NotIdentified {
        /// cos β / b, 1/metres.
        value: f64,
        /// One standard deviation of it.
        sigma: f64,
    },
    /// Perspective and known length contradict each other.
    #[error(
        "an object distance of {object_distance_m} m contradicts the heights: cos β would be {cos:.3}"
    )]
    Contradiction {
        /// b as given, metres.
        object_distance_m: f64,
        /// Resulting value of cos β.
        cos: f64,
    },
}

/// Solves formula 6, `h = s·b / (a·sin β + s·cos β)`. Heights alone determine only `A = a·sin β / b`, `B = cos β / b`
/// and the base line; one more length determines all parameters. `pixel_pitch_m` is the pixel pitch of the sensor,
/// metres.
///
/// # Errors
/// A perspective that is lost in the uncertainty, or that contradicts the known length.
pub fn vertical_incidence(
    model: &HeightModel,
    pixel_pitch_m: f64,
    known: KnownDistance,
) -> Result<VerticalGeometry, VerticalIncidenceError> {
    let AcrossModel { values: numbers, covariance, middle_px } = model.across();
    let of = |numbers: [f64; 3]| geometry(numbers, middle_px, pixel_pitch_m, known);
    let b_of = |[p, _, r]: [f64; 3]| r / p;
    let spread = |value: &dyn Fn([f64; 3]) -> f64| propagated(value, numbers, &covariance);
    let (value, sigma) = (b_of(numbers), spread(&b_of));
    if value.is_nan() || sigma.is_nan() || value <= 2.0 * sigma {
        return Err(VerticalIncidenceError::NotIdentified { value, sigma });
    }
    let [a, b, beta, base] = of(numbers);
    if !beta.is_finite() {
        let KnownDistance::ObjectDistance(object_distance_m) = known else {
            return Err(VerticalIncidenceError::NotIdentified { value, sigma });
        };
        let cos = value * object_distance_m;
        return Err(VerticalIncidenceError::Contradiction { object_distance_m, cos });
    }
    let gradients = [0, 1, 2, 3].map(|i| gradient(&|numbers| of(numbers)[i], numbers, &covariance));
    let covariance = Matrix4::from_fn(|i, j| gradients[i].dot(&(&covariance * &gradients[j])));
    let sigmas: Vector4<f64> = covariance.diagonal().map(|square| square.max(0.0).sqrt());
    Ok(VerticalGeometry {
        image_distance_m: [a, sigmas[0]],
        object_distance_m: [b, sigmas[1]],
        beta_rad: [beta, sigmas[2]],
        base_px: [base, sigmas[3]],
        height_sign: if rises(numbers) { 1 } else { -1 },
        covariance,
    })
}

/// Returns true if heights grow with the position.
fn rises([p, q, r]: [f64; 3]) -> bool {
    // Sign of the derivative: p - q·r over a square.
    p - q * r > 0.0
}

/// Returns a, b, β and the base line; NaN if there is no solution.
fn geometry([p, q, r]: [f64; 3], middle_px: f64, pitch_m: f64, known: KnownDistance) -> [f64; 4] {
    let base = -q / p;
    let sign = if rises([p, q, r]) { 1.0 } else { -1.0 };
    // h = (v - base) / ((1 + r·base)/p + (r/p)·(v - base)), s = sign·pitch·(v - base).
    let (a_over_b, b_inverse) = (sign * pitch_m * (1.0 + r * base) / p, r / p);
    let (a, b, beta) = match known {
        KnownDistance::ImageDistance(a) => {
            let beta = (a_over_b / (a * b_inverse)).atan();
            (a, beta.cos() / b_inverse, beta)
        }
        KnownDistance::ObjectDistance(b) => {
            let beta = (b * b_inverse).acos();
            (a_over_b * b / beta.sin(), b, beta)
        }
    };
    [a, b, beta, base + middle_px]
}

/// Returns one standard deviation of a function of the parameters.
fn propagated(value: &dyn Fn([f64; 3]) -> f64, at: [f64; 3], covariance: &DMatrix<f64>) -> f64 {
    let gradient = gradient(value, at, covariance);
    (gradient.transpose() * covariance * gradient)[(0, 0)].max(0.0).sqrt()
}

/// Returns the derivatives of a function of the parameters, by finite differences.
fn gradient(
    value: &dyn Fn([f64; 3]) -> f64,
    at: [f64; 3],
    covariance: &DMatrix<f64>,
) -> DVector<f64> {
    DVector::from_iterator(
        3,
        (0..3).map(|i| {
            let step = 1e-3 * covariance[(i, i)].sqrt().max(1e-9 * at[i].abs());
            let (mut low, mut high) = (at, at);
            low[i] -= step;
            high[i] += step;
            (value(high) - value(low)) / (2.0 * step)
        }),
    )
}
