//! Figures of an unbounded stream in bounded memory.

/// Maximum number of entries.
pub(crate) const MAX_BINS: usize = 2048;

/// Rule that merges figures of neighbouring frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Merge {
    /// Mean.
    Mean,
    /// Maximum.
    Max,
    /// Sum.
    Sum,
}

/// `N` figures per frame, merged over 2, 4, 8, … frames as the stream grows.
#[derive(Clone, Debug)]
pub(crate) struct Series<const N: usize> {
    merges: [Merge; N],
    per_bin: usize,
    bins: Vec<[f64; N]>,
    /// Frames of the entry that is not complete yet.
    open: Vec<[f64; N]>,
}

impl<const N: usize> Series<N> {
    /// Creates an empty series.
    #[must_use]
    pub(crate) const fn new(merges: [Merge; N]) -> Self {
        Self { merges, per_bin: 1, bins: Vec::new(), open: Vec::new() }
    }

    /// Adds the figures of the next frame; NaN if missing.
    pub(crate) fn push(&mut self, figures: [f64; N]) {
        if self.bins.len() == MAX_BINS {
            self.bins = self.bins.chunks(2).map(|pair| self.merged(pair)).collect();
            self.per_bin *= 2;
        }
        self.open.push(figures);
        if self.open.len() >= self.per_bin {
            self.bins.push(self.merged(&self.open));
            self.open.clear();
        }
    }

    /// Frames per entry.
    #[cfg(test)]
    pub(crate) const fn per_bin(&self) -> usize {
        self.per_bin
    }

    /// First frame of every entry, from 0.
    #[must_use]
    pub(crate) fn frames(&self) -> Vec<f64> {
        (0..self.len()).map(|bin| (bin * self.per_bin) as f64).collect()
    }

    /// One figure for every entry.
    #[must_use]
    pub(crate) fn figure(&self, at: usize) -> Vec<f64> {
        let last = (!self.open.is_empty()).then(|| self.merged(&self.open));
        self.bins.iter().copied().chain(last).map(|bin| bin[at]).collect()
    }

    fn len(&self) -> usize {
        self.bins.len() + usize::from(!self.open.is_empty())
    }

    fn merged(&self, bins: &[[f64; N]]) -> [f64; N] {
        std::array::from_fn(|at| {
            let known = || bins.iter().map(|bin| bin[at]).filter(|figure| !figure.is_nan());
            let num = known().count();
            match self.merges[at] {
                _ if num == 0 => f64::NAN,
                Merge::Mean => known().sum::<f64>() / num as f64,
                Merge::Max => known().fold(f64::NEG_INFINITY, f64::max),
                Merge::Sum => known().sum(),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_stream_stays_short_and_keeps_its_sums_and_peaks() {
        let mut series = Series::new([Merge::Mean, Merge::Max, Merge::Sum]);
        let num = 5 * MAX_BINS + 3;
        for frame in 0..num {
            let peak = if frame == 777 { 9.0 } else { 1.0 };
            series.push([2.0, peak, 1.0]);
        }
        let frames = series.frames();
        assert!(frames.len() <= MAX_BINS + 1 && frames.len() > MAX_BINS / 2, "{}", frames.len());
        assert!((series.figure(2).iter().sum::<f64>() - num as f64).abs() < 1e-9);
        assert!(series.figure(0).iter().all(|mean| (mean - 2.0).abs() < 1e-12));
        let peaks = series.figure(1);
        let at = peaks.iter().position(|peak| *peak > 8.0).unwrap();
        let first = frames[at] as usize;
        assert!((first..first + series.per_bin()).contains(&777));
    }

    #[test]
    fn nan_does_not_affect_other_figures() {
        let mut series = Series::new([Merge::Mean]);
        for frame in 0..=MAX_BINS {
            series.push([if frame % 2 == 0 { 4.0 } else { f64::NAN }]);
        }
        assert!(series.figure(0).iter().all(|mean| (mean - 4.0).abs() < 1e-12));
    }
}
