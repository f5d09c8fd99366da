//! Speckle: the granular light that a rough surface scatters from a laser.
//!
//! Fully developed speckle is |f|² of a complex Gaussian field f: its brightness is exponentially distributed, with a
//! standard deviation equal to its mean (Goodman, Speckle Phenomena in Optics, 2007, eq. 3-16). At a contrast C < 1 the
//! rest of the light is uniform: 1 − C + C |f|².

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// Speckle across an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Speckle {
    /// Standard deviation of the brightness over its mean, 0 … 1.
    pub(crate) contrast: f64,
    /// Size of a grain, pixels: brightness at a distance d correlates with exp(−d² / (2 · `grain_px`²)).
    pub(crate) grain_px: f64,
}

impl Speckle {
    /// Returns the brightness of every pixel of an image, row by row, as a share of the mean.
    pub(crate) fn pattern(&self, rng: &mut impl Rng, (width, height): (usize, usize)) -> Vec<f32> {
        let kernel = kernel(self.grain_px);
        let mut part = || field(rng, (width, height), &kernel);
        let (real, imaginary) = (part(), part());
        let contrast = self.contrast as f32;
        let intensity = real.iter().zip(&imaginary).map(|(re, im)| 0.5 * (re * re + im * im));
        intensity.map(|share| 1.0 - contrast + contrast * share).collect()
    }

    /// Returns the standard deviation of the centroid of a Gaussian stripe of standard deviation `sigma_px` under this
    /// speckle, for one column and to first order in the contrast, pixels.
    ///
    /// With weights w = N(0, s²) and the covariance above, Var = C² ∬ x y w(x) w(y) exp(−(x − y)² / 2g²) dx dy
    /// = C² s² k (1 − k²) / 2 with k² = g² / (g² + 2 s²).
    pub(crate) fn centroid_sigma_px(&self, sigma_px: f64) -> f64 {
        let grain = self.grain_px * self.grain_px;
        let k2 = grain / (grain + 2.0 * sigma_px * sigma_px);
        self.contrast * sigma_px * (0.5 * k2.sqrt() * (1.0 - k2)).sqrt()
    }
}

/// Returns weights that keep the variance of white noise and give it the correlation exp(−d² / 4g²). Its square is the
/// correlation of the brightness.
fn kernel(grain_px: f64) -> Vec<f32> {
    let radius = (4.0 * grain_px).ceil();
    let weight = |k: i32| libm::exp(-0.5 * ((f64::from(k) - radius) / grain_px.max(1e-9)).powi(2));
    let weights: Vec<f64> = (0..=2 * radius as i32).map(weight).collect();
    let gain = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
    weights.iter().map(|w| (w / gain) as f32).collect()
}

/// Returns white noise smoothed along both axes, with variance 1.
fn field(rng: &mut impl Rng, (width, height): (usize, usize), kernel: &[f32]) -> Vec<f32> {
    let margin = kernel.len() - 1;
    let (wide, high) = (width + margin, height + margin);
    let white: Vec<f32> = StandardNormal.sample_iter(rng).take(wide * high).collect();
    let weighted = |samples: &mut dyn Iterator<Item = f32>| {
        samples.zip(kernel).map(|(sample, weight)| sample * weight).sum::<f32>()
    };
    let mut rows = Vec::with_capacity(width * high);
    for row in white.chunks_exact(wide) {
        rows.extend(row.windows(kernel.len()).map(|w| weighted(&mut w.iter().copied())));
    }
    let mut smooth = Vec::with_capacity(width * height);
    for y in 0..height {
        for x in 0..width {
            smooth.push(weighted(&mut rows[y * width + x..].iter().step_by(width).copied()));
        }
    }
    smooth
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::noise::frame_rng;

    #[test]
    fn brightness_is_exponential_and_correlates_as_stated() {
        let speckle = Speckle { contrast: 1.0, grain_px: 1.5 };
        let (width, height) = (600, 400);
        let pattern = speckle.pattern(&mut frame_rng(4, 0), (width, height));
        assert_eq!(pattern.len(), width * height);
        let count = pattern.len() as f64;
        let mean = pattern.iter().map(|&share| f64::from(share)).sum::<f64>() / count;
        assert!((mean - 1.0).abs() < 0.02, "{mean}");
        let darker = pattern.iter().filter(|&&share| share < 0.5).count() as f64 / count;
        assert!((darker - (1.0 - (-0.5_f64).exp())).abs() < 0.01, "{darker}");
        let covariance = |dx: usize, dy: usize| {
            let products = (0..height - dy).flat_map(|y| (0..width - dx).map(move |x| (x, y)));
            let at = |x, y| f64::from(pattern[y * width + x]) - mean;
            let sum: f64 = products.map(|(x, y)| at(x, y) * at(x + dx, y + dy)).sum();
            sum / ((width - dx) * (height - dy)) as f64
        };
        for (dx, dy) in [(0, 0), (2, 0), (0, 2), (1, 1), (12, 0)] {
            let expected = (-((dx * dx + dy * dy) as f64) / 4.5).exp();
            let found = covariance(dx, dy);
            assert!((found - expected).abs() < 0.06, "{dx} {dy}: {found} {expected}");
        }
    }

    #[test]
    fn the_centroids_deviation_matches_the_formula() {
        let speckle = Speckle { contrast: 0.1, grain_px: 1.2 };
        let (width, height, sigma_px) = (4000, 41, 2.5);
        let pattern = speckle.pattern(&mut frame_rng(4, 1), (width, height));
        let mut squares = 0.0;
        for x in 0..width {
            let level = |y: usize| {
                let profile = (-0.5 * ((y as f64 - 20.0) / sigma_px).powi(2)).exp();
                profile * f64::from(pattern[y * width + x])
            };
            let flux: f64 = (0..height).map(level).sum();
            let moment: f64 = (0..height).map(|y| (y as f64 - 20.0) * level(y)).sum();
            squares += (moment / flux).powi(2);
        }
        let ratio = (squares / width as f64).sqrt() / speckle.centroid_sigma_px(sigma_px);
        assert!((ratio - 1.0).abs() < 0.06, "{ratio}");
    }

    #[test]
    fn without_contrast_the_light_is_uniform() {
        let even = Speckle { contrast: 0.0, grain_px: 1.0 };
        assert!(
            even.pattern(&mut frame_rng(1, 0), (7, 5))
                .iter()
                .all(|&share| (share - 1.0).abs() < 1e-6)
        );
        assert!(even.centroid_sigma_px(2.0).abs() < 1e-15);
    }
}
