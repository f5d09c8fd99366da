//! Compares the shapes of a frame's cross-sections with that of one stripe: points on others are flagged, and their sigma
//! is widened.
//!
//! A bend or a broad top counts if it exceeds its scatter along the stripe, which noise and speckle cause. What is
//! constant along the stripe, such as a second line beside it, shows below the scatter of one point in the mean of many.

use super::{
    Centerline,
    elementary::{bounded, in_quadrature},
    flag,
    lanes::{LANES, Lane, append, each},
    shape::Shape,
};
use crate::{
    scanner::params::StripeDirection,
    statistics::{MAD_TO_SIGMA, median},
};

/// Width of a Gaussian near its top divided by that at half its peak: √(ln(1/0.7) / ln 2).
const GAUSSIAN_TOP: f32 = 0.717_34;
/// Tops broader than a Gaussian's by more than this are no single stripe. Two equal lines 1.7 standard deviations apart
/// exceed it.
const BROADEST: f32 = 0.018;
/// A bisector that bends by less than this share of the width is straight enough.
const STRAIGHT: f32 = 0.015;
/// Least number of points whose mean shape is tested, if there are as many.
const POOL: usize = 128;
/// A mean bend below this share of the width, or below so many pixels, is straight enough.
const POOL_STRAIGHT: f32 = 0.01;
const POOL_STRAIGHT_PX: f32 = 0.08;
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
/// Approximate number of second differences evaluated per frame.
const DIFFERENCES: usize = 256;

/// Shapes of all points of a frame.
#[derive(Debug, Default)]
pub(super) struct Shapes {
    bend_px: Vec<f32>,
    width_px: Vec<f32>,
    /// Width near the top divided by that at half the peak.
    top: Vec<f32>,
    differences: Vec<f32>,
}

/// Shape of one point.
#[derive(Clone, Copy)]
struct PointShape {
    bend_px: f32,
    width_px: f32,
    top: f32,
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
        let top_width = shape.top_width_px();
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
    pub(super) fn judge(
        &mut self,
        centerline: &mut Centerline,
        direction: StripeDirection,
        distance: usize,
    ) {
        let limits = Limits::of(self, distance);
        let Centerline { u_px, v_px, stripe_start, flags, sigma_px, .. } = centerline;
        let along = match direction {
            StripeDirection::Horizontal => u_px,
            StripeDirection::Vertical => v_px,
        };
        // A further stripe begins again at the first lines: its shape is another one.
        let is_further = |at: &usize| *at > 0 && along[*at] < along[*at - 1];
        let starts = stripe_start.iter().map(|&at| at as usize).filter(is_further);
        let mut from = 0;
        for to in starts.chain([flags.len()]) {
            let stripe = from..to;
            self.judge_stripe(&limits, from, &mut flags[stripe.clone()], &mut sigma_px[stripe]);
            from = to;
        }
    }

    /// Judges the points of one stripe, the first of which has the index `first`.
    fn judge_stripe(&self, limits: &Limits, first: usize, flags: &mut [u8], sigma_px: &mut [f32]) {
        let num_pools = (flags.len() / POOL).max(1);
        for pool in 0..num_pools {
            let [from, to] = [pool, pool + 1].map(|pool| pool * flags.len() / num_pools);
            let sums = self.sums(limits, &flags[from..to], first + from);
            let mean = limits.mean(&sums);
            if mean.fits() && sums.fitting.iter().sum::<f32>() >= (to - from) as f32 {
                continue;
            }
            for at in from..to {
                limits.judge(&self.at(first + at), mean, &mut flags[at], &mut sigma_px[at]);
            }
        }
    }

    /// Adds up the points with these flags, the first of which has the index `from`.
    fn sums(&self, limits: &Limits, flags: &[u8], from: usize) -> Sums {
        let to = from + flags.len();
        let (flags, last_flags) = flags.as_chunks::<LANES>();
        let (bends, last_bends) = self.bend_px[from..to].as_chunks::<LANES>();
        let (widths, last_widths) = self.width_px[from..to].as_chunks::<LANES>();
        let (tops, last_tops) = self.top[from..to].as_chunks::<LANES>();
        let mut sums = Sums::default();
        for (((bends, widths), tops), flags) in bends.iter().zip(widths).zip(tops).zip(flags) {
            for lane in 0..LANES {
                let (bend_px, width_px, top) = (bends[lane], widths[lane], tops[lane]);
                sums.add(lane, limits, &PointShape { bend_px, width_px, top }, flags[lane]);
            }
        }
        for (lane, &flags) in last_flags.iter().enumerate() {
            let (bend_px, width_px, top) = (last_bends[lane], last_widths[lane], last_tops[lane]);
            sums.add(lane, limits, &PointShape { bend_px, width_px, top }, flags);
        }
        sums
    }

    fn at(&self, at: usize) -> PointShape {
        PointShape { bend_px: self.bend_px[at], width_px: self.width_px[at], top: self.top[at] }
    }
}

/// Sums over the points of a pool, every sixteenth point in the same lane: the compiler makes vectors of them. Points whose
/// shape is hidden do not count.
#[derive(Default)]
struct Sums {
    /// Each point's share is limited.
    bend_px: Lane,
    width_px: Lane,
    num_bent: Lane,
    /// By which tops are broader than a Gaussian's, without saturated ones; each point's share is limited.
    excess: Lane,
    num_tops: Lane,
    /// Points that fit by themselves.
    fitting: Lane,
}

impl Sums {
    #[inline(always)]
    fn add(&mut self, lane: usize, limits: &Limits, shape: &PointShape, flags: u8) {
        let &PointShape { bend_px, width_px, top } = shape;
        let most_px = limits.most_bend_px(width_px);
        let is_known = bend_px.abs() < f32::INFINITY && width_px < f32::INFINITY;
        let is_top = is_known && flags & flag::SATURATED == 0;
        let one_if = |is: bool| if is { 1.0 } else { 0.0 };
        let most_excess = limits.broadest() - GAUSSIAN_TOP;
        let excess = bounded(top - GAUSSIAN_TOP, -most_excess, most_excess);
        self.bend_px[lane] += if is_known { bounded(bend_px, -most_px, most_px) } else { 0.0 };
        self.width_px[lane] += if is_known { width_px } else { 0.0 };
        self.num_bent[lane] += one_if(is_known);
        self.excess[lane] += if is_top { excess } else { 0.0 };
        self.num_tops[lane] += one_if(is_top);
        self.fitting[lane] += one_if(limits.fits(shape));
    }
}

/// Excess of the mean shape of consecutive points over the limits, else 0.
#[derive(Clone, Copy, Debug, Default)]
struct PoolShape {
    /// Bend of the bisector, pixels.
    bend_px: f32,
    is_broad: bool,
}

impl PoolShape {
    const fn fits(self) -> bool {
        self.bend_px <= 0.0 && !self.is_broad
    }
}

/// Limits of a frame.
#[derive(Clone, Copy)]
struct Limits {
    /// Bends below this are noise, pixels.
    bend_noise_px: f32,
    /// Tops broader than a Gaussian's by less than this are noise.
    top_noise: f32,
    /// Points at this distance share no pixels.
    distance: f32,
}

impl Limits {
    fn of(shapes: &mut Shapes, distance: usize) -> Self {
        let Shapes { bend_px, top, differences, .. } = shapes;
        Self {
            bend_noise_px: SIGNIFICANT * scatter(bend_px, distance, differences),
            top_noise: SIGNIFICANT * scatter(top, distance, differences),
            distance: distance as f32,
        }
    }

    /// The largest bend of one point that fits, pixels.
    fn most_bend_px(&self, width_px: f32) -> f32 {
        self.bend_noise_px.max(STRAIGHT * width_px)
    }

    /// The broadest top of one point that fits.
    fn broadest(&self) -> f32 {
        GAUSSIAN_TOP + BROADEST.max(self.top_noise)
    }

    /// True if a point fits by itself, false where an edge is hidden.
    #[inline(always)]
    fn fits(&self, shape: &PointShape) -> bool {
        let &PointShape { bend_px, width_px, top } = shape;
        (bend_px.abs() <= self.most_bend_px(width_px))
            & (top <= self.broadest())
            & (top * width_px <= WIDEST_CLIPPED_PX)
    }

    /// Returns what the mean shape of points shows.
    fn mean(&self, sums: &Sums) -> PoolShape {
        let sum = |lanes: &Lane| lanes.iter().sum::<f32>();
        let [bend_px, width_px, num_bent] =
            [&sums.bend_px, &sums.width_px, &sums.num_bent].map(sum);
        let [excess, num_tops] = [&sums.excess, &sums.num_tops].map(sum);
        // Independent points among n are n / distance.
        let noise = |of_one: f32, num: f32| of_one * (self.distance / num).sqrt();
        let least_px = noise(self.bend_noise_px, num_bent)
            .max(POOL_STRAIGHT * width_px / num_bent)
            .max(POOL_STRAIGHT_PX);
        let bend_px = bend_px.abs() / num_bent;
        let least_excess = noise(self.top_noise, num_tops).max(BROADEST);
        PoolShape {
            // False without points.
            bend_px: if bend_px > least_px { bend_px } else { 0.0 },
            is_broad: excess / num_tops > least_excess,
        }
    }

    fn judge(&self, shape: &PointShape, pool: PoolShape, flags: &mut u8, sigma_px: &mut f32) {
        let &PointShape { bend_px, width_px, top } = shape;
        if self.fits(shape) && pool.fits() {
            return;
        }
        let most_px = self.most_bend_px(width_px);
        let has = |flag: u8, flags: u8| flags & flag != 0;
        let mut widen = |error_px: f32| {
            // An unknown width adds nothing.
            if error_px.is_finite() {
                *sigma_px = in_quadrature(*sigma_px, error_px);
            }
        };
        let own_px = if bend_px.abs() > most_px { bend_px.abs() } else { 0.0 };
        let bend = own_px.max(pool.bend_px);
        if bend > 0.0 {
            *flags |= flag::MISFIT;
            // The centre lies in the top.
            widen((ERROR_PER_BEND * bend).min(top * width_px));
        }
        if bend_px.is_nan() && has(flag::MULTIPLE_PEAKS, *flags) {
            widen(ERROR_BESIDE_NEIGHBOUR * width_px);
        }
        let known = flag::CLIPPED | flag::MULTIPLE_PEAKS | flag::LOW_CONTRAST;
        let is_hidden = bend_px.is_nan() && !has(known, *flags);
        let is_broad = if has(flag::SATURATED, *flags) {
            top * width_px > WIDEST_CLIPPED_PX
        } else {
            top > self.broadest() || pool.is_broad
        };
        if is_hidden || is_broad {
            *flags |= flag::MISFIT;
            widen(ERROR_PER_WIDTH * width_px);
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
