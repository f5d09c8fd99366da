//! The depth from which a dip between two maxima of a cross-section is a valley, and not noise.
//!
//! The noise of a blurred sample has two parts: that of the pixels, the larger of the stated noise and of the frame's
//! own, and the texture of the stripe, speckle and surface, which grows with the level. The texture is the robust
//! scatter of second differences of the brightest blurred sample along the stripe, taken at distances at which blurred
//! samples share no pixel.

use super::{
    blur::{Kernel, Sample, UNITS},
    noise_estimate::NoiseEstimator,
    picture::Picture,
    section::{Levels, LineCandidate, Noise},
};
use crate::statistics::{MAD_TO_SIGMA, median};

/// A valley is deeper than this many standard deviations of the noise.
const SIGMAS: f64 = 5.0;
/// A valley is deeper than this many grey levels of an 8-bit scale: compression and rounding make shallower ones.
const LEAST_GREY: f64 = 3.0;
/// A dip to half the lower maximum is a valley in any noise.
const ALWAYS: u32 = 2;
/// Approximate number of second differences evaluated per frame.
const DIFFERENCES: usize = 1024;
/// Variance of a second difference, in variances of a sample.
const DIFFERENCE_GAIN: f64 = 6.0;

/// Noise of the blurred samples of one frame, as it matters for valleys.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ValleyNoise {
    /// Variance without light, squared blurred units.
    constant: f64,
    /// Variance per level, blurred units.
    per_level: f64,
    /// Standard deviation of the stripe's own brightness, as a share of it.
    texture: f64,
    /// Shallowest valley, blurred units.
    least: f64,
}

impl ValleyNoise {
    /// Returns the noise of blurred samples of an image with that noise and full scale, and of a stripe without texture.
    pub(super) fn new(noise: &Noise<'_>, full_scale: u32) -> Self {
        let (units, gain) = (f64::from(UNITS), noise.kernel.noise_gain().powi(2));
        Self {
            constant: noise.constant * gain * units * units,
            per_level: noise.per_level * gain * units,
            texture: 0.0,
            least: LEAST_GREY * f64::from(full_scale) / 255.0 * units,
        }
    }

    /// Returns the noise with the larger variances of this one and of another, and with that texture.
    #[must_use]
    fn with(self, other: Self, texture: f64) -> Self {
        Self {
            constant: self.constant.max(other.constant),
            per_level: self.per_level.max(other.per_level),
            texture,
            least: self.least,
        }
    }

    /// Returns the depth that a valley below a maximum of that level exceeds; both in blurred units.
    pub(super) fn limit(&self, level: u32) -> u32 {
        let texture = self.texture * f64::from(level);
        let variance = self.constant + self.per_level * f64::from(level) + texture * texture;
        ((SIGMAS * variance.sqrt()).max(self.least) as u32).min(level / ALWAYS)
    }
}

/// Measures the noise that valleys must exceed, frame after frame. Keeps its buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct ValleyNoiseEstimator {
    noise: NoiseEstimator,
    texture: TextureEstimator,
}

impl ValleyNoiseEstimator {
    /// Adapts `levels.valleys` to the frame if any of the candidates, which are sorted by line, may have a valley.
    pub(super) fn adapt<S: Sample>(
        &mut self,
        picture: &Picture<'_, S>,
        found: &[LineCandidate],
        levels: &mut Levels<'_>,
    ) {
        let shallowest = levels.valleys.limit(levels.segment_threshold);
        if found.iter().all(|found| found.candidate.dip <= shallowest) {
            return;
        }
        let mut noise = levels.noise;
        self.noise.estimate(picture, found, levels.full_scale, &mut noise);
        let texture = self.texture.estimate(found, noise.kernel);
        let own = ValleyNoise::new(&noise, levels.full_scale);
        levels.valleys = levels.valleys.with(own, texture);
    }
}

/// Measures the texture of stripes.
#[derive(Clone, Debug, Default)]
struct TextureEstimator {
    /// Largest blurred sample of every line, blurred units; 0: no candidate.
    peaks: Vec<u32>,
    differences: Vec<u32>,
}

/// Shares are integers in units of 1 / `SHARE`.
const SHARE: u32 = 1 << 16;

impl TextureEstimator {
    /// Returns the standard deviation of the stripe's brightness from line to line as a share of it; `found` holds all
    /// candidates, sorted by line. Returns 0 for a stripe too short to measure it.
    fn estimate(&mut self, found: &[LineCandidate], kernel: &Kernel) -> f64 {
        let Self { peaks, differences } = self;
        peaks.clear();
        peaks.resize(found.last().map_or(0, |last| last.line as usize + 1), 0);
        for LineCandidate { line, candidate } in found {
            let peak = &mut peaks[*line as usize];
            *peak = (*peak).max(candidate.peak);
        }
        let lag = kernel.weights().len();
        let step = peaks.len() / DIFFERENCES + 1;
        differences.clear();
        for at in (lag..peaks.len().saturating_sub(lag)).step_by(step) {
            let [a, b, c] = [at - lag, at, at + lag].map(|at| u64::from(peaks[at]));
            if a.min(b).min(c) > 0 {
                let share = (a + c).abs_diff(2 * b) * 3 * u64::from(SHARE) / (a + b + c);
                differences.push(share as u32);
            }
        }
        let median = f64::from(median(differences).unwrap_or_default()) / f64::from(SHARE);
        MAD_TO_SIGMA * median / DIFFERENCE_GAIN.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::{super::section::Candidate, *};
    use rand_distr::Distribution as _;

    fn found(peaks: &[u32]) -> Vec<LineCandidate> {
        let candidate = |&peak| Candidate::alone(5, 9, peak, 0);
        let lines = (0..).zip(peaks.iter().map(candidate));
        lines.map(|(line, candidate)| LineCandidate { line, candidate }).collect()
    }

    fn noise(kernel: &Kernel) -> Noise<'_> {
        Noise { constant: 4.0, per_level: 0.01, kernel }
    }

    #[test]
    fn texture_is_the_relative_scatter_along_the_stripe() {
        let kernel = Kernel::gaussian(3);
        let mut rng = rand_chacha::ChaCha8Rng::from_seed([7; 32]);
        for (share, slope) in [(0.0, 0.0), (0.02, 3.0), (0.1, -2.0), (0.3, 0.0)] {
            let speckle = rand_distr::Normal::new(1.0, share).unwrap();
            let peaks: Vec<u32> = (0..2000)
                .map(|i| ((20_000.0 + slope * f64::from(i)) * speckle.sample(&mut rng)) as u32)
                .collect();
            let estimate = TextureEstimator::default().estimate(&found(&peaks), &kernel);
            assert!((estimate - share).abs() < 0.08 * share + 1e-3, "{share}: {estimate}");
        }
        for short in [&[][..], &[9000; 3]] {
            assert!(TextureEstimator::default().estimate(&found(short), &kernel) <= 0.0);
        }
    }

    #[test]
    fn a_valley_exceeds_noise_rounding_or_half_the_maximum() {
        let kernel = Kernel::gaussian(0);
        let of = |texture| {
            let stated = ValleyNoise::new(&noise(&kernel), 255);
            stated.with(stated, texture).limit(100 * UNITS)
        };
        // 5 √(4 + 1), of unblurred samples.
        assert_eq!(of(0.0), (5.0 * 5.0_f64.sqrt() * 256.0) as u32);
        assert_eq!(of(0.08), (5.0 * 69.0_f64.sqrt() * 256.0) as u32);
        assert_eq!(of(0.2), 50 * UNITS);
        let blurred = Kernel::gaussian(3);
        assert_eq!(ValleyNoise::new(&noise(&blurred), 255).limit(100 * UNITS), 3 * UNITS);
        assert_eq!(ValleyNoise::new(&noise(&blurred), 4095).limit(1600 * UNITS), 12_333);
    }

    use rand::SeedableRng as _;
}
