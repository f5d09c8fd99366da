//! Candidates of a horizontal stripe: collects runs, which arrive row by row, into candidates column by column.

use super::section::{Candidate, LineCandidate};

/// No candidate: a value later than every row.
const NONE: u32 = u32::MAX;

/// Open candidates, one per column. Stored as parallel arrays so that a run is processed in whole vectors.
#[derive(Debug, Default)]
pub(super) struct Columns {
    first: Vec<u32>,
    last: Vec<u32>,
    peak: Vec<u32>,
    /// Smallest sample since the peak, and the deepest valley so far.
    valley: Vec<u32>,
    dip: Vec<u32>,
    /// Start index of each column's candidates during sorting.
    starts: Vec<u32>,
    in_order: Vec<LineCandidate>,
}

impl Columns {
    /// Removes all candidates, keeps the memory.
    pub(super) fn clear(&mut self, columns: usize) {
        let Self { first, last, peak, valley, dip, .. } = self;
        for (array, value) in [(first, NONE), (last, 0), (peak, 0), (valley, 0), (dip, 0)] {
            array.clear();
            array.resize(columns, value);
        }
    }

    /// Adds a run of samples of row `row` that begins in column `start`. Candidates that ended above it move to
    /// `found`.
    #[inline(always)]
    pub(super) fn add<T: Copy + Into<u32>>(
        &mut self,
        row: u32,
        start: u32,
        samples: &[T],
        found: &mut Vec<LineCandidate>,
    ) {
        let columns = start as usize..start as usize + samples.len();
        let first = &mut self.first[columns.clone()];
        let last = &mut self.last[columns.clone()];
        let peak = &mut self.peak[columns.clone()];
        let valley = &mut self.valley[columns.clone()];
        let dip = &mut self.dip[columns];
        let has_ended = |first: u32, last: u32| (first != NONE) & (last + 1 != row);
        let mut some_ended = false;
        for (&first, &last) in first.iter().zip(&*last) {
            some_ended |= has_ended(first, last);
        }
        if some_ended {
            for i in 0..first.len() {
                if has_ended(first[i], last[i]) {
                    let candidate = Candidate::alone(first[i], last[i], peak[i], dip[i]);
                    found.push(LineCandidate { line: start + i as u32, candidate });
                    (first[i], peak[i], valley[i], dip[i]) = (NONE, 0, 0, 0);
                }
            }
        }
        let ends = first.iter_mut().zip(last);
        let extremes = peak.iter_mut().zip(valley).zip(dip);
        for (((first, last), ((peak, valley), dip)), &sample) in ends.zip(extremes).zip(samples) {
            let sample = sample.into();
            *first = (*first).min(row);
            *last = row;
            let lower_maximum = sample.min(*peak);
            *dip = (*dip).max(lower_maximum.max(*valley) - *valley);
            *valley = if sample > *peak { sample } else { sample.min(*valley) };
            *peak = (*peak).max(sample);
        }
    }

    /// Closes all candidates and sorts `found` by line and position.
    pub(super) fn finish(&mut self, found: &mut Vec<LineCandidate>) {
        let ended_early = found.len();
        for (line, &first) in self.first.iter().enumerate() {
            if first != NONE {
                let (last, peak, dip) = (self.last[line], self.peak[line], self.dip[line]);
                let candidate = Candidate::alone(first, last, peak, dip);
                found.push(LineCandidate { line: line as u32, candidate });
            }
        }
        if ended_early > 0 {
            self.sort(found);
        }
    }

    /// Sorts candidates by line with a counting sort; those of one line are already in order.
    fn sort(&mut self, found: &mut Vec<LineCandidate>) {
        self.starts.clear();
        self.starts.resize(self.first.len() + 1, 0);
        for found in &*found {
            self.starts[found.line as usize + 1] += 1;
        }
        for line in 1..self.starts.len() {
            self.starts[line] += self.starts[line - 1];
        }
        self.in_order.clear();
        self.in_order.resize(found.len(), LineCandidate::default());
        for &found in &*found {
            let place = &mut self.starts[found.line as usize];
            self.in_order[*place as usize] = found;
            *place += 1;
        }
        std::mem::swap(found, &mut self.in_order);
    }
}
