//! Step 5 of Yao et al. 2023: the coarse peak, the maximum of a Gaussian through the blurred cross-section.

use super::section::{Centre, Noise, Section, grey};
use nalgebra::{Matrix3, RowVector3, Vector3};
use std::sync::LazyLock;

/// Maximum of the Gaussian fitted to the candidate's samples, pixels.
///
/// The logarithm of a Gaussian is a parabola: ln G(t) = p₀ + p₁t + p₂t². Least squares in the logarithm, each sample
/// weighted by G² because noise of ln G is that of G divided by G (Guo 2011, doi 10.1109/MSP.2011.941846). The maximum
/// lies at -p₁ / 2p₂; for a parabola that opens upwards, or a maximum outside the candidate, the brightest sample stands
/// in.
pub fn coarse_peak(section: &Section<'_>) -> f64 {
    let brightest = brightest(section);
    fit(section, brightest)
        .map_or(f64::from(section.candidate.first) + brightest as f64, |fit| fit.position_px)
}

/// The same as an estimator of its own, with its uncertainty: the derivative of the maximum by each sample times that
/// sample's noise. Where the brightest sample stands in, the uncertainty is half the candidate.
pub fn gaussian_fit(section: &Section<'_>, noise: &Noise<'_>) -> Centre {
    let brightest = brightest(section);
    let fitted = fit(section, brightest).and_then(|fit| Some((gradient(&fit)?, fit.position_px)));
    let Some((gradient, position_px)) = fitted else {
        return Centre {
            position_px: f64::from(section.candidate.first) + brightest as f64,
            sigma_px: f64::from(section.candidate.length()) / 2.0,
        };
    };
    let by_sample = |i: usize| {
        let t = i as f64 - brightest as f64;
        (gradient * Vector3::new(1.0, t, t * t))[0] * grey(section.run()[i])
    };
    Centre { position_px, sigma_px: noise.weighted_sigma(section.run(), by_sample) }
}

/// How the maximum moves with the right-hand side of the normal equations: d(-p₁/2p₂) = -dp₁/2p₂ + p₁dp₂/2p₂².
fn gradient(fit: &Fit) -> Option<RowVector3<f64>> {
    let Fit { powers: [s0, s1, s2, s3, s4], slope, curvature, .. } = *fit;
    let by_coefficient = RowVector3::new(0.0, -0.5 / curvature, 0.5 * slope / curvature.powi(2));
    let inverse = Matrix3::new(s0, s1, s2, s1, s2, s3, s2, s3, s4).try_inverse()?;
    Some(by_coefficient * inverse)
}

/// A parabola through the logarithms, t = 0 at the brightest sample.
struct Fit {
    /// Σ w tᵏ, k = 0 … 4: the normal equations, weights w = G².
    powers: [f64; 5],
    /// p₁ and p₂.
    slope: f64,
    curvature: f64,
    /// Where the maximum lies, pixels; inside the candidate.
    position_px: f64,
}

fn fit(section: &Section<'_>, brightest: usize) -> Option<Fit> {
    let mut powers = [0.0; 5];
    // Σ w tᵏ ln G
    let mut right = [0.0; 3];
    let peak = logarithm(section.candidate.peak);
    for (i, &sample) in section.run().iter().enumerate() {
        let t = i as f64 - brightest as f64;
        let level = grey(sample);
        // Relative to the peak, so that equal samples make an exactly level parabola.
        let logarithm = logarithm(sample) - peak;
        let weight = level * level;
        let terms = [weight, weight * t, weight * t * t];
        for k in 0..3 {
            powers[k] += terms[k];
            right[k] += terms[k] * logarithm;
        }
        powers[3] += terms[2] * t;
        powers[4] += terms[2] * t * t;
    }
    // p₀ eliminated: two equations for p₁ and p₂.
    let [s0, s1, s2, s3, s4] = powers;
    let (a11, a12, a22) = (s2 - s1 * s1 / s0, s3 - s1 * s2 / s0, s4 - s2 * s2 / s0);
    let (b1, b2) = (right[1] - s1 * right[0] / s0, right[2] - s2 * right[0] / s0);
    let determinant = a11 * a22 - a12 * a12;
    let slope = (b1 * a22 - b2 * a12) / determinant;
    let curvature = (b2 * a11 - b1 * a12) / determinant;
    let (first, last) = (f64::from(section.candidate.first), f64::from(section.candidate.last));
    let position_px = first + brightest as f64 - slope / (2.0 * curvature);
    // Not so for too few samples either: the determinant is 0, the position not a number.
    (curvature < 0.0 && (first..=last).contains(&position_px)).then_some(Fit {
        powers,
        slope,
        curvature,
        position_px,
    })
}

/// Logarithm of a blurred sample's level; tabulated for 8-bit images, where it would take half of the fit's time.
fn logarithm(sample: u32) -> f64 {
    static TABLE: LazyLock<Box<[f64]>> =
        LazyLock::new(|| (0..=u32::from(u16::MAX)).map(|sample| grey(sample).ln()).collect());
    TABLE.get(sample as usize).copied().unwrap_or_else(|| grey(sample).ln())
}

/// Index of the (first) brightest sample in the candidate.
fn brightest(section: &Section<'_>) -> usize {
    section.run().iter().position(|&sample| sample == section.candidate.peak).unwrap_or(0)
}
