//! Candidates too long for the cross-section of a stripe: a lamp, a white wall, a threshold below the background.

use super::section::LineCandidate;
use std::ops::Range;

/// Measurements of such a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Broad {
    /// Grey-level centre of gravity, pixels from the candidate's first sample.
    pub(crate) position_px: f64,
    /// Unblurred level there, sample units.
    pub(crate) intensity: f32,
    /// Largest unblurred sample, sample units.
    pub(crate) brightest_raw: u32,
}

impl Broad {
    /// Computes the measurements from `level`, Σ G, and `moment`, Σ i·G. `raw_at` returns the unblurred sample at a position, or the last
    /// one beyond the candidate.
    pub(super) fn from_sums(
        level: u64,
        moment: u64,
        brightest_raw: u32,
        raw_at: impl Fn(usize) -> u32,
    ) -> Self {
        let position_px = moment as f64 / level as f64;
        let left = position_px as usize;
        let [at, next] = [left, left + 1].map(|place| f64::from(raw_at(place)));
        let intensity = (at + (next - at) * (position_px - left as f64)) as f32;
        Self { position_px, intensity, brightest_raw }
    }
}

/// Sums over several such candidates, side by side. They are integers, so the order of addition does not matter.
#[derive(Debug, Default)]
pub(super) struct BroadRuns {
    first: Vec<u32>,
    last: Vec<u32>,
    level: Vec<u64>,
    moment: Vec<u64>,
    brightest: Vec<u32>,
}

impl BroadRuns {
    /// Starts with these candidates.
    pub(super) fn clear(&mut self, batch: &[LineCandidate]) {
        self.first.clear();
        self.first.extend(batch.iter().map(|found| found.candidate.first));
        self.last.clear();
        self.last.extend(batch.iter().map(|found| found.candidate.last));
        for sums in [&mut self.level, &mut self.moment] {
            sums.clear();
            sums.resize(batch.len(), 0);
        }
        self.brightest.clear();
        self.brightest.resize(batch.len(), 0);
    }

    /// Returns the range of positions that any candidate covers.
    pub(super) fn positions(&self) -> Range<u32> {
        let first = self.first.iter().copied().min().unwrap_or(0);
        first..self.last.iter().copied().max().map_or(first, |last| last + 1)
    }

    /// Adds one sample to every candidate that covers `position`: raw and blurred samples, in the candidates' order.
    #[inline(always)]
    pub(super) fn add_across<R: Copy + Into<u32>, S: Copy + Into<u32>>(
        &mut self,
        position: u32,
        raw: &[R],
        samples: &[S],
    ) {
        let runs = self.first.iter().zip(&self.last).zip(raw.iter().zip(samples));
        let sums = self.level.iter_mut().zip(&mut self.moment).zip(&mut self.brightest);
        for (((&first, &last), (&raw, &sample)), ((level, moment), brightest)) in runs.zip(sums) {
            let is_inside = (first <= position) & (position <= last);
            let (raw, sample): (u32, u32) = (raw.into(), sample.into());
            let (raw, sample) = if is_inside { (raw, sample) } else { (0, 0) };
            *level += u64::from(sample);
            *moment += u64::from(position.wrapping_sub(first)) * u64::from(sample);
            *brightest = (*brightest).max(raw);
        }
    }

    /// Adds all samples of candidate i, given its whole line.
    #[inline(always)]
    pub(super) fn add_along<R: Copy + Into<u32>, S: Copy + Into<u32>>(
        &mut self,
        i: usize,
        raw: &[R],
        samples: &[S],
    ) {
        let run = self.first[i] as usize..self.last[i] as usize + 1;
        let (mut level, mut moment, mut brightest) = (0, 0, 0);
        for (place, (&raw, &sample)) in (0_u32..).zip(raw[run.clone()].iter().zip(&samples[run])) {
            let (raw, sample): (u32, u32) = (raw.into(), sample.into());
            level += u64::from(sample);
            moment += u64::from(place) * u64::from(sample);
            brightest = raw.max(brightest);
        }
        (self.level[i], self.moment[i], self.brightest[i]) = (level, moment, brightest);
    }

    /// Returns the measurements of candidate i. `raw_at` returns the unblurred sample at a position in it, or its last
    /// one beyond it.
    pub(super) fn broad(&self, i: usize, raw_at: impl Fn(usize) -> u32) -> Broad {
        Broad::from_sums(self.level[i], self.moment[i], self.brightest[i], raw_at)
    }
}
