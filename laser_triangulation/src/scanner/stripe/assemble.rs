//! Assembles the points of cross-sections into a centreline.

use super::{
    Centerline,
    broad::Broad,
    flag,
    lanes::{LANES, append},
    measure::Points,
    misfit::Shapes,
    section::{Candidate, Levels, LineCandidate},
};
use crate::scanner::{channel::Offset, params::StripeDirection};

/// Builds a centreline from cross-sections in order along the stripe.
#[derive(Debug)]
pub(super) struct Assembler<'a> {
    centerline: &'a mut Centerline,
    shapes: &'a mut Shapes,
    direction: StripeDirection,
    /// Column and row of the searched region in the image.
    offset: Offset,
    /// Positions across the stripe: rows of the region for a horizontal stripe.
    length_across: u32,
    /// The cross-section pushed last.
    previous: Option<Place>,
}

impl<'a> Assembler<'a> {
    /// Starts an empty centreline in a region of `length_across` positions across the stripe.
    pub(super) fn new(
        centerline: &'a mut Centerline,
        shapes: &'a mut Shapes,
        direction: StripeDirection,
        offset: Offset,
        length_across: usize,
    ) -> Self {
        centerline.clear();
        shapes.clear();
        let length_across = length_across as u32;
        Self { centerline, shapes, direction, offset, length_across, previous: None }
    }

    /// Adds the points of these candidates.
    pub(super) fn push(&mut self, found: &[LineCandidate], points: &Points, levels: &Levels<'_>) {
        let (mut across_px, mut along_px, mut flags) = ([0.0; LANES], [0.0; LANES], [0; LANES]);
        for (lane, found) in found.iter().enumerate() {
            let is_saturated = points.brightest_raw[lane] >= levels.full_scale as f32;
            let is_low = levels.is_low(found.candidate.peak, points.intensity[lane]);
            flags[lane] = (u8::from(is_saturated) * flag::SATURATED)
                | (u8::from(is_low) * flag::LOW_CONTRAST)
                | self.flags_of(&found.candidate);
            along_px[lane] = self.along_px(found.line);
            let position_px = points.centres.position_px[lane].into();
            across_px[lane] = self.across_px(points.first[lane], position_px);
        }
        let at = self.centerline.flags.len();
        for (lane, found) in found.iter().enumerate() {
            self.join(at + lane, found);
        }
        let count = found.len();
        append(self.along(), &along_px, count);
        append(self.across(), &across_px, count);
        append(&mut self.centerline.flags, &flags, count);
        append(&mut self.centerline.width_px, &points.width_px, count);
        append(&mut self.centerline.intensity, &points.intensity, count);
        append(&mut self.centerline.sigma_px, &points.centres.sigma_px, count);
        self.shapes.push(&points.shape, count);
    }

    /// Adds the point of a candidate that is too long for a cross-section of the stripe: its centre of gravity. The
    /// true centre may be anywhere in it.
    pub(super) fn push_broad(&mut self, found: &LineCandidate, broad: &Broad, levels: &Levels<'_>) {
        let is_saturated = broad.brightest_raw >= levels.full_scale;
        let flags = flag::LOW_CONTRAST | if is_saturated { flag::SATURATED } else { 0 };
        self.join(self.centerline.flags.len(), found);
        self.centerline.flags.push(flags | self.flags_of(&found.candidate));
        let along_px = self.along_px(found.line);
        self.along().push(along_px);
        let across_px = self.across_px(found.candidate.first, broad.position_px);
        self.across().push(across_px);
        self.shapes.push_broad();
        self.centerline.width_px.push(f32::NAN);
        self.centerline.intensity.push(broad.intensity);
        // Uniform distribution over the candidate.
        let sigma_px = f64::from(found.candidate.length()) / 12.0_f64.sqrt();
        self.centerline.sigma_px.push(sigma_px as f32);
    }

    /// Starts a stripe at the point of that index if its candidate does not continue the one before.
    #[inline(always)]
    fn join(&mut self, at: usize, found: &LineCandidate) {
        let LineCandidate { line, candidate: Candidate { first, last, .. } } = *found;
        let next = Place { line, first, last };
        if !self.previous.is_some_and(|previous| previous.continues_in(&next)) {
            self.centerline.stripe_start.push(at as u32);
        }
        self.previous = Some(next);
    }

    /// Returns the flags that follow from a candidate's place.
    #[inline(always)]
    fn flags_of(&self, candidate: &Candidate) -> u8 {
        let is_one_of_several = candidate.count > 1;
        let is_clipped = (candidate.first == 0) | (candidate.last + 1 == self.length_across);
        (u8::from(is_one_of_several) * flag::MULTIPLE_PEAKS)
            | (u8::from(is_clipped) * flag::CLIPPED)
    }

    /// Returns the position of a line in the image, pixels.
    #[inline(always)]
    const fn along_px(&self, line: u32) -> f32 {
        let offset = match self.direction {
            StripeDirection::Horizontal => self.offset.column,
            StripeDirection::Vertical => self.offset.row,
        };
        (offset as u32 + line) as f32
    }

    /// Returns the array that holds the lines' positions.
    #[inline(always)]
    const fn along(&mut self) -> &mut Vec<f32> {
        match self.direction {
            StripeDirection::Horizontal => &mut self.centerline.u_px,
            StripeDirection::Vertical => &mut self.centerline.v_px,
        }
    }

    /// Returns the position across the stripe in the image of a position counted from `first`, pixels.
    #[inline(always)]
    fn across_px(&self, first: u32, position_px: f64) -> f32 {
        let offset = match self.direction {
            StripeDirection::Horizontal => self.offset.row,
            StripeDirection::Vertical => self.offset.column,
        };
        (f64::from(offset as u32 + first) + position_px) as f32
    }

    /// Returns the array that holds positions across the stripe.
    #[inline(always)]
    const fn across(&mut self) -> &mut Vec<f32> {
        match self.direction {
            StripeDirection::Horizontal => &mut self.centerline.v_px,
            StripeDirection::Vertical => &mut self.centerline.u_px,
        }
    }
}

/// The samples of a candidate in the searched region.
#[derive(Clone, Copy, Debug)]
struct Place {
    line: u32,
    first: u32,
    last: u32,
}

impl Place {
    /// True if `next` lies in the next line and touches this one, corners included.
    const fn continues_in(&self, next: &Self) -> bool {
        (self.line + 1 == next.line) & (next.first <= self.last + 1) & (self.first <= next.last + 1)
    }
}
