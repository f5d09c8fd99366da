//! The points of two centrelines, line by line.

use crate::scanner::{params::StripeDirection, stripe::Centerline};
use std::ops::Range;

/// A centreline by position along and across the stripe.
#[derive(Clone, Copy, Debug)]
pub(super) struct Points<'a> {
    line: &'a Centerline,
    along_px: &'a [f32],
    across_px: &'a [f32],
}

impl<'a> Points<'a> {
    pub(super) fn new(line: &'a Centerline, direction: StripeDirection) -> Self {
        let (along_px, across_px) = line.along_and_across(direction);
        Self { line, along_px, across_px }
    }

    /// True if a point has any of those flags.
    pub(super) fn has(self, at: usize, flags: u8) -> bool {
        self.line.flags[at] & flags != 0
    }

    pub(super) fn num_with(self, flag: u8) -> usize {
        self.line.flags.iter().filter(|&flags| flags & flag != 0).count()
    }

    pub(super) fn intensity(self, at: usize) -> f32 {
        self.line.intensity[at]
    }

    /// Returns the points from `from` on whose lines ascend: one surface.
    fn surface(self, from: usize) -> Range<usize> {
        let along = &self.along_px[from..];
        let next = along.windows(2).position(|pair| pair[1] <= pair[0]);
        from..from + next.map_or(along.len(), |last| last + 1)
    }

    /// True if a connected stripe begins at that point.
    fn begins_stripe(self, at: usize) -> bool {
        self.line.stripe_start.binary_search(&(at as u32)).is_ok()
    }

    /// Returns half the width of the stripe, pixels; 0 if unknown.
    fn half_width_px(self, at: usize) -> f32 {
        let width_px = self.line.width_px[at];
        if width_px.is_finite() { width_px / 2.0 } else { 0.0 }
    }
}

/// Calls `on_pair` for every line in which `a` or `b` has a point, surface by surface: with the surface and the indices of
/// both points.
pub(super) fn join(
    a: Points<'_>,
    b: Points<'_>,
    mut on_pair: impl FnMut(usize, (Option<usize>, Option<usize>)),
) {
    let (mut from_a, mut from_b) = (0, 0);
    let mut surface = 0;
    while from_a < a.along_px.len() || from_b < b.along_px.len() {
        let (mut on_a, mut on_b) = (a.surface(from_a), b.surface(from_b));
        (from_a, from_b) = (on_a.end, on_b.end);
        while !(on_a.is_empty() && on_b.is_empty()) {
            let line = |points: Points<'_>, on: &Range<usize>| {
                if on.is_empty() { f32::INFINITY } else { points.along_px[on.start] }
            };
            let (line_a, line_b) = (line(a, &on_a), line(b, &on_b));
            let at_a = if line_a <= line_b { on_a.next() } else { None };
            let at_b = if line_b <= line_a { on_b.next() } else { None };
            on_pair(surface, (at_a, at_b));
        }
        surface += 1;
    }
}

/// Builds a centreline from the points of two.
#[derive(Debug)]
pub(super) struct MergeWriter<'a> {
    merged: &'a mut Centerline,
    sources: [Points<'a>; 2],
    /// Factors for the intensities of each source.
    scales: [f32; 2],
    num_taken: [u32; 2],
    /// Surface, source and index of the point written last.
    last: Option<(usize, usize, usize)>,
}

impl<'a> MergeWriter<'a> {
    /// Creates a builder and empties `merged`.
    pub(super) fn new(
        merged: &'a mut Centerline,
        sources: [Points<'a>; 2],
        scales: [f32; 2],
    ) -> Self {
        merged.clear();
        Self { merged, sources, scales, num_taken: [0; 2], last: None }
    }

    /// Returns the number of points taken from each source.
    pub(super) const fn num_taken(&self) -> [u32; 2] {
        self.num_taken
    }

    /// Adds a point of a source.
    pub(super) fn push(&mut self, surface: usize, source: usize, at: usize) {
        if !self.continues(surface, source, at) {
            self.merged.stripe_start.push(self.merged.len() as u32);
        }
        self.last = Some((surface, source, at));
        self.num_taken[source] += 1;
        let line = self.sources[source].line;
        self.merged.u_px.push(line.u_px[at]);
        self.merged.v_px.push(line.v_px[at]);
        self.merged.width_px.push(line.width_px[at]);
        self.merged.intensity.push(line.intensity[at] * self.scales[source]);
        self.merged.sigma_px.push(line.sigma_px[at]);
        self.merged.flags.push(line.flags[at]);
    }

    /// True if a point belongs to the connected stripe of the last one. Within one frame, its own stripes decide;
    /// between two frames, their stripes must touch in neighbouring lines.
    fn continues(&self, surface: usize, source: usize, at: usize) -> bool {
        let Some((last_surface, last_source, last_at)) = self.last else { return false };
        if last_surface != surface {
            return false;
        }
        let (points, last) = (self.sources[source], self.sources[last_source]);
        if source == last_source {
            return at == last_at + 1 && !points.begins_stripe(at);
        }
        let apart_px = (points.across_px[at] - last.across_px[last_at]).abs();
        let is_neighbour = (points.along_px[at] - last.along_px[last_at] - 1.0).abs() < 0.5;
        is_neighbour && apart_px <= points.half_width_px(at) + last.half_width_px(last_at) + 1.0
    }
}
