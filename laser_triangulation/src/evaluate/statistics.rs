//! Error statistics.

use serde::Serialize;

/// Error beyond which a point counts as wrong, pixels.
pub const WRONG_PX: f64 = 2.0;

/// Resolution of median and percentile, pixels.
pub const BIN_PX: f64 = 0.0005;

/// Distance beyond which columns are assumed to share no noise, columns.
const MAX_LAG: usize = 64;

/// A measured point and its ground truth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// Measured − true position across the stripe, pixels.
    pub(crate) error_px: f64,
    /// The standard deviation that the method reports, pixels; NaN if it reports none.
    pub(crate) sigma_px: f64,
}

/// Accuracy of a method over many columns. Shares are 0 … 1, NaN if there was nothing to count.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Accuracy {
    /// Columns (rows, for a vertical stripe) with a true centre.
    pub columns: u64,
    /// Number of points found.
    pub points: u64,
    /// Number of points in columns without a true centre (false positives).
    pub false_points: u64,
    /// Share of the columns without a point.
    pub missing: f64,
    /// Share of the points with an error above [`WRONG_PX`].
    pub wrong: f64,
    /// Mean error, pixels.
    pub bias_px: f64,
    /// Root mean square error over all points, wrong ones included, pixels.
    pub rms_px: f64,
    /// Median of the absolute error, pixels, to ±[`BIN_PX`] / 2; infinite beyond [`WRONG_PX`].
    pub median_px: f64,
    /// 95th percentile of the absolute error, pixels, with the same resolution and limit.
    pub p95_px: f64,
    /// Share of the points within one reported standard deviation of the truth; 0.683 if the reported values are right.
    pub within_1_sigma: f64,
    /// Share of the points within two reported standard deviations of the truth; 0.954 if the reported values are
    /// right.
    pub within_2_sigma: f64,
}

/// Running sums over points.
#[derive(Clone, Debug)]
pub struct Tally {
    columns: u64,
    points: u64,
    false_points: u64,
    wrong: u64,
    sum_px: f64,
    sum_squares_px2: f64,
    with_sigma: u64,
    within_1: u64,
    within_2: u64,
    /// Histogram of the absolute error in bins of [`BIN_PX`] up to [`WRONG_PX`].
    sizes: Vec<u64>,
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            columns: 0,
            points: 0,
            false_points: 0,
            wrong: 0,
            sum_px: 0.0,
            sum_squares_px2: 0.0,
            with_sigma: 0,
            within_1: 0,
            within_2: 0,
            sizes: vec![0; (WRONG_PX / BIN_PX) as usize],
        }
    }
}

impl Tally {
    /// Adds the result in a column that has a true centre.
    pub fn add(&mut self, found: Option<Deviation>) {
        self.columns += 1;
        let Some(Deviation { error_px, sigma_px }) = found else { return };
        self.points += 1;
        self.sum_px += error_px;
        self.sum_squares_px2 += error_px * error_px;
        if let Some(bin) = self.sizes.get_mut((error_px.abs() / BIN_PX) as usize) {
            *bin += 1;
        }
        self.wrong += u64::from(error_px.abs() > WRONG_PX);
        if sigma_px.is_finite() {
            self.with_sigma += 1;
            self.within_1 += u64::from(error_px.abs() <= sigma_px);
            self.within_2 += u64::from(error_px.abs() <= 2.0 * sigma_px);
        }
    }

    /// Adds a point in a column without a true centre.
    pub const fn add_false_point(&mut self) {
        self.false_points += 1;
    }

    /// Returns the given quantile of the absolute error: the middle of its bin.
    fn size_below(&self, share: f64) -> f64 {
        if self.points == 0 {
            return f64::NAN;
        }
        let wanted = share * self.points as f64;
        let mut below = 0;
        let reached = self.sizes.iter().position(|count| {
            below += count;
            below as f64 >= wanted
        });
        reached.map_or(f64::INFINITY, |bin| (bin as f64 + 0.5) * BIN_PX)
    }

    /// Returns the statistics.
    pub fn accuracy(&self) -> Accuracy {
        let share = |part: u64, of: u64| part as f64 / of as f64;
        let points = self.points as f64;
        Accuracy {
            columns: self.columns,
            points: self.points,
            false_points: self.false_points,
            missing: share(self.columns - self.points, self.columns),
            wrong: share(self.wrong, self.points),
            bias_px: self.sum_px / points,
            rms_px: (self.sum_squares_px2 / points).sqrt(),
            median_px: self.size_below(0.5),
            p95_px: self.size_below(0.95),
            within_1_sigma: share(self.within_1, self.with_sigma),
            within_2_sigma: share(self.within_2, self.with_sigma),
        }
    }
}

/// Returns the number of columns that a method averages along the stripe, 1 if it treats each column alone.
///
/// White noise weighted with wᵢ along the stripe has the correlation Σ wᵢ wᵢ₊ₖ, so 1 + 2 Σ ρₖ = (Σ w)² / Σ w²: the
/// length of a uniform mean with the same noise. ρₖ is estimated from `noise`: rows of errors of neighbouring columns
/// without their systematic part, NaN if missing. The sum ends where the correlation is no longer significant. NaN
/// without noise.
pub(crate) fn columns_averaged(noise: &[Vec<f64>]) -> f64 {
    let (variance, _) = mean_product(noise, 0);
    if variance.is_nan() || variance <= 0.0 {
        return f64::NAN;
    }
    let mut sum = 1.0;
    for lag in 1..=MAX_LAG {
        let (product, count) = mean_product(noise, lag);
        let correlation = product / variance;
        // Three standard errors of a correlation of zero.
        if correlation.is_nan() || correlation.abs() < 3.0 / (count as f64).sqrt() {
            break;
        }
        sum += 2.0 * correlation;
    }
    sum
}

/// Returns the mean product of entries `lag` apart, and the number of such pairs.
fn mean_product(rows: &[Vec<f64>], lag: usize) -> (f64, usize) {
    let pairs = rows.iter().flat_map(|row| row.iter().zip(row.iter().skip(lag)));
    let products = pairs.map(|(a, b)| a * b).filter(|product| product.is_finite());
    let (sum, count) = products.fold((0.0, 0), |(sum, count), product| (sum + product, count + 1));
    (sum / count as f64, count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::noise::frame_rng;
    use rand_distr::{Distribution, StandardNormal};

    fn tally(found: &[Option<(f64, f64)>]) -> Accuracy {
        let mut tally = Tally::default();
        for found in found {
            tally.add(found.map(|(error_px, sigma_px)| Deviation { error_px, sigma_px }));
        }
        tally.add_false_point();
        tally.accuracy()
    }

    #[test]
    fn a_few_errors_by_hand() {
        let found = [
            Some((0.3, 0.2)),
            Some((-0.1, 0.2)),
            None,
            Some((0.2, f64::NAN)),
            Some((3.0, 1.0)),
            Some((0.0, 0.1)),
        ];
        let accuracy = tally(&found);
        assert_eq!((accuracy.columns, accuracy.points, accuracy.false_points), (6, 5, 1));
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        close(accuracy.missing, 1.0 / 6.0);
        close(accuracy.wrong, 0.2);
        close(accuracy.bias_px, 0.68);
        close(accuracy.rms_px, (9.14_f64 / 5.0).sqrt());
        // Sorted sizes: 0, 0.1, 0.2, 0.3, 3; the third is the median, the last exceeds the range.
        assert!((accuracy.median_px - 0.2).abs() <= BIN_PX, "{accuracy:?}");
        assert!(accuracy.p95_px.is_infinite());
        // Of four points with a sigma, -0.1 and 0 lie within one sigma, 0.3 within two.
        close(accuracy.within_1_sigma, 0.5);
        close(accuracy.within_2_sigma, 0.75);
    }

    #[test]
    fn errors_are_nan_if_nothing_was_found() {
        let accuracy = tally(&[None, None]);
        assert!(accuracy.rms_px.is_nan() && accuracy.bias_px.is_nan() && accuracy.wrong.is_nan());
        assert!((accuracy.missing - 1.0).abs() < 1e-15);
    }

    /// Weighted white noise in two rows.
    fn noise(weights: &[f64]) -> Vec<Vec<f64>> {
        let row = |number| {
            let white: Vec<f64> =
                StandardNormal.sample_iter(frame_rng(5, number)).take(20_000).collect();
            let weighted =
                |window: &[f64]| window.iter().zip(weights).map(|(x, w)| x * w).sum::<f64>();
            white.windows(weights.len()).map(weighted).collect()
        };
        vec![row(0), row(1)]
    }

    #[test]
    fn averaged_columns_match_the_weights() {
        assert!((columns_averaged(&noise(&[1.0])) - 1.0).abs() < 1e-12);
        for weights in [&[1.0; 5] as &[f64], &[1.0, 4.0, 6.0, 4.0, 1.0]] {
            let sum: f64 = weights.iter().sum();
            let squares: f64 = weights.iter().map(|w| w * w).sum();
            let (found, expected) = (columns_averaged(&noise(weights)), sum * sum / squares);
            assert!((found / expected - 1.0).abs() < 0.05, "{found} {expected}");
        }
        assert!(columns_averaged(&[vec![0.0; 100]]).is_nan());
        assert!(columns_averaged(&[]).is_nan());
        let mut holes = noise(&[1.0; 5]);
        holes[0].iter_mut().step_by(7).for_each(|gap| *gap = f64::NAN);
        assert!((columns_averaged(&holes) / 5.0 - 1.0).abs() < 0.05);
    }
}
