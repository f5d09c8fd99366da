//! Light on the sensor: expected grey levels, before noise, saturation and rounding.

use crate::scanner::params::StripeDirection;

/// Number of standard deviations beyond which a stripe adds less than 10⁻¹⁴ of its amplitude.
const REACH_SIGMAS: f64 = 8.0;

/// Position and brightness of the light in one column (row, for a vertical stripe).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrossSection {
    /// Centre across the stripe, pixels; NaN if there is no light.
    pub center_px: f64,
    /// Peak grey level for infinitely small pixels.
    pub amplitude: f64,
    /// Standard deviation across the stripe, pixels.
    pub sigma_px: f64,
}

/// Expected grey level of every pixel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Exposure {
    width: u32,
    height: u32,
    levels: Vec<f32>,
}

impl Exposure {
    /// Starts an image of `width` x `height` pixels over an even `background`; the buffer is reused.
    pub fn reset(&mut self, width: u32, height: u32, background: f32) {
        self.width = width;
        self.height = height;
        self.levels.clear();
        self.levels.resize(width as usize * height as usize, background);
    }

    /// Returns the expected grey levels, row by row.
    pub fn levels(&self) -> &[f32] {
        &self.levels
    }

    /// Adds `level(column, row)` to each pixel.
    pub fn add(&mut self, mut level: impl FnMut(u32, u32) -> f32) {
        for (row, line) in (0..).zip(self.levels.chunks_exact_mut(self.width.max(1) as usize)) {
            for (column, pixel) in (0..).zip(line) {
                *pixel += level(column, row);
            }
        }
    }

    /// Multiplies each pixel, row by row, by its factor; pixels beyond the last factor stay unchanged.
    pub(crate) fn multiply(&mut self, factors: &[f32]) {
        for (pixel, factor) in self.levels.iter_mut().zip(factors) {
            *pixel *= factor;
        }
    }

    /// Adds a stripe that runs in `direction`; `cross_section` is called once for each column (row, if vertical).
    ///
    /// The Gaussian is integrated over each pixel: the level of the pixel at k is
    /// A · s·√(2π) · (Φ((k + ½ − c)/s) − Φ((k − ½ − c)/s)).
    pub fn add_stripe(
        &mut self,
        direction: StripeDirection,
        cross_section: impl Fn(u32) -> CrossSection,
    ) {
        let (width, height) = (self.width as usize, self.height as usize);
        let (length, across, along_step, across_step) = match direction {
            StripeDirection::Horizontal => (width, height, 1, width),
            StripeDirection::Vertical => (height, width, width, 1),
        };
        for along in 0..length {
            let section = cross_section(along as u32);
            let pixels = self.levels[along * along_step..].iter_mut().step_by(across_step);
            add_cross_section(&section, pixels.take(across));
        }
    }
}

/// Adds one cross-section to the pixels that it covers.
fn add_cross_section<'a>(section: &CrossSection, pixels: impl Iterator<Item = &'a mut f32>) {
    let CrossSection { center_px, amplitude, sigma_px } = *section;
    if !center_px.is_finite() {
        return;
    }
    let reach = REACH_SIGMAS * sigma_px + 1.0;
    let first = (center_px - reach).max(0.0) as usize;
    let end = (center_px + reach + 1.0).max(0.0) as usize;
    let flux = amplitude * sigma_px * std::f64::consts::TAU.sqrt();
    let share_below = |edge_px: f64| normal_cdf((edge_px - center_px) / sigma_px);
    let mut below = share_below(first as f64 - 0.5);
    for (index, pixel) in pixels.enumerate().take(end).skip(first) {
        let below_next = share_below(index as f64 + 0.5);
        *pixel += (flux * (below_next - below)) as f32;
        below = below_next;
    }
}

/// Returns Φ, the standard normal distribution function at `x`.
fn normal_cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2)
}

#[cfg(test)]
mod tests {
    use super::*;

    const AMPLITUDE: f64 = 183.0;
    const SIGMA_PX: f64 = 2.3;

    /// Returns the 64 levels across a stripe centred at `center_px`.
    fn levels(center_px: f64, direction: StripeDirection) -> Vec<f32> {
        let mut exposure = Exposure::default();
        match direction {
            StripeDirection::Horizontal => exposure.reset(1, 64, 0.0),
            StripeDirection::Vertical => exposure.reset(64, 1, 0.0),
        }
        exposure.add_stripe(direction, |_| CrossSection {
            center_px,
            amplitude: AMPLITUDE,
            sigma_px: SIGMA_PX,
        });
        exposure.levels().to_vec()
    }

    #[test]
    fn flux_and_centroid_match_the_gaussian() {
        for tenth in 0..20 {
            let center = 31.0 + f64::from(tenth) / 10.0;
            let levels = levels(center, StripeDirection::Horizontal);
            let flux: f64 = levels.iter().map(|&level| f64::from(level)).sum();
            let moment: f64 =
                levels.iter().enumerate().map(|(k, &level)| k as f64 * f64::from(level)).sum();
            assert!((flux - 183.0 * 2.3 * 2.506_628_274_631).abs() < 1e-3, "{flux}");
            assert!((moment / flux - center).abs() < 1e-5, "{center}: {}", moment / flux);
        }
    }

    #[test]
    fn a_stripe_on_a_pixel_centre_is_symmetric_and_its_peak_is_the_pixel_mean() {
        let levels = levels(32.0, StripeDirection::Horizontal);
        for k in 1..=20 {
            assert!((levels[32 - k] - levels[32 + k]).abs() < 1e-4);
        }
        // Mean of exp(−x²/2s²) over ±½ px: its series 1 − x²/2s² + x⁴/8s⁴ integrated by hand.
        let mean = 1.0 - 1.0 / (24.0 * 2.3 * 2.3) + 1.0 / (640.0 * 2.3_f64.powi(4));
        assert!((f64::from(levels[32]) - 183.0 * mean).abs() < 1e-3);
    }

    #[test]
    fn a_vertical_stripe_is_the_transposed_horizontal_one() {
        let horizontal = levels(30.3, StripeDirection::Horizontal);
        assert_eq!(horizontal, levels(30.3, StripeDirection::Vertical));
    }

    #[test]
    fn a_stripe_beyond_the_border_shows_only_its_tail() {
        let below_zero = levels(-1.0, StripeDirection::Horizontal);
        assert!((f64::from(below_zero[0]) - 183.0 * (-0.5_f64 / (2.3 * 2.3)).exp()).abs() < 3.0);
        for nowhere in [-1e9, 1e9, f64::NAN, f64::INFINITY] {
            assert!(levels(nowhere, StripeDirection::Vertical).iter().all(|&level| level == 0.0));
        }
    }
}
