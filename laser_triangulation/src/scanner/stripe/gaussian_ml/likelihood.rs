//! Log-likelihood of one sample as a function of its expected level.

use super::super::{elementary::hazard, noise::PixelNoise};

/// First derivative of a sample's log-likelihood with respect to its expected level, and the information in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Evidence {
    /// ∂ ln p / ∂μ.
    pub(super) score: f32,
    /// Rate at which the score falls with μ; never negative.
    pub(super) information: f32,
}

/// Likelihood of a sample between 0 and full scale: normal with variance v(μ), which grows with the light.
///
/// ln p = -(y - μ)²/2v - ln(v)/2, so the score is (y - μ)/v + v′/2 · ((y - μ)²/v² - 1/v) and the Fisher information
/// 1/v + v′²/2v² (Kay, Estimation Theory, 1993, eq. 3.32).
#[inline(always)]
pub(super) fn measured(sample: f32, level: f32, noise: PixelNoise) -> Evidence {
    let by_level = if level > 0.0 { noise.per_level } else { 0.0 };
    let precision = 1.0 / noise.variance(level);
    let residual = (sample - level) * precision;
    let spread = 0.5 * by_level;
    Evidence {
        score: residual + spread * (residual * residual - precision),
        information: precision + 2.0 * spread * spread * precision * precision,
    }
}

/// Likelihood of a clipped sample. It means "at least full scale" or "at most 0", nothing more.
///
/// With z = ±(limit - μ)/σ the likelihood is Φ(-z). Its logarithm falls by λ(z) per unit of z, and λ itself rises by λ
/// (λ - z).
#[inline(always)]
pub(super) fn clipped(sample: f32, level: f32, full_scale: f32, noise: PixelNoise) -> Evidence {
    // Levels within half a level of the limit, and all beyond, are rounded to it.
    let (side, limit) = if sample <= 0.0 { (-1.0, 0.5) } else { (1.0, full_scale - 0.5) };
    let by_level = if level > 0.0 { noise.per_level } else { 0.0 };
    let precision = 1.0 / noise.variance(level);
    let root = precision.sqrt();
    let z = side * (limit - level) * root;
    let by_level = side * root * (1.0 + 0.5 * by_level * (limit - level) * precision);
    let lambda = hazard(z);
    Evidence {
        score: lambda * by_level,
        information: (lambda * (lambda - z)).max(0.0) * by_level * by_level,
    }
}
