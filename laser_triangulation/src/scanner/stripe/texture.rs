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
/// A point this many of its standard deviations from where its neighbours put it is an outlier.
const OUTLIER_SIGMAS: f32 = 2.0;
/// Share of outliers from which errors have long tails. Of normal errors 1 % are outliers, and a few narrow structures of
/// the surface must keep their sigma.
const LONG_TAILS: f64 = 0.05;
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

    /// Widens the sigma of points that lie far from where their neighbours put them, if so many do that the errors have
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
        let is_outlier = |deviation: f32, sigma: f32| deviation > OUTLIER_SIGMAS * sigma;
        let pairs = deviations.iter().zip(&*sigmas);
        let num = pairs.filter(|(deviation, sigma)| is_outlier(**deviation, **sigma)).count();
        if (num as f64) < LONG_TAILS * sigmas.len() as f64 {
            return;
        }
        for (sigma, &deviation) in sigmas.iter_mut().zip(&*deviations) {
            if is_outlier(deviation, *sigma) {
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

/// Adds the deviation of each centre of a run without gaps from where its neighbours at a distance put it: those before
/// it, those behind it or those on both sides, whichever is closest. 0 without neighbours.
fn push_deviations(across_px: &[f32], distance: usize, deviations: &mut Vec<f32>) {
    let one_sided = |here: f32, near: f32, far: f32| (here - 2.0 * near + far).abs();
    let two_sided = |here: f32, before: f32, behind: f32| (here - 0.5 * (before + behind)).abs();
    // Near the ends of the run some neighbours are missing.
    let at_end = |at: usize| {
        let px = |at: Option<usize>| at.and_then(|at| across_px.get(at)).copied();
        let (here, before, behind) = (across_px[at], px(at.checked_sub(distance)), px(Some(at + distance)));
        let before_it = before.zip(px(at.checked_sub(2 * distance)));
        let behind_it = behind.zip(px(Some(at + 2 * distance)));
        let deviations = [
            before_it.map(|(near, far)| one_sided(here, near, far)),
            behind_it.map(|(near, far)| one_sided(here, near, far)),
            before.zip(behind).map(|(before, behind)| two_sided(here, before, behind)),
        ];
        deviations.into_iter().flatten().reduce(f32::min).unwrap_or(0.0)
    };
    let num = across_px.len();
    let num_inner = num.saturating_sub(4 * distance);
    let first_inner = if num_inner > 0 { 2 * distance } else { num };
    deviations.extend((0..first_inner).map(at_end));
    let inner: [&[f32]; 5] = std::array::from_fn(|i| &across_px[(i * distance).min(num - num_inner)..][..num_inner]);
    for i in 0..num_inner {
        let [far_before, before, here, behind, far_behind] = inner.map(|px| px[i]);
        let nearest = one_sided(here, before, far_before).min(one_sided(here, behind, far_behind));
        deviations.push(nearest.min(two_sided(here, before, behind)));
    }
    deviations.extend((first_inner + num_inner..num).map(at_end));
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
    fn noise_as_stated_or_less_and_short_stripes_change_nothing() {
        for (scatter, num) in [(0.02, 2000), (0.005, 2000), (0.4, 20), (0.4, 0)] {
            let before = line(scatter, 0.02, num);
            let mut after = before.clone();
            assert!(estimator().add_to(&mut after) <= 0.0);
            assert_eq!(before, after);
        }
    }
}
