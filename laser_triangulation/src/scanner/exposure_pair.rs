//! Alternating short and long exposures: fills gaps in each frame's centreline from the frame before.
//!
//! Each frame is paired with its direct predecessor. The longer exposure of the two sees dark surfaces; the shorter one
//! is not saturated on bright ones. The result is the long exposure's line. Where that is saturated, too broad for a
//! stripe (`LOW_CONTRAST`) or has no point, the short exposure's point replaces it, with its own position, width, σ and
//! flags. A short exposure's point that is itself `LOW_CONTRAST` replaces none.
//!
//! - The long exposure is identified from the picture, by the median ratio of the grey levels at the centre over the
//!   lines found in both. If those are saturated in both, the number of saturated points decides.
//! - Intensities are in the long exposure's grey levels. The short exposure's are multiplied by that ratio and may exceed
//!   full scale. If every common line is saturated in the long exposure, the ratio is its lower bound.
//! - With several surfaces in a line the first is paired with the first, the second with the second.
//! - The two frames are one period apart: on a moving part, a point of the frame before lies one step of the motion
//!   behind the frame's position. No frame waits for another, so there is no delay.

mod points;
#[cfg(test)]
mod tests;

use super::{
    frame_index::FrameIndex,
    params::StripeDirection,
    stripe::{Centerline, flag},
};
use crate::statistics::median;
use points::{MergeWriter, Points, join};

/// Smallest ratio of grey levels at which exposures count as different.
const MIN_RATIO: f32 = 1.25;
/// Minimum number of common lines for comparing the exposures.
const MIN_COMMON: usize = 8;

/// Result of pairing a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExposurePairing {
    /// The line contains points of both exposures.
    Merged {
        /// Number of points from the frame before.
        from_before: u32,
    },
    /// The frame before is missing, was rejected, has another size or belongs to another scan: the line is only this
    /// frame's.
    Alone,
    /// The two exposures do not differ clearly, or have too few lines in common: the line is only this frame's.
    Alike,
}

/// Pairs frame after frame. Allocates nothing after the longest lines.
#[derive(Debug)]
pub(super) struct ExposurePairs {
    direction: StripeDirection,
    /// Own points of the frame before.
    before: Centerline,
    /// Size of its image; `None`: there is no frame before.
    before_px: Option<(u32, u32)>,
    /// This frame's own points, while its line is replaced.
    own: Centerline,
    ratios: Vec<f32>,
}

impl ExposurePairs {
    /// Creates the state before the first frame.
    pub(super) fn new(direction: StripeDirection) -> Self {
        Self {
            direction,
            before: Centerline::default(),
            before_px: None,
            own: Centerline::default(),
            ratios: Vec::new(),
        }
    }

    /// Discards the frame before.
    pub(super) const fn restart(&mut self) {
        self.before_px = None;
    }

    /// Replaces a frame's own line by that of both exposures; `image_px` is the size of its image.
    pub(super) fn merge(
        &mut self,
        centerline: &mut Centerline,
        index: FrameIndex,
        image_px: (u32, u32),
    ) -> ExposurePairing {
        self.own.copy_from(centerline);
        let follows = index.frames_missing == 0 && index.frames_rejected == 0;
        let pairing = if follows && self.before_px == Some(image_px) {
            self.merge_with_before(centerline)
        } else {
            ExposurePairing::Alone
        };
        std::mem::swap(&mut self.before, &mut self.own);
        self.before_px = Some(image_px);
        pairing
    }

    fn merge_with_before(&mut self, merged: &mut Centerline) -> ExposurePairing {
        let own = Points::new(&self.own, self.direction);
        let before = Points::new(&self.before, self.direction);
        let Some(ratio) = ratio(own, before, &mut self.ratios) else {
            return ExposurePairing::Alike;
        };
        let is_own_long = ratio > 1.0;
        let (long, short) = if is_own_long { (own, before) } else { (before, own) };
        let scales = [1.0, ratio.max(1.0 / ratio)];
        let mut writer = MergeWriter::new(merged, [long, short], scales);
        join(long, short, |surface, pair| match pair {
            (Some(at_long), Some(at_short)) => {
                let takes_short = long.has(at_long, flag::SATURATED | flag::LOW_CONTRAST)
                    && !short.has(at_short, flag::LOW_CONTRAST);
                let at = if takes_short { at_short } else { at_long };
                writer.push(surface, usize::from(takes_short), at);
            }
            (Some(at), None) => writer.push(surface, 0, at),
            (None, Some(at)) => writer.push(surface, 1, at),
            (None, None) => {}
        });
        let [num_long, num_short] = writer.num_taken();
        ExposurePairing::Merged { from_before: if is_own_long { num_short } else { num_long } }
    }
}

/// Returns the ratio of one frame's grey levels to the other's; `None` if they do not differ clearly or have too few
/// common lines.
fn ratio(own: Points<'_>, before: Points<'_>, ratios: &mut Vec<f32>) -> Option<f32> {
    // A line saturated in one of the two gives only a bound, used as a fallback.
    let mut num_common = 0;
    for max_saturated in [0, 1] {
        ratios.clear();
        num_common = 0;
        join(own, before, |_, pair| {
            let (Some(a), Some(b)) = pair else { return };
            num_common += 1;
            let saturated = [own.has(a, flag::SATURATED), before.has(b, flag::SATURATED)];
            let num_saturated = saturated.into_iter().filter(|&is| is).count();
            let ratio = own.intensity(a) / before.intensity(b);
            if num_saturated <= max_saturated && ratio.is_finite() && ratio > 0.0 {
                ratios.push(ratio);
            }
        });
        if ratios.len() >= MIN_COMMON {
            return median(ratios).filter(|ratio| ratio.max(1.0 / ratio) >= MIN_RATIO);
        }
    }
    if num_common < MIN_COMMON {
        return None;
    }
    let [num_own, num_before] = [own, before].map(|points| points.num_with(flag::SATURATED));
    let is_clear = |more: usize, fewer: usize| more >= 2 * fewer + MIN_COMMON;
    if is_clear(num_own, num_before) {
        Some(MIN_RATIO)
    } else {
        is_clear(num_before, num_own).then_some(1.0 / MIN_RATIO)
    }
}
