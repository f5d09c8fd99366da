//! Speckle and surface texture move the centres of a stripe from line to line, which the noise of the pixels does not
//! explain. Their share is estimated per frame from the scatter of the centres along the stripe.
//!
//! Fourth differences p₁ - 4p₂ + 6p₃ - 4p₄ + p₅ at a distance at which centres share neither pixel nor speckle have 70
//! times a centre's variance; a smooth surface hardly contributes to them. Second differences of neighbours show errors
//! that are correlated over less than that distance. Both are divided by their stated standard deviation; the median
//! magnitude of the quotients, 0.6745 for normal errors of the stated size, is robust against steps, gaps and outliers.
//!
//! Structures of the surface that are as fine as the distance count as texture, too.

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

    /// Returns the standard deviation of the centres from texture, pixels, and adds it to every sigma. Returns 0 if the
    /// stated noise explains the scatter, or if the stripe is too short.
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
        let deviations = &mut self.quotients;
        deviations.clear();
        #[expect(clippy::float_cmp, reason = "numbers of lines are integers")]
        for run in along.chunk_by(|here, next| next - here == 1.0) {
            let from = deviations.len();
            push_deviations(&across[from..from + run.len()], self.distance, deviations);
        }
        let sigmas = &mut centerline.sigma_px;
        let pairs = deviations.iter().zip(&*sigmas);
        let num = pairs.filter(|(deviation, sigma)| **deviation > FAR_SIGMAS * **sigma).count();
        if sigmas.len() < LEAST || (num as f64) < LONG_TAILS * sigmas.len() as f64 {
            return;
        }
        for (sigma, &deviation) in sigmas.iter_mut().zip(&*deviations) {
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

/// Adds the deviation of each centre of a run without gaps from the curve through its neighbours at a distance: a parabola
/// through three before it or three behind it, or a cubic through two on either side, whichever is closest. 0 without
/// neighbours.
fn push_deviations(across_px: &[f32], distance: usize, deviations: &mut Vec<f32>) {
    let one_sided =
        |[here, near, middle, far]: [f32; 4]| (here - 3.0 * (near - middle) - far).abs();
    let two_sided = |[far_before, before, here, behind, far_behind]: [f32; 5]| {
        (here - (4.0 * (before + behind) - (far_before + far_behind)) / 6.0).abs()
    };
    let num = across_px.len();
    let num_inner = num.saturating_sub(6 * distance);
    let first_inner = if num_inner > 0 { 3 * distance } else { num };
    // Near the ends of the run some neighbours are missing.
    let at_end = |at: usize| {
        let px = |steps: isize| {
            let at = at.checked_add_signed(steps * distance as isize)?;
            across_px.get(at).copied()
        };
        let before = all([px(0), px(-1), px(-2), px(-3)]).map(one_sided);
        let behind = all([px(0), px(1), px(2), px(3)]).map(one_sided);
        let between = all([px(-2), px(-1), px(0), px(1), px(2)]).map(two_sided);
        [before, behind, between].into_iter().flatten().reduce(f32::min).unwrap_or(0.0)
    };
    deviations.extend((0..first_inner).map(at_end));
    let inner: [&[f32]; 7] =
        std::array::from_fn(|i| &across_px[(i * distance).min(num - num_inner)..][..num_inner]);
    for i in 0..num_inner {
        let [c, b, a, here, d, e, f] = inner.map(|px| px[i]);
        let one_sided = one_sided([here, a, b, c]).min(one_sided([here, d, e, f]));
        deviations.push(one_sided.min(two_sided([b, a, here, d, e])));
    }
    deviations.extend((first_inner + num_inner..num).map(at_end));
}

/// Returns the numbers if none is missing.
fn all<const N: usize>(numbers: [Option<f32>; N]) -> Option<[f32; N]> {
    numbers.iter().all(Option::is_some).then(|| numbers.map(Option::unwrap_or_default))
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
        let mut deviations = Vec::new();
        // A parabola, and a step: every place has a side that continues it.
        let smooth = |at: usize| {
            let along = at as f32;
            0.25 * along + 0.125 * along * along + if at >= 13 { 5.0 } else { 0.0 }
        };
        let mut run: Vec<f32> = (0..27).map(smooth).collect();
        push_deviations(&run, 2, &mut deviations);
        assert_eq!(deviations, [0.0; 27]);
        run[6] += 1.0;
        run[26] -= 2.0;
        deviations.clear();
        push_deviations(&run, 2, &mut deviations);
        assert_eq!((deviations.len(), deviations[6], deviations[26]), (27, 1.0, 2.0));
        deviations.clear();
        push_deviations(&[1.0, 9.0], 2, &mut deviations);
        push_deviations(&[], 2, &mut deviations);
        assert_eq!(deviations, [0.0; 2]);
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
