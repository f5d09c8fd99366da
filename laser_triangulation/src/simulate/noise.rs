//! Random numbers that depend only on the seed and the frame: frames can be rendered in any order, on any thread.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Returns the generator of one frame: the same for the same (seed, frame), independent of all other frames.
pub fn frame_rng(seed: u64, frame: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(frame);
    rng
}

/// Returns the brightness along a stripe of `length` cross-sections as a share of its mean: normal with standard
/// deviation `contrast`, smoothed by a Gaussian of standard deviation `sigma_px`, never below 0.
pub fn speckle(rng: &mut impl Rng, length: u32, contrast: f64, sigma_px: f64) -> Vec<f64> {
    let radius = (3.0 * sigma_px).ceil() as usize;
    let kernel: Vec<f64> = (0..=2 * radius)
        .map(|k| libm::exp(-0.5 * ((k as f64 - radius as f64) / sigma_px.max(1e-9)).powi(2)))
        .collect();
    // A kernel gives white noise the variance Σ k².
    let gain = contrast / kernel.iter().map(|k| k * k).sum::<f64>().sqrt();
    let white: Vec<f64> =
        (0..length as usize + 2 * radius).map(|_| StandardNormal.sample(rng)).collect();
    white
        .windows(kernel.len())
        .map(|window| {
            let smooth: f64 = window.iter().zip(&kernel).map(|(noise, k)| noise * k).sum();
            (1.0 + gain * smooth).max(0.0)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the mean product of deviations from 1 of entries `lag` apart.
    fn covariance(shares: &[f64], lag: usize) -> f64 {
        let products = shares.iter().zip(&shares[lag..]).map(|(a, b)| (a - 1.0) * (b - 1.0));
        products.sum::<f64>() / (shares.len() - lag) as f64
    }

    #[test]
    fn speckle_has_the_stated_contrast_and_length() {
        let shares = speckle(&mut frame_rng(3, 1), 100_000, 0.2, 4.0);
        assert_eq!(shares.len(), 100_000);
        // Two entries d apart correlate with exp(−d²/4s²).
        for (lag, correlation) in [(0, 1.0), (4, 0.7788), (8, 0.3679), (40, 0.0)] {
            let expected = 0.04 * correlation;
            assert!((covariance(&shares, lag) - expected).abs() < 0.002, "lag {lag}");
        }
        let white = speckle(&mut frame_rng(3, 1), 100_000, 0.2, 0.0);
        assert!((covariance(&white, 0) - 0.04).abs() < 0.002);
        assert!(covariance(&white, 1).abs() < 0.002);
    }

    #[test]
    fn without_contrast_the_stripe_is_even() {
        assert_eq!(speckle(&mut frame_rng(3, 1), 100, 0.0, 4.0), [1.0; 100]);
    }

    #[test]
    fn frames_are_independent_of_their_order() {
        let draw = |seed, frame| frame_rng(seed, frame).next_u64();
        assert_eq!(draw(1, 5), draw(1, 5));
        assert_ne!(draw(1, 5), draw(1, 6));
        assert_ne!(draw(1, 5), draw(2, 5));
    }
}
