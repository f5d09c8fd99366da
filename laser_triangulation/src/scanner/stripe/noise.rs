//! The noise of one pixel, in the form that lanes use.

use super::section::Noise;

/// Noise of a raw sample, sample units: variance `constant + per_level · level`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PixelNoise {
    /// Variance of read noise and rounding.
    pub(crate) constant: f32,
    /// Variance of the shot noise per level.
    pub(crate) per_level: f32,
    /// Variance of the blur that the blurred samples went through, px².
    pub(crate) blur_variance_px2: f32,
}

impl From<&Noise<'_>> for PixelNoise {
    fn from(noise: &Noise<'_>) -> Self {
        Self {
            constant: noise.constant as f32,
            per_level: noise.per_level as f32,
            blur_variance_px2: noise.kernel.variance_px2() as f32,
        }
    }
}

impl PixelNoise {
    /// Returns the variance of a sample with that expected level. Negative levels count as no light.
    #[inline(always)]
    pub(super) fn variance(&self, level: f32) -> f32 {
        self.constant + self.per_level * level.max(0.0)
    }
}
