//! Cross-sections side by side, one per lane, so that one instruction processes many of them.
//!
//! Every lane is computed by the same operations in the same order, whatever its neighbours hold. A lane's result
//! depends only on its own samples, not on where the batch's rows begin or on the width of the machine's registers.
//! Estimators therefore keep to two rules: rows outside a lane's window have no effect, and positions count from the
//! candidate's first sample.

use super::section::{Candidate, grey};
use std::ops::Range;

/// Cross-sections per batch: one 512-bit register of `f32`.
pub(super) const LANES: usize = 16;
/// Longest candidate passed to an estimator, samples. Longer ones are not a cross-section of a stripe.
pub(super) const MAX_ROWS: usize = 192;

/// One number per lane.
pub(super) type Lane = [f32; LANES];

/// Up to [`LANES`] cross-sections. Row i of a lane lies i positions across the stripe from its row 0.
#[derive(Clone, Debug)]
pub(super) struct Sections {
    /// Lanes in use, from lane 0; the others repeat the window of lane 0 over undefined samples.
    pub(crate) count: usize,
    /// Unblurred samples, sample units, row by row; as many rows as the longest reach of a window.
    pub(crate) raw: Vec<Lane>,
    /// Blurred samples without background, grey levels in sample units, row by row.
    pub(crate) blurred: Vec<Lane>,
    /// First row of each lane's window: the candidate and its margin.
    pub(crate) start: Lane,
    /// Row behind the last one of each lane's window.
    pub(crate) end: Lane,
    /// Row of the first sample of each lane's candidate.
    pub(crate) first: Lane,
    /// Row of the last sample of each lane's candidate.
    pub(crate) last: Lane,
    /// Largest blurred sample of each lane's candidate, as in [`blurred`](Self::blurred).
    pub(crate) peak: Lane,
    /// Rows in which any lane has a sample of its candidate.
    candidate_rows: Range<usize>,
}

/// An estimator's result for every lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Centres {
    /// Centre, pixels from the candidate's first sample.
    pub(crate) position_px: Lane,
    /// One standard deviation of it, pixels.
    pub(crate) sigma_px: Lane,
}

impl Default for Sections {
    fn default() -> Self {
        let none = [0.0; LANES];
        Self {
            count: 0,
            raw: Vec::new(),
            blurred: Vec::new(),
            start: none,
            end: none,
            first: none,
            last: none,
            peak: none,
            candidate_rows: 0..0,
        }
    }
}

/// Returns `f` evaluated for every lane.
#[inline(always)]
pub(super) fn each(f: impl Fn(usize) -> f32) -> Lane {
    let mut lanes = [0.0; LANES];
    for (lane, value) in lanes.iter_mut().enumerate() {
        *value = f(lane);
    }
    lanes
}

/// Appends the first `count` lanes.
#[inline(always)]
pub(super) fn append<T: Copy>(to: &mut Vec<T>, lanes: &[T; LANES], count: usize) {
    // A copy of constant length is much faster than one of `count`.
    to.extend_from_slice(lanes);
    to.truncate(to.len() - (LANES - count));
}

/// One lane of several numbers.
#[inline(always)]
pub(super) fn lane_of<const N: usize>(numbers: &[Lane; N], lane: usize) -> [f32; N] {
    let mut of_lane = [0.0; N];
    for (of_lane, number) in of_lane.iter_mut().zip(numbers) {
        *of_lane = number[lane];
    }
    of_lane
}

/// Returns the smallest of all lanes, but at least 0, which also stands for NaN.
#[inline(always)]
fn smallest(lanes: &Lane) -> f32 {
    let mut smallest = u32::MAX;
    for &number in lanes {
        smallest = smallest.min(rank(number));
    }
    f32::from_bits(smallest)
}

/// Returns the largest of all lanes, but at least 0, which also stands for NaN.
#[inline(always)]
fn largest(lanes: &Lane) -> f32 {
    let mut largest = 0;
    for &number in lanes {
        largest = largest.max(rank(number));
    }
    f32::from_bits(largest)
}

/// Returns the bits of a number, which order positive numbers as they are: vector units reduce integers faster. 0 for
/// NaN and negative numbers.
#[inline(always)]
const fn rank(number: f32) -> u32 {
    (if number > 0.0 { number } else { 0.0 }).to_bits()
}

impl Sections {
    /// Returns the number of rows held.
    pub(super) fn rows(&self) -> usize {
        self.raw.len()
    }

    /// Returns the position of row `i` in every lane, pixels from the candidate's first sample.
    #[inline(always)]
    pub(super) fn place(&self, i: usize) -> Lane {
        each(|lane| i as f32 - self.first[lane])
    }

    /// Returns the position of the candidate's last sample in every lane, pixels from its first.
    #[inline(always)]
    pub(super) fn last_place(&self) -> Lane {
        each(|lane| self.last[lane] - self.first[lane])
    }

    /// Returns the number of samples of every lane's candidate.
    #[inline(always)]
    pub(super) fn length(&self) -> Lane {
        each(|lane| self.last[lane] - self.first[lane] + 1.0)
    }

    /// Returns 1 for lanes in use, else 0.
    #[inline(always)]
    pub(super) fn in_use(&self) -> Lane {
        each(|lane| if lane < self.count { 1.0 } else { 0.0 })
    }

    /// Returns the rows in which any lane has a sample of its candidate.
    #[inline(always)]
    pub(super) fn candidate_rows(&self) -> Range<usize> {
        self.candidate_rows.clone()
    }

    /// Returns the rows that hold every position between `low` and `high` (fractional rows) of the lanes.
    #[inline(always)]
    pub(super) fn reach(&self, low: &Lane, high: &Lane) -> Range<usize> {
        let behind = each(|lane| high[lane] + 1.0);
        let end = (largest(&behind) as usize).min(self.rows());
        (smallest(low) as usize).min(end)..end
    }

    /// Returns the rows that lie between `low` and `high` (fractional rows, both included) in every lane.
    #[inline(always)]
    pub(super) fn within(&self, low: &Lane, high: &Lane) -> Range<usize> {
        let behind = each(|lane| high[lane] + 1.0);
        let end = (smallest(&behind) as usize).min(self.rows());
        (largest(low).ceil() as usize).min(end)..end
    }

    /// Makes room for `rows` rows of `count` lanes. Samples of earlier batches remain, but lie in no window.
    pub(super) fn clear(&mut self, count: usize, rows: usize) {
        self.count = count;
        self.raw.resize(rows, [0.0; LANES]);
        self.blurred.resize(rows, [0.0; LANES]);
        self.candidate_rows = rows..0;
    }

    /// Records the candidate's position in a lane, whose window `held` (positions) begins in row `start`. Call it for
    /// each lane in order, from lane 0.
    pub(super) fn place_lane(
        &mut self,
        lane: usize,
        start: usize,
        held: &Range<usize>,
        candidate: &Candidate,
    ) {
        let first = start + (candidate.first as usize - held.start);
        let behind = first + candidate.length() as usize;
        let rows = &mut self.candidate_rows;
        (rows.start, rows.end) = (rows.start.min(first), rows.end.max(behind));
        // Rows are few. Signed, because vector units convert signed integers faster.
        let row = |row: usize| row as i32 as f32;
        self.start[lane] = row(start);
        self.end[lane] = row(start + held.len());
        self.first[lane] = row(first);
        self.last[lane] = row(behind - 1);
        self.peak[lane] = grey(candidate.peak) as f32;
        if lane == 0 {
            for array in
                [&mut self.start, &mut self.end, &mut self.first, &mut self.last, &mut self.peak]
            {
                *array = [array[0]; LANES];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_hold_all_lanes_or_lie_in_every_one() {
        let mut sections = Sections::default();
        sections.clear(LANES, 40);
        let mut low = each(|lane| 3.75 + 0.5 * lane as f32);
        let high = each(|lane| 20.25 + 0.5 * lane as f32);
        assert_eq!(sections.reach(&low, &high), 3..28);
        assert_eq!(sections.within(&low, &high), 12..21);
        (low[0], low[3]) = (-5.0, f32::NAN);
        assert_eq!(sections.reach(&low, &high), 0..28);
        assert_eq!(sections.within(&low, &high), 12..21);
        let none = [-3.5; LANES];
        assert!(sections.reach(&none, &none).is_empty());
        assert!(sections.within(&low, &none).is_empty());
        assert_eq!(sections.reach(&high, &[99.0; LANES]), 20..40);
    }
}
