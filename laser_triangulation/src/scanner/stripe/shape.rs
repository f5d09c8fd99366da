//! Compares cross-sections with their model, one bright maximum with equal flanks.
//!
//! The middle between the two edges at a level, as a function of the level, is the bisector of the cross-section. That
//! of a stripe alone is straight; a halo, a reflection or a second line in one flank bends it. Two lines side by side
//! without a valley make the top broader than a Gaussian's. Both are measured on the blurred samples of every
//! cross-section; `misfit` judges those of a frame.

use super::{
    lanes::{Lane, Sections, each},
    logarithm::ln,
    section::Levels,
    width::Edges,
};

/// Shares of the peak at which edges are compared: close to the top, and low on the flanks but above most halos.
const HIGH: f32 = 0.7;
const LOW: f32 = 0.35;
/// The shares of the peak at which a cross-section's edges are needed: its shape's, and half between them for the width.
pub(super) const SHARES: [f32; 3] = [HIGH, 0.5, LOW];
/// ln(1 / [`HIGH`]).
const LN_HIGH: f32 = 0.356_674_94;
/// A run this much longer than a Gaussian of the same peak and width has a halo under it: times, and pixels more.
const HALO: (f32, f32) = (1.3, 4.0);
/// Shape of each cross-section of a batch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    /// Edges at [`HIGH`].
    high: Edges,
    /// Bend of the bisector: from its middle at [`HIGH`] to that at [`LOW`], pixels.
    pub(super) bend_px: Lane,
    /// Full width at half maximum of the blurred samples, pixels.
    pub(super) width_px: Lane,
    /// 1 where a halo lies under the stripe.
    has_halo: Lane,
}

impl Shape {
    /// Measures it from the edges at [`SHARES`].
    #[inline(always)]
    pub(super) fn of(
        sections: &Sections,
        [high, half, low]: &[Edges; 3],
        levels: &Levels<'_>,
    ) -> Self {
        let [top, bottom] = [high, low].map(Edges::middle_px);
        let bend_px = each(|lane| bottom[lane] - top[lane]);
        let has_halo = has_halo(sections, &high.width_px(), levels);
        Self { high: *high, bend_px, width_px: half.width_px(), has_halo }
    }

    /// Returns the width at [`HIGH`], pixels.
    #[inline(always)]
    pub(super) fn top_width_px(&self) -> Lane {
        self.high.width_px()
    }

    /// True if a halo lies under the stripe in a lane.
    pub(super) fn has_halo(&self, lane: usize) -> bool {
        self.has_halo[lane] > 0.0
    }

    /// Returns the places of the first and the last sample near the top of a lane; `None` if an edge is hidden.
    pub(super) fn top(&self, lane: usize) -> Option<[f32; 2]> {
        self.high.between(lane)
    }
}

/// Returns 1 where a candidate is longer than a Gaussian of its peak and its width at [`HIGH`].
#[inline(always)]
fn has_halo(sections: &Sections, top_width: &Lane, levels: &Levels<'_>) -> Lane {
    let threshold = levels.segment_threshold_grey().max(1.0);
    let (peak, length) = (&sections.peak, sections.length());
    // A Gaussian as long as this, without what a halo may add, has this ln(peak / threshold).
    let ln_of_length = each(|lane| {
        let times = ((length[lane] - HALO.1) / HALO.0).max(0.0) / top_width[lane];
        LN_HIGH * (times * times)
    });
    // ln x > 2 (x - 1) / (x + 1), which is enough for most.
    let may_have = each(|lane| {
        let least = 2.0 * (peak[lane] - threshold) / (peak[lane] + threshold);
        if ln_of_length[lane] > least { 1.0 } else { 0.0 }
    });
    if may_have.iter().sum::<f32>() <= 0.0 {
        return may_have;
    }
    each(|lane| {
        let is_longer = ln_of_length[lane] > ln(peak[lane] / threshold).max(0.0);
        if is_longer { may_have[lane] } else { 0.0 }
    })
}
