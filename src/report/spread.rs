//! Distribution of differences in bounded memory: exact sums, quantiles to the width of a bin.

use serde::Serialize;

/// Bins on each side of zero; the last one counts everything beyond.
const HALF: usize = 1 << 15;
/// From the median of absolute deviations to a standard deviation, for normal errors.
const NORMAL: f64 = 1.4826;

/// A histogram of differences.
#[derive(Clone, Debug)]
pub(crate) struct Spread {
    bin: f64,
    counts: Vec<u64>,
    num: u64,
    sum: f64,
    squares: f64,
    largest: f64,
}

/// Figures of a [`Spread`], in its unit; NaN without differences.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Figures {
    /// Number of differences.
    pub(crate) num: u64,
    /// Mean.
    pub(crate) bias: f64,
    /// Median.
    pub(crate) median: f64,
    /// Root mean square.
    pub(crate) rms: f64,
    /// Robust standard deviation: 1.4826 times the median absolute deviation.
    pub(crate) robust: f64,
    /// 95 % quantile of the magnitudes.
    pub(crate) p95: f64,
    /// Largest magnitude.
    pub(crate) largest: f64,
}

impl Spread {
    /// Creates an empty histogram. Quantiles are multiples of `bin`, up to 32,768 of them on each side.
    #[must_use]
    pub(crate) fn new(bin: f64) -> Self {
        Self { bin, counts: vec![0; 2 * HALF + 1], num: 0, sum: 0.0, squares: 0.0, largest: 0.0 }
    }

    /// Adds a difference; ignores NaN.
    pub(crate) fn add(&mut self, difference: f64) {
        if !difference.is_finite() {
            return;
        }
        let half = HALF as f64;
        let at = (difference / self.bin).round().clamp(-half, half) + half;
        self.counts[at as usize] += 1;
        self.num += 1;
        self.sum += difference;
        self.squares += difference * difference;
        self.largest = self.largest.max(difference.abs());
    }

    /// Returns the figures.
    #[must_use]
    pub(crate) fn figures(&self) -> Figures {
        let num = self.num as f64;
        if self.num == 0 {
            let no = f64::NAN;
            return Figures {
                num: 0,
                bias: no,
                median: no,
                rms: no,
                robust: no,
                p95: no,
                largest: no,
            };
        }
        let middle = self.median_bin();
        let bins = |bins: usize| bins as f64 * self.bin;
        Figures {
            num: self.num,
            bias: self.sum / num,
            median: (middle as f64 - HALF as f64) * self.bin,
            rms: (self.squares / num).sqrt(),
            robust: NORMAL * bins(self.reach(middle, 0.5)),
            // Beyond the last bin only the largest magnitude is known.
            p95: match self.reach(HALF, 0.95) {
                HALF => self.largest,
                reach => bins(reach),
            },
            largest: self.largest,
        }
    }

    fn median_bin(&self) -> usize {
        let mut below = 0;
        let half = self.num.div_ceil(2);
        let mut bins = self.counts.iter().enumerate();
        let found = bins.find(|(_, count)| {
            below += **count;
            below >= half
        });
        found.map_or(HALF, |(at, _)| at)
    }

    /// Returns the number of bins to both sides of one that hold a share of all differences.
    fn reach(&self, middle: usize, share: f64) -> usize {
        let wanted = (share * self.num as f64).ceil() as u64;
        let at = |at: Option<usize>| at.and_then(|at| self.counts.get(at)).copied().unwrap_or(0);
        let mut held = self.counts[middle];
        let mut reach = 0;
        while held < wanted && reach < self.counts.len() {
            reach += 1;
            held += at(middle.checked_sub(reach)) + at(middle.checked_add(reach));
        }
        reach
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(value: f64, expected: f64) {
        assert!((value - expected).abs() < 0.011, "{value}, {expected}");
    }

    #[test]
    fn figures_are_those_of_the_sorted_differences() {
        let mut spread = Spread::new(0.01);
        // 99 differences of -1 to 1, and one outlier.
        for at in 0..99 {
            spread.add(-1.0 + 2.0 * f64::from(at) / 98.0);
        }
        spread.add(50.0);
        spread.add(f64::NAN);
        let figures = spread.figures();
        assert_eq!(figures.num, 100);
        near(figures.bias, 0.5);
        near(figures.median, 0.0);
        near(figures.robust, NORMAL * 0.51);
        near(figures.p95, 0.96);
        near(figures.largest, 50.0);
        assert!(figures.rms > 5.0);
    }

    #[test]
    fn equal_results_differ_by_zero_and_no_results_by_nan() {
        let mut spread = Spread::new(0.01);
        assert!(spread.figures().bias.is_nan() && spread.figures().p95.is_nan());
        for _ in 0..10 {
            spread.add(0.0);
        }
        let figures = spread.figures();
        let all = [figures.bias, figures.median, figures.rms, figures.robust, figures.p95];
        assert!(all.iter().all(|figure| *figure == 0.0), "{figures:?}");
    }

    #[test]
    fn differences_beyond_every_bin_are_counted() {
        let mut spread = Spread::new(1e-6);
        for _ in 0..3 {
            spread.add(7.0);
        }
        near(spread.figures().p95, 7.0);
        near(spread.figures().bias, 7.0);
    }
}
