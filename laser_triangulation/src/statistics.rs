//! Order statistics and the robust standard deviation.
//!
//! Every value returned is one of the samples, never an average of two, so that a result has the same bits on every
//! machine. The only exception is `central_median`.
//!
//! Floating-point samples are in the order of `total_cmp`: a positive NaN counts as the largest sample. Remove samples
//! that are not finite first where they may occur.

use std::cmp::Ordering;

/// Standard deviation of normally distributed samples, divided by their median absolute deviation.
pub(crate) const MAD_TO_SIGMA: f64 = 1.4826;

/// Median magnitude of a normal variable with standard deviation 1: the reciprocal of [`MAD_TO_SIGMA`], to more digits.
pub(crate) const NORMAL_MEDIAN_MAGNITUDE: f64 = 0.674_489_75;

/// A number with a total order.
pub trait Sample: Copy {
    /// Compares two samples.
    fn order(&self, other: &Self) -> Ordering;
}

macro_rules! sample {
    ($compare:ident: $($number:ty),+) => {
        $(impl Sample for $number {
            fn order(&self, other: &Self) -> Ordering {
                self.$compare(other)
            }
        })+
    };
}

sample!(total_cmp: f32, f64);
sample!(cmp: u32, i64);

/// A robust location and spread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RobustSpread {
    /// Median of the samples, in their unit.
    pub(crate) median: f64,
    /// Standard deviation by the median absolute deviation from the median, in the unit of the samples.
    pub(crate) sigma: f64,
}

/// Returns the median, of an even number of samples the larger of the middle two. `None` without samples.
///
/// Reorders the samples; takes linear time.
pub fn median<T: Sample>(samples: &mut [T]) -> Option<T> {
    order_statistic(samples, samples.len() / 2)
}

/// Returns the sample that has `rank` samples before it in ascending order. `None` if there is no such sample.
///
/// Reorders the samples; takes linear time.
pub(crate) fn order_statistic<T: Sample>(samples: &mut [T], rank: usize) -> Option<T> {
    (rank < samples.len()).then(|| *samples.select_nth_unstable_by(rank, T::order).1)
}

/// Returns the median, of an even number of samples the mean of the middle two. NaN without samples.
///
/// Sorts the samples.
pub(crate) fn central_median(samples: &mut [f32]) -> f64 {
    samples.sort_unstable_by(f32::total_cmp);
    let above = samples.len() / 2;
    let below = samples.len().saturating_sub(1) / 2;
    match (samples.get(below), samples.get(above)) {
        (Some(&below), Some(&above)) => 0.5 * (f64::from(below) + f64::from(above)),
        _ => f64::NAN,
    }
}

/// Returns the sample of ascending samples that is nearest to a quantile, `share` 0 to 1. `None` without samples.
///
/// A share of 0.5 gives the same sample as [`median`].
#[must_use]
pub fn quantile<T: Sample>(ascending: &[T], share: f64) -> Option<T> {
    let last = ascending.len().checked_sub(1)?;
    ascending.get((share * last as f64).round() as usize).copied()
}

/// Returns the median and the robust standard deviation (Rousseeuw and Croux 1993, doi
/// 10.1080/01621459.1993.10476408). `None` without samples.
///
/// Replaces the samples by their distances from the median.
pub(crate) fn robust_spread(samples: &mut [f64]) -> Option<RobustSpread> {
    let median = median(samples)?;
    for sample in samples.iter_mut() {
        *sample = (*sample - median).abs();
    }
    Some(RobustSpread { median, sigma: sigma_about_zero(samples)? })
}

/// Returns the robust standard deviation about 0 of samples given by their magnitudes. `None` without samples.
///
/// Reorders the magnitudes.
pub(crate) fn sigma_about_zero(magnitudes: &mut [f64]) -> Option<f64> {
    median(magnitudes).map(|median| MAD_TO_SIGMA * median)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_even_number_of_samples_has_the_larger_middle_one_as_its_median() {
        assert_eq!(median(&mut [4_u32, 1, 3, 2]), Some(3));
        assert_eq!(median(&mut [5_i64, 1, 3]), Some(3));
        assert_eq!(median::<u32>(&mut []), None);
        assert_eq!(order_statistic(&mut [3_u32, 1, 2], 0), Some(1));
        assert_eq!(order_statistic(&mut [3_u32, 1, 2], 3), None);
    }

    #[test]
    fn nan_counts_as_the_largest_sample() {
        assert_eq!(median(&mut [f64::NAN, 1.0, 0.5]).map(f64::to_bits), Some(1.0_f64.to_bits()));
        assert!(median(&mut [f64::NAN, f64::NAN, 0.5]).is_some_and(f64::is_nan));
    }

    #[test]
    fn the_central_median_is_the_mean_of_the_middle_two() {
        let medians = [
            central_median(&mut [4.0, 1.0, 3.0, 2.0]),
            central_median(&mut [3.0, 1.0, 2.0]),
            central_median(&mut [7.0]),
        ];
        assert_eq!(medians.map(f64::to_bits), [2.5_f64, 2.0, 7.0].map(f64::to_bits));
        assert!(central_median(&mut []).is_nan());
    }

    #[test]
    fn quantiles_are_the_nearest_samples() {
        let ascending: Vec<u32> = (0..=20).collect();
        assert_eq!(
            [0.0, 0.5, 0.95, 1.0].map(|share| quantile(&ascending, share)),
            [Some(0), Some(10), Some(19), Some(20)]
        );
        assert_eq!(quantile(&[1_u32, 2, 3, 4], 0.5), median(&mut [1_u32, 2, 3, 4]));
        assert_eq!(quantile::<u32>(&[], 0.5), None);
    }

    #[test]
    fn an_outlier_does_not_move_the_robust_spread() {
        let spread = robust_spread(&mut [1.0, 2.0, 3.0, 4.0, 1e9]).unwrap();
        assert!((spread.median - 3.0).abs() < 1e-15);
        assert!((spread.sigma - MAD_TO_SIGMA).abs() < 1e-15);
        assert_eq!(robust_spread(&mut []), None);
        assert!((MAD_TO_SIGMA * NORMAL_MEDIAN_MAGNITUDE - 1.0).abs() < 1e-5);
    }
}
