//! The adaptive segment threshold: a number of standard deviations of the searched image's noise above its median.
//!
//! The standard deviation is 1.4826 times the median absolute deviation (Rousseeuw and Croux 1993, doi
//! 10.1080/01621459.1993.10476408), which is robust against a stripe or a few bright objects. Both medians are taken
//! over a grid of samples, which bounds the cost.

use super::blur::UNITS;
use crate::statistics::{MAD_TO_SIGMA, median};

/// Maximum samples of the grid per row and per column.
const GRID: usize = 128;

/// Finds thresholds frame after frame. Keeps its buffer.
#[derive(Debug, Default)]
pub(super) struct NoiseThreshold {
    samples: Vec<u32>,
}

impl NoiseThreshold {
    /// Returns the threshold of an image of `width` x `height` samples, blurred units; `sample` returns the one in a
    /// column and row. It lies `sigmas` standard deviations above the median. The standard deviation is at least that
    /// of rounding one sample: in a picture clipped to black, the blur would leave less than any noise.
    pub(super) fn find(
        &mut self,
        (width, height): (usize, usize),
        sample: impl Fn(usize, usize) -> u32,
        sigmas: f64,
    ) -> u32 {
        let (step_x, step_y) = (width.div_ceil(GRID), height.div_ceil(GRID));
        self.samples.clear();
        for y in (step_y / 2..height).step_by(step_y) {
            self.samples.extend((step_x / 2..width).step_by(step_x).map(|x| sample(x, y)));
        }
        let middle = median(&mut self.samples).unwrap_or_default();
        for sample in &mut self.samples {
            *sample = sample.abs_diff(middle);
        }
        let deviation = MAD_TO_SIGMA * f64::from(median(&mut self.samples).unwrap_or_default());
        (f64::from(middle) + sigmas * deviation.max(rounding_noise())).round() as u32
    }
}

/// Returns the standard deviation of rounding to whole grey levels, blurred units.
fn rounding_noise() -> f64 {
    f64::from(UNITS) / 12.0_f64.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::Distribution;

    #[test]
    fn gaussian_noise_is_found_under_a_stripe() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let noise = rand_distr::Normal::new(5000.0_f64, 300.0).unwrap();
        let (width, height) = (640, 480);
        let mut image: Vec<u32> =
            (0..width * height).map(|_| noise.sample(&mut rng).round() as u32).collect();
        // One row in a hundred is stripe.
        image[200 * width..205 * width].fill(60_000);
        let sample = |x: usize, y: usize| image[y * width + x];
        let found = NoiseThreshold::default().find((width, height), sample, 8.0);
        assert!((f64::from(found) - 5000.0 - 8.0 * 300.0).abs() < 250.0, "{found}");
    }

    #[test]
    fn a_black_image_has_the_noise_of_rounding() {
        let find = |size, level| NoiseThreshold::default().find(size, |_, _| level, 8.0);
        assert_eq!(find((640, 480), 0), 591, "8 · 256 / √12");
        assert_eq!(find((1, 1), 1000), 1591);
    }
}
