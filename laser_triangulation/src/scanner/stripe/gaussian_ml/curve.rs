//! A Gaussian integrated over pixels, and its derivatives.

use super::super::{
    elementary::exp,
    lanes::{LANES, Lane},
};

/// Gaussian stripes over an even background, one per lane. The expected level of the pixel at x is A G(x) + B.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Curve {
    /// A: level at the centre above the background for a point-like pixel, sample units.
    pub(crate) amplitude: Lane,
    /// c, pixels from the candidate's first sample.
    pub(crate) centre_px: Lane,
    /// s: standard deviation, pixels.
    pub(crate) sigma_px: Lane,
    /// B, sample units.
    pub(crate) background: Lane,
}

impl Default for Curve {
    fn default() -> Self {
        let one = [1.0; LANES];
        Self { amplitude: one, centre_px: [0.0; LANES], sigma_px: one, background: [0.0; LANES] }
    }
}

/// Response of one pixel to a Gaussian g = exp(-u²/2), u = (x - c)/s.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Pixel {
    /// G, the mean of g over the pixel.
    pub(crate) level: f32,
    /// s ∂G/∂c.
    pub(crate) by_centre: f32,
    /// s ∂G/∂s.
    pub(crate) by_sigma: f32,
}

/// 1/(24 s²) and 1/(1920 s⁴): the effect of the pixel's width for a stripe of standard deviation s.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct PixelWidth {
    second: f32,
    fourth: f32,
}

impl PixelWidth {
    #[inline(always)]
    pub(in super::super) fn of(sigma_px: f32) -> Self {
        let square = 1.0 / (sigma_px * sigma_px);
        Self { second: square / 24.0, fourth: square * square / 1920.0 }
    }
}

impl Pixel {
    /// Computes the mean over a pixel, G = g + g″/24 + g⁗/1920 + …, and its derivatives. The derivatives of g are
    /// Hermite polynomials of u times g. s ∂G/∂s = G + s² G″, because s√(2π) times a normal density obeys the heat
    /// equation.
    ///
    /// For s ≥ 0.6 px, truncating the series moves a fitted centre by less than 10⁻⁴ px.
    #[inline(always)]
    pub(in super::super) fn at(u: f32, width: PixelWidth) -> Self {
        let PixelWidth { second, fourth } = width;
        let square = u * u;
        let g = exp(-0.5 * square);
        let he2 = square - 1.0;
        let he4 = (square - 6.0) * square + 3.0;
        let he6 = ((square - 15.0) * square + 45.0) * square - 15.0;
        let mean = 1.0 + he2 * second + he4 * fourth;
        let odd = 1.0 + (square - 3.0) * second + ((square - 10.0) * square + 15.0) * fourth;
        Self {
            level: g * mean,
            by_centre: g * u * odd,
            by_sigma: g * (mean + he2 + he4 * second + he6 * fourth),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the mean over the pixel at x, from the error function.
    fn mean(x: f64, centre: f64, sigma: f64) -> f64 {
        let below = |edge: f64| 0.5 * libm::erfc(-(edge - centre) / sigma * 0.5_f64.sqrt());
        sigma * std::f64::consts::TAU.sqrt() * (below(x + 0.5) - below(x - 0.5))
    }

    #[test]
    fn a_pixel_sees_the_mean_and_its_derivatives() {
        for (sigma, limit) in [(0.6, 1.5e-3), (0.95, 1e-4), (2.3, 2e-6), (4.2, 2e-6)] {
            for step in -60..=60 {
                let u = f64::from(step) / 10.0;
                let x = u * sigma;
                let pixel = Pixel::at(u as f32, PixelWidth::of(sigma as f32));
                let h = 1e-5;
                let by_centre = (mean(x, h, sigma) - mean(x, -h, sigma)) / (2.0 * h) * sigma;
                let by_sigma =
                    (mean(x, 0.0, sigma + h) - mean(x, 0.0, sigma - h)) / (2.0 * h) * sigma;
                for (name, got, expected) in [
                    ("level", pixel.level, mean(x, 0.0, sigma)),
                    ("by centre", pixel.by_centre, by_centre),
                    ("by sigma", pixel.by_sigma, by_sigma),
                ] {
                    let error = (f64::from(got) - expected).abs();
                    assert!(error < 4.0 * limit, "s {sigma} u {u} {name}: {error:.1e}");
                }
            }
        }
    }
}
