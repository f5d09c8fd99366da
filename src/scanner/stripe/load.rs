//! Cross-sections about candidates, taken from the plane and from the blurred tiles.

use super::{
    blur::{Kernel, Sample, UNITS},
    broad::Broad,
    lanes::Sections,
    section::{Found, Levels, Section},
    tiles::BlurredTiles,
};
use crate::scanner::{channel::Plane, params::StripeDirection};
use std::ops::Range;

/// Takes cross-sections from one frame.
#[derive(Debug)]
pub struct Loader<'a, S: Sample> {
    /// The frame.
    pub plane: &'a Plane<'a, S>,
    /// The blur.
    pub kernel: &'a Kernel,
    /// What is blurred of the frame; grows by what a section reaches beyond it.
    pub tiles: &'a mut BlurredTiles<S>,
    /// Which way the stripe runs.
    pub direction: StripeDirection,
}

impl<S: Sample> Loader<'_, S> {
    /// Replaces `sections` by those about the candidates, one a lane.
    #[inline(always)]
    pub fn load(&mut self, batch: &[Found], levels: &Levels<'_>, sections: &mut Sections) {
        let length = match self.direction {
            StripeDirection::Horizontal => self.plane.height,
            StripeDirection::Vertical => self.plane.width,
        };
        let held = |found: &Found| {
            let candidate = &found.candidate;
            candidate.reach(levels.margin(candidate), length)
        };
        let rows = batch.iter().map(|found| held(found).len()).max().unwrap_or(0);
        sections.clear(batch.len(), rows);
        for (lane, found) in batch.iter().enumerate() {
            let held = held(found);
            let line = found.line as usize;
            self.ensure(line, held.clone());
            sections.place_lane(lane, 0, &held, &found.candidate);
            for (row, position) in held.enumerate() {
                let (raw, blurred) = self.sample(line, position);
                sections.raw[row][lane] = raw as f32;
                sections.blurred[row][lane] = blurred as f32 * (1.0 / UNITS as f32);
            }
        }
    }

    /// What is told of a candidate that is too long for a cross-section.
    pub fn broad(&mut self, found: &Found) -> Broad {
        let candidate = found.candidate;
        let held = candidate.first as usize..candidate.last as usize + 1;
        let line = found.line as usize;
        self.ensure(line, held.clone());
        let (raw, samples): (Vec<_>, Vec<_>) = held.map(|at| self.sample(line, at)).unzip();
        Broad::of(&Section { samples: &samples, raw: &raw, origin: candidate.first, candidate })
    }

    fn ensure(&mut self, line: usize, held: Range<usize>) {
        let lines = line..line + 1;
        let pixels = match self.direction {
            StripeDirection::Horizontal => (lines, held),
            StripeDirection::Vertical => (held, lines),
        };
        self.tiles.ensure(self.plane, self.kernel, pixels);
    }

    /// The raw and the blurred sample at a position of a line.
    fn sample(&self, line: usize, position: usize) -> (u32, u32) {
        let (x, y) = match self.direction {
            StripeDirection::Horizontal => (line, position),
            StripeDirection::Vertical => (position, line),
        };
        (self.plane.at(x, y).into(), self.tiles.known(x, y))
    }
}
