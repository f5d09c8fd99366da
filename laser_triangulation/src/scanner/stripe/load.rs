//! Cross-sections about candidates, read from the plane and from the blurred tiles.

use super::{
    blur::{Sample, UNITS},
    broad::{Broad, BroadRuns},
    lanes::{LANES, Sections, each},
    section::{Levels, LineCandidate},
    tile_blur::BlurInput,
    tiles::BlurredTiles,
};
use crate::scanner::params::StripeDirection;
use fearless_simd::Simd;
use std::ops::Range;

/// Reads cross-sections from one frame.
#[derive(Debug)]
pub(super) struct Loader<'a, S: Sample> {
    /// The frame and its blur.
    pub(crate) input: BlurInput<'a, S>,
    /// The blurred part of the frame; extended where a section reaches beyond it.
    pub(crate) tiles: &'a mut BlurredTiles<S>,
    /// Direction of the stripe.
    pub(crate) direction: StripeDirection,
}

impl<S: Sample> Loader<'_, S> {
    /// Replaces `sections` by those about the candidates, one per lane.
    #[inline(always)]
    pub(super) fn load<V: Simd>(
        &mut self,
        vectors: V,
        batch: &[LineCandidate],
        levels: &Levels<'_>,
        sections: &mut Sections,
    ) {
        let length = match self.direction {
            StripeDirection::Horizontal => self.input.plane.height,
            StripeDirection::Vertical => self.input.plane.width,
        };
        let mut ends: [Range<usize>; LANES] = std::array::from_fn(|_| 0..0);
        let held = |found: &LineCandidate| {
            let candidate = &found.candidate;
            candidate.reach(levels.margin(candidate), length)
        };
        let (mut low, mut high, mut longest) = (usize::MAX, 0, 0);
        for (lane, found) in batch.iter().enumerate() {
            let held = held(found);
            (low, high) = (low.min(held.start), high.max(held.end));
            longest = longest.max(held.len());
            ends[lane] = held;
        }
        let first = batch[0].line as usize;
        let is_side_by_side = batch.len() == LANES
            && self.direction == StripeDirection::Horizontal
            && batch[LANES - 1].line as usize == first + LANES - 1
            && (0..).zip(batch).all(|(i, found)| found.line as usize == first + i);
        if is_side_by_side && high - low <= longest + LANES {
            sections.clear(batch.len(), high - low);
            self.tiles.ensure(vectors, self.input, first..first + LANES, low..high);
            for (lane, found) in batch.iter().enumerate() {
                sections.place_lane(lane, ends[lane].start - low, &ends[lane], &found.candidate);
            }
            self.copy_rows(first, low, sections);
        } else {
            sections.clear(batch.len(), longest);
            for (lane, found) in batch.iter().enumerate() {
                let held = ends[lane].clone();
                self.ensure(vectors, found.line as usize, held.clone());
                sections.place_lane(lane, 0, &held, &found.candidate);
                self.copy_lane(lane, found.line as usize, held, sections);
            }
        }
    }

    /// Copies rows from `y` on of the columns from `x` on: consecutive samples are consecutive lanes.
    #[inline(always)]
    fn copy_rows(&self, x: usize, y: usize, sections: &mut Sections) {
        let width = self.input.plane.width;
        let raw_rows = self.input.plane.samples[y * self.input.plane.stride + x..]
            .chunks(self.input.plane.stride);
        let rows = self.tiles.rows_from(y)[x..].chunks(width);
        let sections = sections.raw.iter_mut().zip(&mut sections.blurred);
        for ((raw, blurred), (raw_row, row)) in sections.zip(raw_rows.zip(rows)) {
            let (Some(raw_row), Some(row)) =
                (raw_row.first_chunk::<LANES>(), row.first_chunk::<LANES>())
            else {
                return;
            };
            *raw = each(|lane| Into::<u32>::into(raw_row[lane]) as i32 as f32);
            *blurred = each(|lane| grey_of(row[lane].into()));
        }
    }

    /// Copies the held positions of one line.
    #[inline(always)]
    fn copy_lane(&self, lane: usize, line: usize, held: Range<usize>, sections: &mut Sections) {
        let rows = sections.raw.iter_mut().zip(&mut sections.blurred);
        for (position, (raw, blurred)) in held.zip(rows) {
            let (raw_sample, sample) = self.sample(line, position);
            raw[lane] = raw_sample as f32;
            blurred[lane] = grey_of(sample);
        }
    }

    /// Sums up candidates in consecutive lines that are too long for cross-sections. Works in row order, because a row
    /// of samples crosses many candidates of a horizontal stripe.
    #[inline(always)]
    pub(super) fn add_up(&self, batch: &[LineCandidate], runs: &mut BroadRuns) {
        runs.clear(batch);
        let lines = batch[0].line as usize..batch[0].line as usize + batch.len();
        match self.direction {
            StripeDirection::Horizontal => {
                for y in runs.positions() {
                    let row = y as usize;
                    let (raw, sums) = (self.input.plane.row(row), self.tiles.row(row));
                    runs.add_across(y, &raw[lines.clone()], &sums[lines.clone()]);
                }
            }
            StripeDirection::Vertical => {
                for (i, line) in lines.enumerate() {
                    runs.add_along(i, self.input.plane.row(line), self.tiles.row(line));
                }
            }
        }
    }

    /// Returns the measurements of `found`, candidate `i` of `runs`.
    pub(super) fn broad(&self, found: &LineCandidate, i: usize, runs: &BroadRuns) -> Broad {
        let first = found.candidate.first as usize;
        let length = found.candidate.length() as usize;
        let raw_at = |place: usize| {
            let (line, position) = (found.line as usize, first + place.min(length - 1));
            match self.direction {
                StripeDirection::Horizontal => self.input.plane.at(line, position),
                StripeDirection::Vertical => self.input.plane.at(position, line),
            }
            .into()
        };
        runs.broad(i, raw_at)
    }

    #[inline(always)]
    fn ensure<V: Simd>(&mut self, vectors: V, line: usize, held: Range<usize>) {
        let lines = line..line + 1;
        let (xs, ys) = match self.direction {
            StripeDirection::Horizontal => (lines, held),
            StripeDirection::Vertical => (held, lines),
        };
        self.tiles.ensure(vectors, self.input, xs, ys);
    }

    /// Returns the raw and the blurred sample at a position of a line.
    fn sample(&self, line: usize, position: usize) -> (u32, u32) {
        let (x, y) = match self.direction {
            StripeDirection::Horizontal => (line, position),
            StripeDirection::Vertical => (position, line),
        };
        (self.input.plane.at(x, y).into(), self.tiles.known(x, y))
    }
}

/// Returns the grey level of a blurred sample, at most 2²⁴ - 1.
#[inline(always)]
fn grey_of(sample: u32) -> f32 {
    // Signed, because vector units convert signed integers faster.
    sample as i32 as f32 * (1.0 / UNITS as f32)
}
