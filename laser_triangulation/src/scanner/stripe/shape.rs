//! Compares cross-sections with their model, one bright maximum with equal flanks.
//!
//! The middle between the two edges at a level, as a function of the level, is the bisector of the cross-section. That
//! of a stripe alone is straight; a halo, a reflection or a second line in one flank bends it. Two lines side by side
//! without a valley make the top broader than a Gaussian's. Both are measured on the blurred samples of every
//! cross-section and compared with their scatter along the stripe, which noise and speckle cause.

use super::{
    Centerline,
    elementary::in_quadrature,
    flag,
    lanes::{Lane, Sections, append, each},
    logarithm::ln,
    section::Levels,
    width::Edges,
};
use crate::statistics::{MAD_TO_SIGMA, median};

/// Shares of the peak at which edges are compared: close to the top, and low on the flanks but above most halos.
const HIGH: f32 = 0.7;
const LOW: f32 = 0.35;
/// The shares of the peak at which a cross-section's edges are needed: its shape's, and half between them for the width.
pub(super) const SHARES: [f32; 3] = [HIGH, 0.5, LOW];
/// ln(1 / [`HIGH`]).
const LN_HIGH: f32 = 0.356_674_94;
/// Width of a Gaussian at [`HIGH`] divided by that at half its peak: √(ln(1/0.7) / ln 2).
const GAUSSIAN_TOP: f32 = 0.717_34;
/// Tops broader than a Gaussian's by more than this are no single stripe. Two equal lines 1.7 standard deviations apart
/// exceed it.
const BROADEST: f32 = 0.018;
/// A bisector that bends by less than this share of the width is straight enough.
const STRAIGHT: f32 = 0.015;
/// A bend, or a broad top, beyond this many standard deviations of its scatter along the stripe is significant.
const SIGNIFICANT: f32 = 3.0;
/// Error of the centre in multiples of the bend. In rendered scenes with halos, reflections and second lines, the error
/// is one to six times the bend.
const ERROR_PER_BEND: f32 = 3.0;
/// Error of the centre of a top that is too broad, as a share of the width at half maximum.
const ERROR_PER_WIDTH: f32 = 0.17;
/// The same where a neighbour hides the foot of the stripe.
const ERROR_BESIDE_NEIGHBOUR: f32 = 0.05;
/// A clipped top wider than this holds no position, pixels.
const WIDEST_CLIPPED_PX: f32 = 32.0;
/// A run this much longer than a Gaussian of the same peak and width has a halo under it: times, and pixels more.
const HALO: (f32, f32) = (1.3, 4.0);
/// Approximate number of second differences evaluated per frame.
const DIFFERENCES: usize = 256;

/// Shape of each cross-section of a batch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    /// Edges at [`HIGH`].
    high: Edges,
    /// Bend of the bisector: from its middle at [`HIGH`] to that at [`LOW`], pixels.
    bend_px: Lane,
    /// Full width at half maximum of the blurred samples, pixels.
    width_px: Lane,
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

/// Shapes of all points of a frame.
#[derive(Debug, Default)]
pub(super) struct Shapes {
    bend_px: Vec<f32>,
    width_px: Vec<f32>,
    /// Width at [`HIGH`] divided by that at half the peak.
    top: Vec<f32>,
    differences: Vec<f32>,
}

impl Shapes {
    /// Removes all shapes, keeps the memory.
    pub(super) fn clear(&mut self) {
        self.bend_px.clear();
        self.width_px.clear();
        self.top.clear();
    }

    /// Adds the shapes of the first `count` lanes.
    #[inline(always)]
    pub(super) fn push(&mut self, shape: &Shape, count: usize) {
        let top_width = shape.high.width_px();
        let top = each(|lane| top_width[lane] / shape.width_px[lane]);
        append(&mut self.bend_px, &shape.bend_px, count);
        append(&mut self.width_px, &shape.width_px, count);
        append(&mut self.top, &top, count);
    }

    /// Adds a cross-section that is too long to have a shape.
    pub(super) fn push_broad(&mut self) {
        self.bend_px.push(0.0);
        self.width_px.push(f32::NAN);
        self.top.push(f32::NAN);
    }

    /// Widens sigma and sets [`flag::MISFIT`] where the cross-section does not fit its model. Points closer than
    /// `distance` share pixels.
    pub(super) fn judge(&mut self, centerline: &mut Centerline, distance: usize) {
        let Self { bend_px, width_px, top, differences } = self;
        let bend_noise_px = SIGNIFICANT * scatter(bend_px, distance, differences);
        let top_noise = SIGNIFICANT * scatter(top, distance, differences);
        let broadest = GAUSSIAN_TOP + BROADEST.max(top_noise);
        let points = centerline.flags.iter_mut().zip(&mut centerline.sigma_px);
        let shapes = bend_px.iter().zip(&*width_px).zip(&*top);
        for ((flags, sigma), ((bend, &width), &top)) in points.zip(shapes) {
            let (bend, most) = (bend.abs(), bend_noise_px.max(STRAIGHT * width));
            // False where an edge is hidden.
            if bend <= most && top <= broadest && top * width <= WIDEST_CLIPPED_PX {
                continue;
            }
            let has = *flags;
            let has = |flag: u8| has & flag != 0;
            let mut widen = |error: f32| {
                // An unknown width adds nothing.
                if error.is_finite() {
                    *sigma = in_quadrature(*sigma, error);
                }
            };
            if bend > most {
                *flags |= flag::MISFIT;
                // The centre lies in the top.
                widen((ERROR_PER_BEND * bend).min(top * width));
            }
            if bend.is_nan() && has(flag::MULTIPLE_PEAKS) {
                widen(ERROR_BESIDE_NEIGHBOUR * width);
            }
            let is_hidden =
                bend.is_nan() && !has(flag::CLIPPED | flag::MULTIPLE_PEAKS | flag::LOW_CONTRAST);
            let is_broad =
                if has(flag::SATURATED) { top * width > WIDEST_CLIPPED_PX } else { top > broadest };
            if is_hidden || is_broad {
                *flags |= flag::MISFIT;
                widen(ERROR_PER_WIDTH * width);
            }
        }
    }
}

/// Returns the robust scatter of values along the stripe, from their second differences at a distance.
fn scatter(values: &[f32], distance: usize, differences: &mut Vec<f32>) -> f32 {
    let step = values.len() / DIFFERENCES + 1;
    differences.clear();
    for triple in values.windows(2 * distance + 1).step_by(step) {
        let difference = triple[0] - 2.0 * triple[distance] + triple[2 * distance];
        if difference.is_finite() {
            differences.push(difference.abs());
        }
    }
    MAD_TO_SIGMA as f32 * median(differences).unwrap_or(0.0) / 6.0_f32.sqrt()
}

#[cfg(test)]
mod tests;
