//! The Cramér–Rao bound: no unbiased estimator of the centre of one cross-section has a smaller standard deviation.
//!
//! The model is the renderer's: a Gaussian of amplitude A, centre c and standard deviation s over a background B,
//! integrated over each pixel, all four unknown. A sample of expected level μ has Gaussian noise of variance
//! v(μ) = read² + shot · μ, is rounded to an integer and clipped to 0 … full scale.
//!
//! The Fisher matrix is J = Σ I(μₖ) ∇μₖ ∇μₖᵀ over the pixels, the bound √((J⁻¹)cc) (Kay, Estimation Theory, 1993, eqs. 3.20
//! and 3.31). For white noise and fine sampling it becomes
//! `σ_c ≥ √(2/√π) · (σ_n/A) · √s = 1.062 · (σ_n/A) · √s`.

use nalgebra::{Matrix4, Vector4};

use super::normal;
use crate::simulate::{exposure::CrossSection, stripe::StripeScene};

/// Number of sub-pixel phases to average over.
const NUM_PHASES: u32 = 32;
/// Range of a sample's distribution around its mean, standard deviations.
const REACH_SIGMAS: f64 = 9.0;

/// The information that a sample contributes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Samples {
    /// The camera's actual output: integers between 0 and full scale. I(μ) = Σₖ (∂Pₖ/∂μ)² / Pₖ over the probabilities
    /// Pₖ of the levels. A clipped sample is *censored*: it states "at least full scale" or "at most 0", with that
    /// probability.
    Exact,
    /// The usual formula I(μ) = 1 / (v(μ) + 1/12): rounding counts as noise, nothing is clipped at 0, and saturated
    /// samples (μ at full scale) contribute nothing.
    SaturatedLeftOut,
}

/// A camera's noise, grey levels of its bit depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SensorNoise {
    /// Standard deviation of the read noise.
    pub(crate) read_noise: f64,
    /// Variance of the shot noise per grey level.
    pub(crate) shot_gain: f64,
    /// Level at which samples are clipped.
    pub(crate) full_scale: f64,
}

/// Returns the bound for a scene's stripe in one column, pixels: the root mean square over all sub-pixel phases. A
/// slope widens the cross-section to s / cos(slope) and adds the shift within the column. NaN without noise for exact
/// samples.
pub fn of_scene(scene: &StripeScene, slope_px: f64, samples: Samples) -> f64 {
    let noise = SensorNoise {
        read_noise: scene.read_noise,
        shot_gain: scene.shot_gain,
        full_scale: f64::from(scene.bit_depth.full_scale()),
    };
    let across_px = scene.sigma_px * slope_px.hypot(1.0);
    let sigma_px = (across_px * across_px + slope_px * slope_px / 12.0).sqrt();
    // The column's total flux is unchanged.
    let amplitude = scene.amplitude * across_px / sigma_px;
    let variances = (0..NUM_PHASES).map(|phase| {
        let center_px = f64::from(phase) / f64::from(NUM_PHASES);
        let section = CrossSection { center_px, amplitude, sigma_px };
        center_sigma_px(&section, scene.background, &noise, samples).powi(2)
    });
    (variances.sum::<f64>() / f64::from(NUM_PHASES)).sqrt()
}

/// Returns the smallest standard deviation of the centre of a cross-section over an even background, pixels.
pub(crate) fn center_sigma_px(
    section: &CrossSection,
    background: f64,
    noise: &SensorNoise,
    samples: Samples,
) -> f64 {
    let reach_px = (8.0 * section.sigma_px).ceil() + 8.0;
    let first = (section.center_px - reach_px).floor() as i64;
    let last = (section.center_px + reach_px).ceil() as i64;
    let mut fisher = Matrix4::zeros();
    for pixel in first..=last {
        let (level, gradient) = expected(section, background, pixel as f64);
        let information = match samples {
            Samples::Exact => exact_information(level, noise),
            Samples::SaturatedLeftOut if level >= noise.full_scale => 0.0,
            Samples::SaturatedLeftOut => 1.0 / (noise.variance(level) + 1.0 / 12.0),
        };
        fisher += information * gradient * gradient.transpose();
    }
    fisher.try_inverse().map_or(f64::NAN, |inverse| inverse[(CENTER, CENTER)].sqrt())
}

/// Index of c among the four unknowns A, c, s, B.
const CENTER: usize = 1;

/// Returns the expected level of a pixel and its derivatives with respect to A, c, s and B.
fn expected(section: &CrossSection, background: f64, pixel: f64) -> (f64, Vector4<f64>) {
    let CrossSection { center_px, amplitude, sigma_px } = *section;
    let [from, to] = [pixel - 0.5, pixel + 0.5].map(|edge| (edge - center_px) / sigma_px);
    let root = std::f64::consts::TAU.sqrt();
    let share = root * normal::share_between(from, to);
    let [at_from, at_to] = [from, to].map(|at| root * normal::density(at));
    let gradient = Vector4::new(
        sigma_px * share,
        amplitude * (at_from - at_to),
        amplitude * (share + from * at_from - to * at_to),
        1.0,
    );
    (background + amplitude * sigma_px * share, gradient)
}

impl SensorNoise {
    /// Returns the variance of a sample of that expected level, grey levels².
    fn variance(&self, level: f64) -> f64 {
        self.read_noise.powi(2) + self.shot_gain * level.max(0.0)
    }
}

/// Returns the Fisher information about the expected level in one rounded and clipped sample: see [`Samples::Exact`].
pub(crate) fn exact_information(level: f64, noise: &SensorNoise) -> f64 {
    let sigma = noise.variance(level).sqrt();
    let sigma_by_level = if level > 0.0 { noise.shot_gain / (2.0 * sigma) } else { 0.0 };
    let reach = REACH_SIGMAS * sigma + 1.0;
    let first = (level - reach).floor().clamp(0.0, noise.full_scale);
    let last = (level + reach).ceil().clamp(0.0, noise.full_scale);
    // Both ends of a level's interval, in standard deviations. The outermost levels also include everything clipped to
    // them.
    let below =
        |grey: f64| if grey <= 0.0 { f64::NEG_INFINITY } else { (grey - 0.5 - level) / sigma };
    let above = |grey: f64| {
        if grey >= noise.full_scale { f64::INFINITY } else { (grey + 0.5 - level) / sigma }
    };
    let moved = |end: f64| {
        if end.is_infinite() {
            return 0.0;
        }
        -normal::density(end) * (1.0 + end * sigma_by_level) / sigma
    };
    let mut information = 0.0;
    let mut grey = first;
    while grey <= last {
        let (from, to) = (below(grey), above(grey));
        let probability = normal::share_between(from, to);
        let change = moved(to) - moved(from);
        if probability > f64::MIN_POSITIVE {
            information += change * change / probability;
        }
        grey += 1.0;
    }
    information
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::noise::frame_rng;
    use rand_distr::{Distribution, StandardNormal};

    const EIGHT_BIT: SensorNoise =
        SensorNoise { read_noise: 2.0, shot_gain: 0.0, full_scale: 255.0 };

    fn of(section: CrossSection, background: f64, noise: SensorNoise, samples: Samples) -> f64 {
        center_sigma_px(&section, background, &noise, samples)
    }

    #[test]
    fn white_noise_matches_the_closed_form() {
        let noise = SensorNoise { read_noise: 6.0, shot_gain: 0.0, full_scale: 65_535.0 };
        for sigma_px in [1.5, 2.3, 4.2] {
            let section = CrossSection { center_px: 0.3, amplitude: 400.0, sigma_px };
            let closed = 1.062 * (6.0 / 400.0) * sigma_px.sqrt();
            for samples in [Samples::Exact, Samples::SaturatedLeftOut] {
                // A pixel as wide as 0.7 s adds a few percent of blur.
                let ratio = of(section, 1000.0, noise, samples) / closed;
                let blur = (1.0 + 1.0 / (12.0 * sigma_px * sigma_px)).powf(0.75);
                assert!((ratio / blur - 1.0).abs() < 0.01, "s {sigma_px} {samples:?}: {ratio}");
            }
        }
    }

    /// The information is the variance of the score, computed here from simulated samples and differences of log
    /// probabilities.
    #[test]
    fn information_is_the_variance_of_the_score() {
        for (level, shot_gain) in [(0.0, 0.0), (3.0, 0.4), (120.0, 0.5), (253.0, 0.0), (258.0, 0.1)]
        {
            let noise = SensorNoise { read_noise: 4.0, shot_gain, full_scale: 255.0 };
            let log_probability = |grey: f64, level: f64| {
                let sigma = (16.0 + shot_gain * level).sqrt();
                let end = |at: f64| 0.5 * libm::erfc(-(at - level) / sigma * 0.5_f64.sqrt());
                let from = if grey > 0.0 { end(grey - 0.5) } else { 0.0 };
                let to = if grey < 255.0 { end(grey + 0.5) } else { 1.0 };
                (to - from).ln()
            };
            let mut rng = frame_rng(9, 0);
            let step = 1e-4;
            let squares = (0..200_000).map(|_| {
                let normal: f64 = StandardNormal.sample(&mut rng);
                let sigma = (16.0 + shot_gain * level).sqrt();
                let grey = (level + sigma * normal).round().clamp(0.0, 255.0);
                // One-sided at 0, where the noise has a kink.
                let score = log_probability(grey, level + step) - log_probability(grey, level);
                (score / step).powi(2)
            });
            let sampled = squares.sum::<f64>() / 200_000.0;
            let ratio = exact_information(level, &noise) / sampled;
            assert!((ratio - 1.0).abs() < 0.02, "level {level}: {ratio}");
        }
    }

    /// At full scale a sample is censored with probability ½, which leaves ½ + φ(0)²/½ of its information.
    #[test]
    fn a_censored_sample_keeps_part_of_its_information() {
        let noise = SensorNoise { read_noise: 20.0, shot_gain: 0.0, full_scale: 255.0 };
        let kept = exact_information(254.5, &noise) * 400.0;
        assert!((kept - (0.5 + 1.0 / std::f64::consts::PI)).abs() < 1e-3, "{kept}");
        assert!(exact_information(255.0 + 9.0 * 20.0, &noise) < 1e-9);
        let whole = exact_information(128.0, &noise) * (400.0 + 1.0 / 12.0);
        assert!((whole - 1.0).abs() < 1e-5, "{whole}");
    }

    #[test]
    fn censored_samples_never_reduce_the_information() {
        for amplitude in [250.0, 400.0, 690.0, 2300.0] {
            let section = CrossSection { center_px: 0.2, amplitude, sigma_px: 2.9 };
            let exact = of(section, 20.0, EIGHT_BIT, Samples::Exact);
            let left_out = of(section, 20.0, EIGHT_BIT, Samples::SaturatedLeftOut);
            assert!(exact < left_out * 1.001, "A {amplitude}: {exact} {left_out}");
        }
        // If only the flanks are visible, a higher stripe makes them move faster: saturation does no harm.
        let [ordinary, bright] = [200.0, 2000.0].map(|amplitude| {
            of(
                CrossSection { center_px: 0.2, amplitude, sigma_px: 2.9 },
                20.0,
                EIGHT_BIT,
                Samples::Exact,
            )
        });
        assert!(bright < ordinary);
    }

    #[test]
    fn exact_samples_without_noise_have_no_bound() {
        let scene = StripeScene::default();
        assert!(of_scene(&scene, 0.0, Samples::Exact).is_nan());
        assert!(of_scene(&scene, 0.0, Samples::SaturatedLeftOut) > 0.0);
    }
}
