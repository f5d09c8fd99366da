//! Differences of points along the stripe, and how much more they scatter than the stated standard deviations say.

use std::ops::Range;

use crate::{
    scanner::{
        params::StripeDirection,
        stripe::{Centerline, correlation::Correlation},
    },
    statistics::{NORMAL_MEDIAN_MAGNITUDE, median},
};

/// Scatter above the stated one by up to this share plus this many standard errors is chance.
const CHANCE: (f64, f64) = (0.05, 3.0);
/// Standard error of the median magnitude of n normal numbers, times √n, as a share of it: 1 / (4 φ(0.6745) 0.6745).
const MEDIAN_ERROR: f64 = 1.17;

/// Consecutive points of a centreline.
#[derive(Clone, Copy, Debug)]
pub(super) struct Points<'a> {
    /// Lines, pixels.
    along: &'a [f32],
    /// Positions across the stripe, pixels.
    across: &'a [f32],
    sigma_px: &'a [f32],
}

impl<'a> Points<'a> {
    pub(super) fn of(centerline: &'a Centerline, direction: StripeDirection) -> Self {
        let (along, across) = centerline.along_and_across(direction);
        Self { along, across, sigma_px: &centerline.sigma_px }
    }

    #[must_use]
    pub(super) fn part(self, range: Range<usize>) -> Self {
        Self {
            along: &self.along[range.clone()],
            across: &self.across[range.clone()],
            sigma_px: &self.sigma_px[range],
        }
    }
}

/// A weighted sum of points at a distance along the stripe that vanishes on a smooth curve.
#[derive(Clone, Copy, Debug)]
pub(super) struct Difference<const N: usize> {
    weights: [f32; N],
    /// Lines from one weight to the next.
    distance: usize,
    /// Variance of the difference in variances of a centre, with the correlation that the method causes.
    gain: f64,
}

impl<const N: usize> Difference<N> {
    pub(super) fn new(weights: [f32; N], distance: usize, correlation: &Correlation) -> Self {
        let mut sparse = vec![0.0; (N - 1) * distance + 1];
        for (at, &weight) in weights.iter().enumerate() {
            sparse[at * distance] = weight.into();
        }
        Self { weights, distance, gain: correlation.variance(&sparse) }
    }

    /// Returns its variance as a share of that of independent centres.
    pub(super) fn share_of_independent(&self) -> f64 {
        self.gain / self.weights.iter().map(|&weight| f64::from(weight).powi(2)).sum::<f64>()
    }

    /// Lines from one weight to the next.
    pub(super) const fn distance(&self) -> usize {
        self.distance
    }

    /// Returns the scatter of up to about `most` differences. `quotients` is a buffer.
    pub(super) fn scatter(
        &self,
        points: &Points<'_>,
        most: usize,
        quotients: &mut Vec<f32>,
    ) -> Scatter {
        let Points { along, across, sigma_px } = points;
        let reach = (N - 1) * self.distance;
        let step = along.len() / most + 1;
        let mean_gain = self.gain as f32 / N as f32;
        quotients.clear();
        for from in (0..along.len().saturating_sub(reach)).step_by(step) {
            // Lines without a gap, of one stripe.
            if !is_apart(along[from], along[from + reach], reach) {
                continue;
            }
            let (mut difference, mut variance) = (0.0, 0.0);
            for (i, weight) in self.weights.iter().enumerate() {
                let at = from + i * self.distance;
                difference += weight * across[at];
                variance += sigma_px[at] * sigma_px[at];
            }
            quotients.push(difference * difference / (variance * mean_gain));
        }
        let num = quotients.len();
        // The square of the median magnitude.
        let median = f64::from(median(quotients).unwrap_or(0.0));
        Scatter { ratio: median.sqrt() / NORMAL_MEDIAN_MAGNITUDE, num }
    }
}

/// Returns true if two points lie that many lines apart.
#[expect(clippy::float_cmp, reason = "numbers of lines are integers")]
pub(super) fn is_apart(first: f32, second: f32, distance: usize) -> bool {
    second - first == distance as f32
}

/// Scatter of differences over the stated one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scatter {
    ratio: f64,
    /// Number of differences.
    pub(super) num: usize,
}

impl Scatter {
    /// Returns the variance beyond the stated one, in stated variances.
    pub(super) const fn excess(&self) -> f64 {
        self.ratio * self.ratio - 1.0
    }

    /// Returns the same, but 0 if chance explains it.
    pub(super) fn significant_excess(&self) -> f64 {
        let chance = CHANCE.0 + CHANCE.1 * MEDIAN_ERROR / (self.num as f64).sqrt();
        if self.ratio > 1.0 + chance { self.excess() } else { 0.0 }
    }
}
