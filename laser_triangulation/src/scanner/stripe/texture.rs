//! Speckle and surface texture move the centres of a stripe from line to line, which the noise of the pixels does not
//! explain. Their share is estimated from the scatter of the centres along the stripe, for every part of it.
//!
//! Fourth differences p₁ - 4p₂ + 6p₃ - 4p₄ + p₅ at a distance at which centres hardly share a pixel or a speckle have up to 70
//! times a centre's variance; a smooth surface hardly contributes to them. Stripes with many gaps have too few of them;
//! there second differences of neighbours show at least the errors that are independent from line to line. The differences
//! are divided by their stated standard deviation; the median magnitude of the quotients, 0.6745 for normal errors of the
//! stated size, is robust against steps, gaps and outliers.
//!
//! Structures of the surface that are as fine as the distance count as texture, too.

mod difference;
mod long_tails;

use std::ops::Range;

use super::{Centerline, SigmaParts, correlation::Correlation, elementary::in_quadrature};
use crate::{
    scanner::params::{ExtractionParams, StripeDirection},
    statistics::median,
};
use difference::{Difference, Points, Scatter};

/// Approximate number of differences, or points, evaluated per frame, and per part of it.
const DIFFERENCES: usize = 512;
const DIFFERENCES_OF_PART: usize = 256;
/// Surfaces differ along the stripe: the texture of this many points is estimated from them and as many to either side.
const PART: usize = 64;
/// Speckles are smaller than this, pixels: errors may be correlated over it.
const LARGEST_SPECKLE_PX: usize = 5;
/// At the distance of the fourth differences, their variance is at least this share of that of independent errors.
const LEAST_SHARE: f64 = 0.5;
/// Fewer differences give no estimate.
const LEAST: usize = 32;

/// Estimates texture frame after frame. Keeps its buffers.
#[derive(Debug)]
pub(super) struct TextureEstimator {
    direction: StripeDirection,
    far: Difference<5>,
    near: Difference<3>,
    /// Squares of differences over their variances, or standard deviations.
    buffer: Vec<f32>,
    /// Texture of each part of the stripe, pixels.
    parts_px: Vec<f32>,
}

impl TextureEstimator {
    /// Creates an estimator for centrelines that are found with these parameters.
    pub(super) fn new(params: &ExtractionParams, direction: StripeDirection) -> Self {
        let correlation = Correlation::along_the_stripe(params);
        let fourth =
            |distance| Difference::new([1.0, -4.0, 6.0, -4.0, 1.0], distance, &correlation);
        let mut far = fourth(LARGEST_SPECKLE_PX);
        while far.share_of_independent() < LEAST_SHARE {
            far = fourth(far.distance() + 1);
        }
        Self {
            direction,
            far,
            near: Difference::new([1.0, -2.0, 1.0], 1, &correlation),
            buffer: Vec::new(),
            parts_px: Vec::new(),
        }
    }

    /// Adds the texture of its part to every sigma, then widens the sigma of outliers. Returns the medians of noise and
    /// texture over the stripe; `None` without points. There is no texture if the stated noise explains the scatter, or if
    /// the stripe is too short.
    pub(super) fn add_to(&mut self, centerline: &mut Centerline) -> Option<SigmaParts> {
        let step = centerline.len() / DIFFERENCES + 1;
        self.buffer.clear();
        self.buffer.extend(centerline.sigma_px.iter().step_by(step));
        let noise_px = median(&mut self.buffer)?;
        let texture_px = self.add(centerline);
        long_tails::widen(centerline, self.direction);
        Some(SigmaParts { noise_px, texture_px })
    }

    /// Returns the median of the texture that it adds, pixels.
    fn add(&mut self, centerline: &mut Centerline) -> f32 {
        let num = centerline.sigma_px.len();
        let whole = self.excess(centerline, 0..num, DIFFERENCES, Scatter::significant_excess);
        let Some(whole) = whole.filter(|&excess| excess > 0.0) else { return 0.0 };
        let whole_px = self.texture_px(&centerline.sigma_px, whole);
        let num_parts = num.div_ceil(PART);
        let parts = (0..num_parts).map(|at| at * num / num_parts..(at + 1) * num / num_parts);
        self.parts_px.clear();
        for part in parts.clone() {
            let around = part.start.saturating_sub(PART)..(part.end + PART).min(num);
            let own = self.excess(centerline, around.clone(), DIFFERENCES_OF_PART, Scatter::excess);
            let own_px = own.map(|excess| self.texture_px(&centerline.sigma_px[around], excess));
            self.parts_px.push(own_px.unwrap_or(whole_px));
        }
        for (part, &texture_px) in parts.zip(&self.parts_px) {
            for sigma_px in &mut centerline.sigma_px[part] {
                *sigma_px = in_quadrature(*sigma_px, texture_px);
            }
        }
        median(&mut self.parts_px).unwrap_or(0.0)
    }

    /// Returns the variance of texture, in stated variances of a centre, from up to about `most` differences between points of
    /// the range, of neighbours where gaps leave too few at a distance; `None` if there are too few of either.
    fn excess(
        &mut self,
        centerline: &Centerline,
        range: Range<usize>,
        most: usize,
        excess: impl Fn(&Scatter) -> f64,
    ) -> Option<f64> {
        let points = Points::of(centerline, self.direction).part(range);
        let far = self.far.scatter(&points, most, &mut self.buffer);
        if far.num >= LEAST {
            return Some(excess(&far));
        }
        let near = self.near.scatter(&points, most, &mut self.buffer);
        // That of independent errors, which is the least that explains it.
        let share = self.near.share_of_independent();
        (near.num >= LEAST).then(|| share * excess(&near))
    }

    /// Returns the texture of points with these standard deviations, pixels; `excess` is its variance in theirs.
    fn texture_px(&mut self, sigmas_px: &[f32], excess: f64) -> f32 {
        self.buffer.clear();
        self.buffer.extend_from_slice(sigmas_px);
        let sigma_px = f64::from(median(&mut self.buffer).unwrap_or(0.0));
        (sigma_px * excess.max(0.0).sqrt()) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scanner::params::Method;
    use rand::SeedableRng as _;
    use rand_distr::Distribution as _;

    /// Centres of a curved stripe with independent errors of that standard deviation, and the stated one.
    pub(super) fn line(scatter_px: f64, stated_px: f32, num: usize) -> Centerline {
        let mut rng = rand_chacha::ChaCha8Rng::from_seed([3; 32]);
        let error = rand_distr::Normal::new(0.0, scatter_px).unwrap();
        let mut line = Centerline::default();
        for i in 0..num {
            line.u_px.push(i as f32);
            let curve = 240.0 + 57.6 * (5.0 * i as f64 / 640.0).sin();
            // A step.
            let curve = curve + if i > num / 3 { 20.0 } else { 0.0 };
            line.v_px.push((curve + error.sample(&mut rng)) as f32);
            line.sigma_px.push(stated_px);
        }
        line
    }

    fn estimator() -> TextureEstimator {
        let params = ExtractionParams { method: Method::GaussianMl, ..ExtractionParams::default() };
        TextureEstimator::new(&params, StripeDirection::Horizontal)
    }

    #[test]
    fn scatter_beyond_the_noise_is_texture() {
        for (scatter, stated) in [(0.1, 0.02), (0.5, 0.02), (0.05, 0.04)] {
            let mut line = line(scatter, stated, 2000);
            let texture = f64::from(estimator().add_to(&mut line).unwrap().texture_px);
            let expected = (scatter.powi(2) - f64::from(stated).powi(2)).sqrt();
            let tolerance = 0.15 * (expected + f64::from(stated));
            assert!((texture - expected).abs() < tolerance, "{texture}, not {expected}");
            let sigma_px = f64::from(median(&mut line.sigma_px).unwrap());
            assert!((sigma_px / scatter - 1.0).abs() < 0.1, "{sigma_px}");
        }
    }

    #[test]
    fn noise_as_stated_or_less_and_short_stripes_change_nothing() {
        for (scatter, num) in [(0.02, 2000), (0.005, 2000), (0.4, 20), (0.4, 0)] {
            let before = line(scatter, 0.02, num);
            let mut after = before.clone();
            let texture_px = estimator().add_to(&mut after).map_or(0.0, |parts| parts.texture_px);
            assert!(texture_px <= 0.0);
            assert_eq!(before, after);
        }
    }

    #[test]
    fn every_part_has_a_texture_of_its_own() {
        let (smooth, rough) = (line(0.02, 0.02, 2000), line(0.4, 0.02, 2000));
        let mut both = smooth;
        both.v_px[1200..].copy_from_slice(&rough.v_px[1200..]);
        estimator().add_to(&mut both);
        for (range, expected) in [(0..1100, 0.02), (1300..2000, 0.4)] {
            let mut sigmas_px = both.sigma_px[range].to_vec();
            let sigma_px = median(&mut sigmas_px).unwrap();
            assert!((sigma_px / expected - 1.0_f32).abs() < 0.15, "{sigma_px}, not {expected}");
        }
    }
}
