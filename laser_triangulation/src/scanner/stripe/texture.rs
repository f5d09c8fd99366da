//! Speckle and surface texture move the centres of a stripe from line to line, which the noise of the pixels does not
//! explain. Their share is estimated per frame from the scatter of the centres along the stripe.
//!
//! Fourth differences p₁ - 4p₂ + 6p₃ - 4p₄ + p₅ at a distance at which centres share neither pixel nor speckle have 70
//! times a centre's variance; a smooth surface hardly contributes to them. Second differences of neighbours show errors
//! that are correlated over less than that distance. Both are divided by their stated standard deviation; the median
//! magnitude of the quotients, 0.6745 for normal errors of the stated size, is robust against steps, gaps and outliers.
//!
//! Structures of the surface that are as fine as the distance count as texture, too.
//!
//! In strong speckle errors have longer tails than normal ones. Where that shows, the outliers' own sigma is widened.

use super::{Centerline, correlation::Correlation, elementary::in_quadrature};
use crate::{
    scanner::params::{ExtractionParams, StripeDirection},
    statistics::{NORMAL_MEDIAN_MAGNITUDE, median},
};

/// Approximate number of differences evaluated per frame.
const DIFFERENCES: usize = 512;
/// Speckles are smaller than this, pixels: the stripe's own errors may be correlated over it.
const LARGEST_SPECKLE_PX: usize = 7;
/// Fewer differences give no estimate.
const LEAST: usize = 32;
/// Errors have long tails if this share of the points lies farther than so many of their standard deviations from the
/// curve through their neighbours. Of normal errors 2 % do, and a few narrow structures of the surface must not count.
const FAR_SIGMAS: f32 = 3.0;
const LONG_TAILS: f64 = 0.07;
/// Approximate number of points for which that is tested.
const DEVIATIONS: usize = 256;
/// With long tails, points farther off than this many standard deviations are outliers.
const OFF_SIGMAS: f32 = 2.0;
/// Scatter above the stated one by up to this share plus this many standard errors is chance.
const CHANCE: (f64, f64) = (0.05, 3.0);
/// Standard error of the median magnitude of n normal numbers, times √n, as a share of it: 1 / (4 φ(0.6745) 0.6745).
const MEDIAN_ERROR: f64 = 1.17;

/// Estimates texture frame after frame. Keeps its buffer.
#[derive(Debug)]
pub(super) struct TextureEstimator {
    direction: StripeDirection,
    /// Distance at which centres share neither pixel nor speckle.
    distance: usize,
    /// Variance of the second difference of neighbours, in variances of a centre.
    neighbour_gain: f64,
    /// Squares of differences over their variances, or standard deviations.
    quotients: Vec<f32>,
    last_px: f32,
}

impl TextureEstimator {
    /// Creates an estimator for centrelines that are found with these parameters.
    pub(super) fn new(params: &ExtractionParams, direction: StripeDirection) -> Self {
        let correlation = Correlation::along_the_stripe(params);
        Self {
            direction,
            distance: correlation.independent_distance().max(LARGEST_SPECKLE_PX),
            neighbour_gain: correlation.variance(&[1.0, -2.0, 1.0]),
            quotients: Vec::new(),
            last_px: 0.0,
        }
    }

    /// Returns the standard deviation of the centres from texture, pixels, and adds it to every sigma; then widens the sigma
    /// of outliers. Returns 0 if the stated noise explains the scatter, or if the stripe is too short.
    pub(super) fn add_to(&mut self, centerline: &mut Centerline) -> f32 {
        self.last_px = self.add(centerline);
        self.widen_outliers(centerline);
        self.last_px
    }

    /// The share of texture in the last centreline, pixels.
    pub(super) const fn last_px(&self) -> f32 {
        self.last_px
    }

    fn add(&mut self, centerline: &mut Centerline) -> f32 {
        let distance = self.distance;
        let far = self.scatter(centerline, distance, &[1.0, -4.0, 6.0, -4.0, 1.0], 70.0);
        let near = self.scatter(centerline, 1, &[1.0, -2.0, 1.0], self.neighbour_gain);
        let ratio = far.max(near);
        if ratio <= 1.0 {
            return 0.0;
        }
        self.quotients.clear();
        self.quotients.extend_from_slice(&centerline.sigma_px);
        let sigma_px = f64::from(median(&mut self.quotients).unwrap_or(0.0));
        let texture_px = (sigma_px * (ratio * ratio - 1.0).sqrt()) as f32;
        for sigma_px in &mut centerline.sigma_px {
            *sigma_px = in_quadrature(*sigma_px, texture_px);
        }
        texture_px
    }

    /// Widens the sigma of points that lie far from the curve through their neighbours, if so many do that the errors have
    /// long tails.
    fn widen_outliers(&mut self, centerline: &mut Centerline) {
        let (along, across) = match self.direction {
            StripeDirection::Horizontal => (&centerline.u_px, &centerline.v_px),
            StripeDirection::Vertical => (&centerline.v_px, &centerline.u_px),
        };
        let sigmas = &mut centerline.sigma_px;
        let num = sigmas.len();
        let step = num / DEVIATIONS + 1;
        let is_far =
            |&at: &usize| deviation_px(along, across, at, self.distance) > FAR_SIGMAS * sigmas[at];
        let num_far = (0..num).step_by(step).filter(is_far).count();
        if num < LEAST || ((num_far * step) as f64) < LONG_TAILS * num as f64 {
            return;
        }
        for (at, sigma) in sigmas.iter_mut().enumerate() {
            let deviation = deviation_px(along, across, at, self.distance);
            if deviation > OFF_SIGMAS * *sigma {
                *sigma = in_quadrature(*sigma, deviation);
            }
        }
    }

    /// Returns the scatter of the differences with these weights, divided by the stated one; 1 if chance explains it or
    /// there are too few. `gain` is the variance of a difference in variances of a centre.
    fn scatter<const N: usize>(
        &mut self,
        centerline: &Centerline,
        distance: usize,
        weights: &[f32; N],
        gain: f64,
    ) -> f64 {
        let (along, across) = match self.direction {
            StripeDirection::Horizontal => (&centerline.u_px, &centerline.v_px),
            StripeDirection::Vertical => (&centerline.v_px, &centerline.u_px),
        };
        let reach = (N - 1) * distance;
        let step = along.len() / DIFFERENCES + 1;
        let mean_gain = gain as f32 / N as f32;
        self.quotients.clear();
        for from in (0..along.len().saturating_sub(reach)).step_by(step) {
            // Lines without a gap, of one stripe.
            #[expect(clippy::float_cmp, reason = "numbers of lines are integers")]
            if along[from + reach] - along[from] != reach as f32 {
                continue;
            }
            let (mut difference, mut variance) = (0.0, 0.0);
            for (i, weight) in weights.iter().enumerate() {
                let sigma = centerline.sigma_px[from + i * distance];
                difference += weight * across[from + i * distance];
                variance += sigma * sigma;
            }
            self.quotients.push(difference * difference / (variance * mean_gain));
        }
        if self.quotients.len() < LEAST {
            return 1.0;
        }
        let chance = CHANCE.0 + CHANCE.1 * MEDIAN_ERROR / (self.quotients.len() as f64).sqrt();
        // The square of the median magnitude.
        let median = f64::from(median(&mut self.quotients).unwrap_or(0.0));
        let ratio = median.sqrt() / NORMAL_MEDIAN_MAGNITUDE;
        if ratio > 1.0 + chance { ratio } else { 1.0 }
    }
}

/// Returns the deviation of a centre from the curve through its neighbours at a distance: a parabola through three before
/// it or three behind it, or a cubic through two on either side, whichever is closest. 0 without such neighbours.
fn deviation_px(along: &[f32], across: &[f32], at: usize, distance: usize) -> f32 {
    let here = across[at];
    // NaN where there is no such neighbour.
    let before = |steps: usize| {
        let offset = steps * distance;
        if at < offset || !is_apart(along[at - offset], along[at], offset) {
            return f32::NAN;
        }
        across[at - offset]
    };
    let behind = |steps: usize| {
        let offset = steps * distance;
        if at + offset >= along.len() || !is_apart(along[at], along[at + offset], offset) {
            return f32::NAN;
        }
        across[at + offset]
    };
    let (a, b, c) = (before(1), before(2), before(3));
    let (d, e, f) = (behind(1), behind(2), behind(3));
    let before_it = (here - 3.0 * (a - b) - c).abs();
    let behind_it = (here - 3.0 * (d - e) - f).abs();
    let between = (here - (4.0 * (a + d) - (b + e)) / 6.0).abs();
    // `min` ignores NaN.
    let closest = before_it.min(behind_it).min(between);
    if closest.is_nan() { 0.0 } else { closest }
}

#[expect(clippy::float_cmp, reason = "numbers of lines are integers")]
fn is_apart(first: f32, second: f32, distance: usize) -> bool {
    second - first == distance as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scanner::params::Method;
    use rand::SeedableRng as _;
    use rand_distr::Distribution as _;

    /// Centres of a curved stripe with independent errors of that standard deviation, and the stated one.
    fn line(scatter_px: f64, stated_px: f32, num: usize) -> Centerline {
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
            let texture = f64::from(estimator().add_to(&mut line));
            let expected = (scatter.powi(2) - f64::from(stated).powi(2)).sqrt();
            let tolerance = 0.15 * (expected + f64::from(stated));
            assert!((texture - expected).abs() < tolerance, "{texture}, not {expected}");
            assert!((f64::from(line.sigma_px[7]) / scatter - 1.0).abs() < 0.1);
        }
    }

    #[test]
    fn long_tails_widen_the_outliers_and_a_few_narrow_structures_stay() {
        let deviation_px = 0.4;
        for (every, least_wide, most_others) in [(16, 118, 200), (100, 0, 0)] {
            let mut line = line(0.02, 0.02, 2000);
            let structures: Vec<usize> = (40..1960).step_by(every).collect();
            for &at in &structures {
                line.v_px[at] += deviation_px;
            }
            let before = line.clone();
            estimator().add_to(&mut line);
            let wide: Vec<usize> =
                (0..2000).filter(|&at| line.sigma_px[at] > 3.0 * before.sigma_px[at]).collect();
            let right: Vec<_> = wide.iter().filter(|at| structures.contains(at)).collect();
            assert!(right.len() >= least_wide, "{every}: {} of {}", right.len(), structures.len());
            assert!(wide.len() - right.len() <= most_others, "{every}: {wide:?}");
            for &&at in &right {
                assert!(3.0 * line.sigma_px[at] > deviation_px, "{every}: {at}");
            }
        }
    }

    #[test]
    fn a_deviation_is_the_smallest_of_three() {
        // A parabola, and a step: every place has a side that continues it.
        let smooth = |at: usize| {
            let along = at as f32;
            0.25 * along + 0.125 * along * along + if at >= 13 { 5.0 } else { 0.0 }
        };
        let along: Vec<f32> = (0..27).map(|at| at as f32).collect();
        let mut across: Vec<f32> = (0..27).map(smooth).collect();
        let deviations = |across: &[f32]| -> Vec<f32> {
            (0..across.len()).map(|at| deviation_px(&along, across, at, 2)).collect()
        };
        assert_eq!(deviations(&across), [0.0; 27]);
        across[6] += 1.0;
        across[26] -= 2.0;
        let found = deviations(&across);
        assert_eq!((found[6], found[26]), (1.0, 2.0));
        // Beyond the ends and a gap are no neighbours.
        let gap = [0.0, 1.0, 2.0, 9.0, 10.0, 11.0, 12.0, 13.0];
        let across = [0.0, 0.0, 3.0, 7.0, 7.0, 7.0, 7.0, 7.0];
        assert!(deviation_px(&gap, &across, 2, 1).abs() < f32::EPSILON);
    }

    #[test]
    fn noise_as_stated_or_less_and_short_stripes_change_nothing() {
        for (scatter, num) in [(0.02, 2000), (0.005, 2000), (0.4, 20), (0.4, 0)] {
            let before = line(scatter, 0.02, num);
            let mut after = before.clone();
            assert!(estimator().add_to(&mut after) <= 0.0);
            assert_eq!(before, after);
        }
    }
}
