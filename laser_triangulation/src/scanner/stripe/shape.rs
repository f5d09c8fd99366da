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
    lanes::{Lane, Sections, each},
    logarithm::ln,
    section::Levels,
    width::Edges,
};
use crate::statistics::{MAD_TO_SIGMA, median};

/// Shares of the peak at which edges are compared: close to the top, and low on the flanks but above most halos.
const HIGH: f32 = 0.7;
const LOW: f32 = 0.35;
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
const DIFFERENCES: usize = 512;

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
    /// Measures it; `half` are the edges at half the peak.
    #[inline(always)]
    pub(super) fn of(
        sections: &Sections,
        brightest: &Lane,
        half: &Edges,
        levels: &Levels<'_>,
    ) -> Self {
        let high = Edges::at(sections, brightest, HIGH);
        let [top, bottom] = [&high, &Edges::at(sections, brightest, LOW)].map(Edges::middle_px);
        let threshold = levels.segment_threshold_grey().max(1.0);
        let (length, top_width) = (sections.length(), high.width_px());
        let has_halo = each(|lane| {
            // A Gaussian's width at the threshold, from its width at `HIGH`.
            let ratio = ln(sections.peak[lane] / threshold).max(0.0) / LN_HIGH;
            let expected = top_width[lane] * ratio.sqrt();
            if length[lane] > HALO.0 * expected + HALO.1 { 1.0 } else { 0.0 }
        });
        let bend_px = each(|lane| bottom[lane] - top[lane]);
        Self { high, bend_px, width_px: half.width_px(), has_halo }
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
        self.bend_px.extend_from_slice(&shape.bend_px[..count]);
        self.width_px.extend_from_slice(&shape.width_px[..count]);
        self.top.extend_from_slice(&top[..count]);
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
        for (i, flags) in centerline.flags.iter_mut().enumerate() {
            let (bend, width, has) = (bend_px[i].abs(), width_px[i], *flags);
            let has = |flag: u8| has & flag != 0;
            let sigma = &mut centerline.sigma_px[i];
            let mut widen = |error: f32| {
                // An unknown width adds nothing.
                if error.is_finite() {
                    *sigma = in_quadrature(*sigma, error);
                }
            };
            if bend > bend_noise_px.max(STRAIGHT * width) {
                *flags |= flag::MISFIT;
                // The centre lies in the top.
                widen((ERROR_PER_BEND * bend).min(top[i] * width));
            }
            if bend.is_nan() && has(flag::MULTIPLE_PEAKS) {
                widen(ERROR_BESIDE_NEIGHBOUR * width);
            }
            let is_hidden =
                bend.is_nan() && !has(flag::CLIPPED | flag::MULTIPLE_PEAKS | flag::LOW_CONTRAST);
            let is_broad = if has(flag::SATURATED) {
                top[i] * width > WIDEST_CLIPPED_PX
            } else {
                top[i] > broadest
            };
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
    let middles = (distance..values.len().saturating_sub(distance)).step_by(step);
    differences.clear();
    differences.extend(
        middles
            .map(|at| (values[at - distance] - 2.0 * values[at] + values[at + distance]).abs())
            .filter(|difference| difference.is_finite()),
    );
    MAD_TO_SIGMA as f32 * median(differences).unwrap_or(0.0) / 6.0_f32.sqrt()
}

#[cfg(test)]
mod tests;
