//! Short and long exposures in turn: every frame's centreline takes what it lacks from the frame before.
//!
//! Each frame is paired with the one that directly precedes it. The longer exposed of the two sees dark surfaces, the
//! shorter one is not saturated on bright ones. The line is the long one's; where that is saturated or too broad
//! for a stripe (`LOW_CONTRAST`), and where it has no point, stands the short one's point with its own position, width,
//! σ and flags. A short one's point that is `LOW_CONTRAST` itself replaces none.
//!
//! - Which is the long one the picture tells: the median ratio of the grey levels at the centre over the lines that
//!   both have found. Where those are saturated in both, the number of saturated points decides.
//! - Intensities are in the long one's grey levels: the short one's are multiplied by that ratio and may exceed full
//!   scale. Where every common line is saturated in the long one, the ratio is the smallest that it can be.
//! - With several surfaces in a line the first is paired with the first, the second with the second.
//! - The two frames are one period apart: on a moving part a point of the frame before lies one step of the motion
//!   behind the frame's position. No frame waits for another: there is no delay.

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

/// Exposures whose grey levels differ less are alike.
const MIN_RATIO: f32 = 1.25;
/// Fewer common lines say nothing about the exposures.
const MIN_COMMON: usize = 8;

/// What became of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExposurePairing {
    /// Its line has the points of both exposures.
    Merged {
        /// How many of them the frame before gave.
        from_before: u32,
    },
    /// The frame before is missing, was refused, has another size or belongs to another scan: the line is this frame's
    /// alone.
    Alone,
    /// The two exposures do not differ clearly, or have too few lines in common: the line is this frame's alone.
    Alike,
}

/// Pairs frame after frame without allocating once the longest lines have been seen.
#[derive(Debug)]
pub(super) struct ExposurePairs {
    direction: StripeDirection,
    /// Own points of the frame before.
    before: Centerline,
    /// Size of its image; none: there is no frame before.
    before_px: Option<(u32, u32)>,
    /// This frame's own points, while its line is replaced.
    own: Centerline,
    ratios: Vec<f32>,
}

impl ExposurePairs {
    /// Before the first frame.
    pub(super) fn new(direction: StripeDirection) -> Self {
        Self {
            direction,
            before: Centerline::default(),
            before_px: None,
            own: Centerline::default(),
            ratios: Vec::new(),
        }
    }

    /// Forgets the frame before.
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

/// Grey level of one frame for one of the other; `None` when they do not differ clearly or hardly meet.
fn ratio(own: Points<'_>, before: Points<'_>, ratios: &mut Vec<f32>) -> Option<f32> {
    // Saturated in one of the two, a line gives a bound only: better than nothing.
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
