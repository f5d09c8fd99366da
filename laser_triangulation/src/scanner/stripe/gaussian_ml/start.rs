//! The first guess, and the rows that take part in the fit.

use super::{
    super::{
        elementary::{bounded, exp},
        lanes::{LANES, Lane, Sections, each},
        logarithm::ln,
        noise::PixelNoise,
        parabola::{NormalSums, Parabola},
    },
    curve::Curve,
};

/// Rows farther out than this many standard deviations of the stripe plus this many rows are left out: they carry no
/// information about the centre.
const REACH: (f32, f32) = (3.3, 1.0);
/// The same for a saturated stripe, whose flanks reach farther.
const SATURATED_REACH: (f32, f32) = (4.2, 2.0);
/// The narrowest and the widest stripe, standard deviation in pixels.
pub(in super::super) const SIGMA_RANGE_PX: (f32, f32) = (0.45, 64.0);

/// Maximum brightness of a stripe, in multiples of full scale.
const MOST: f32 = 50.0;
const LN_MOST: f32 = 3.912_023;

/// A first guess, and the rows about it that contain only this stripe.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Start {
    /// The guess.
    pub(crate) curve: Curve,
    /// First row.
    pub(crate) from: Lane,
    /// Row behind the last one.
    pub(crate) to: Lane,
}

impl Start {
    /// Fits a parabola through the logarithms of the candidate's blurred samples. If some samples are saturated it uses
    /// the unsaturated raw ones, because the blur distorts the flanks of a flat top.
    #[inline(always)]
    pub(in super::super) fn of(sections: &Sections, noise: PixelNoise, full_scale: f32) -> Self {
        let (from, to) = own_rows(sections, noise);
        let floor = Floor::of(sections, &from, &to, full_scale);
        let sums = Sums::of(sections, &floor, full_scale);
        let mut start = Self { curve: Curve::default(), from, to };
        for lane in 0..LANES {
            let saturated = floor.brightest[lane] >= full_scale;
            let base = if saturated { floor.raw[lane] } else { floor.blurred[lane] };
            let peak = if saturated { full_scale } else { sections.peak[lane] } - base;
            let length = sections.last[lane] - sections.first[lane] + 1.0;
            let fit = sums.fit(lane, peak.max(1.0), full_scale, length);
            let (low, high) = SIGMA_RANGE_PX;
            let blur_px2 = if saturated { 0.0 } else { noise.blur_variance_px2 };
            let variance_px2 = fit.sigma_px * fit.sigma_px - blur_px2;
            let sigma_px = bounded(variance_px2, low * low, high * high).sqrt();
            // The blur preserves the area.
            let lost = if saturated { 1.0 } else { (fit.sigma_px / sigma_px).min(4.0) };
            start.curve.amplitude[lane] =
                (fit.amplitude * lost.max(1.0)).max(noise.constant.sqrt());
            start.curve.centre_px[lane] = bounded(fit.centre_px, -0.5, length - 0.5);
            start.curve.sigma_px[lane] = sigma_px;
            start.curve.background[lane] =
                if saturated { floor.raw[lane] } else { floor.blurred[lane] + floor.offset[lane] };
            let (sigmas, more) = if saturated { SATURATED_REACH } else { REACH };
            let reach = sigmas * sigma_px + more;
            let middle = sections.first[lane] + fit.centre_px;
            start.from[lane] = from[lane].max((middle - reach).floor());
            start.to[lane] = to[lane].min((middle + reach).ceil() + 1.0);
        }
        start
    }

    /// True if row `i` takes part.
    #[inline(always)]
    pub(in super::super) fn holds(&self, i: f32, lane: usize) -> bool {
        (i >= self.from[lane]) & (i < self.to[lane])
    }

    /// Returns the rows that take part in any lane.
    #[inline(always)]
    pub(in super::super) fn rows(&self, sections: &Sections) -> std::ops::Range<usize> {
        let used = 0..sections.count;
        let from = used.clone().map(|lane| self.from[lane]).fold(f32::MAX, f32::min);
        let to = used.map(|lane| self.to[lane]).fold(0.0, f32::max);
        (from.max(0.0) as usize).min(sections.rows())..(to as usize).min(sections.rows())
    }
}

/// Returns each lane's rows without a neighbour: from the candidate outwards, up to the lowest sample before the
/// blurred cross-section rises again by more than noise.
#[inline(always)]
fn own_rows(sections: &Sections, noise: PixelNoise) -> (Lane, Lane) {
    let rise: Lane = each(|lane| 0.12 * sections.peak[lane] + noise.constant.sqrt());
    let rows = sections.rows();
    let above = valley(sections, &rise, 0..rows, |i, lane| {
        (i > sections.last[lane]) & (i < sections.end[lane])
    });
    let below = valley(sections, &rise, (0..rows).rev(), |i, lane| {
        (i < sections.first[lane]) & (i >= sections.start[lane])
    });
    let from = |lane: usize| if below[lane] < 0.0 { sections.start[lane] } else { below[lane] };
    let to = |lane: usize| if above[lane] < 0.0 { sections.end[lane] } else { above[lane] + 1.0 };
    (each(from), each(to))
}

/// Returns the lowest row before a rise, among those outside the candidate in the order given; -1 if there is no rise.
#[inline(always)]
fn valley(
    sections: &Sections,
    rise: &Lane,
    rows: impl Iterator<Item = usize>,
    is_outside: impl Fn(f32, usize) -> bool,
) -> Lane {
    let mut lowest = [f32::MAX; LANES];
    let mut at = [-1.0; LANES];
    let mut cut = [-1.0; LANES];
    for i in rows {
        let row = sections.blurred[i];
        for lane in 0..LANES {
            let counts = is_outside(i as f32, lane) & (cut[lane] < 0.0);
            let is_lower = counts & (row[lane] < lowest[lane]);
            lowest[lane] = if is_lower { row[lane] } else { lowest[lane] };
            at[lane] = if is_lower { i as f32 } else { at[lane] };
            let rises = counts & (row[lane] > lowest[lane] + rise[lane]);
            cut[lane] = if rises { at[lane] } else { cut[lane] };
        }
    }
    cut
}

/// Background levels under the stripe.
struct Floor {
    /// Lowest raw and lowest blurred sample.
    raw: Lane,
    blurred: Lane,
    /// Mean of raw minus blurred samples: the background that was subtracted.
    offset: Lane,
    /// Largest raw sample of the candidate and of one row on either side.
    brightest: Lane,
}

impl Floor {
    #[inline(always)]
    fn of(sections: &Sections, from: &Lane, to: &Lane, full_scale: f32) -> Self {
        let (mut raw, mut blurred) = ([full_scale; LANES], [full_scale; LANES]);
        let (mut offset, mut rows): (Lane, Lane) = ([0.0; LANES], [0.0; LANES]);
        let mut brightest: Lane = [0.0; LANES];
        for i in 0..sections.rows() {
            let at = i as f32;
            let (raw_row, blurred_row) = (sections.raw[i], sections.blurred[i]);
            for lane in 0..LANES {
                let holds = (at >= from[lane]) & (at < to[lane]);
                let (r, b) = (raw_row[lane], blurred_row[lane]);
                raw[lane] = if holds { raw[lane].min(r) } else { raw[lane] };
                blurred[lane] = if holds { blurred[lane].min(b) } else { blurred[lane] };
                offset[lane] += if holds { r - b } else { 0.0 };
                rows[lane] += if holds { 1.0 } else { 0.0 };
                let near = (at >= sections.first[lane] - 1.0) & (at <= sections.last[lane] + 1.0);
                // Beyond the window are leftovers of other lanes or batches.
                let near = near & holds;
                brightest[lane] = if near { brightest[lane].max(r) } else { brightest[lane] };
            }
        }
        for lane in 0..LANES {
            offset[lane] /= rows[lane].max(1.0);
        }
        Self { raw, blurred, offset, brightest }
    }
}

/// Sums of the normal equations: weights w = y², logarithms relative to full scale, places from the candidate's middle.
struct Sums {
    parabola: NormalSums,
    /// Σ y and Σ x y.
    level: Lane,
    moment: Lane,
    middle: Lane,
}

/// A Gaussian through the samples.
struct Guess {
    amplitude: f32,
    centre_px: f32,
    sigma_px: f32,
}

impl Sums {
    #[inline(always)]
    fn of(sections: &Sections, floor: &Floor, full_scale: f32) -> Self {
        let none = [0.0; LANES];
        let mut sums = Self {
            parabola: NormalSums::default(),
            level: none,
            moment: none,
            middle: each(|lane| 0.5 * (sections.last[lane] - sections.first[lane])),
        };
        let base: Lane = each(|lane| {
            if floor.brightest[lane] >= full_scale { floor.raw[lane] } else { floor.blurred[lane] }
        });
        let faintest: Lane = each(|lane| 0.2 * (sections.peak[lane] - base[lane]));
        for i in 0..sections.rows() {
            let place = sections.place(i);
            let (raw_row, blurred_row) = (sections.raw[i], sections.blurred[i]);
            for lane in 0..LANES {
                let x = place[lane];
                let is_flat = floor.brightest[lane] >= full_scale;
                let margin = if is_flat { 2.0 } else { 0.0 };
                let last = sections.last[lane] - sections.first[lane];
                let at = i as f32;
                let holds = (at >= sections.start[lane]) & (at < sections.end[lane]);
                let near = holds & (x >= -margin) & (x <= last + margin);
                let raw = raw_row[lane];
                let y = if is_flat { raw } else { blurred_row[lane] } - base[lane];
                let counts = near & (y > faintest[lane]) & (y > 0.0);
                let summed = if counts { y } else { 0.0 };
                sums.level[lane] += summed;
                sums.moment[lane] += summed * (x - sums.middle[lane]);
                let counts = counts & !(is_flat & (raw > 0.98 * full_scale));
                let relative = if counts { y / full_scale } else { 1.0 };
                let weight = if counts { relative * relative } else { 0.0 };
                let logarithm = ln(relative);
                let t = x - sums.middle[lane];
                sums.parabola.add(lane, weight, t, logarithm);
            }
        }
        sums
    }
}

impl Sums {
    /// Returns the parabola's Gaussian. If the parabola opens upwards, or its maximum lies far from the centroid,
    /// returns the centroid and the width of a Gaussian with the same area.
    #[inline(always)]
    fn fit(&self, lane: usize, peak: f32, full_scale: f32, length: f32) -> Guess {
        let Parabola { constant, slope, curvature, .. } = self.parabola.solve(lane);
        let middle = self.middle[lane];
        let at = -0.5 * slope / curvature;
        let (level, moment) = (self.level[lane], self.moment[lane]);
        let centroid = if level > 0.0 { moment / level } else { 0.0 };
        // Also false for too few samples: all values here are then NaN.
        let is_peak = (curvature < -1e-4) & ((at - centroid).abs() <= 0.2 * length + 0.5);
        let logarithm = (constant + 0.5 * slope * at).min(LN_MOST);
        let height = (MOST * full_scale * exp(logarithm - LN_MOST)).max(peak);
        let area_px = level / peak / std::f32::consts::TAU.sqrt();
        let width_px = (-0.5 / curvature).sqrt();
        Guess {
            amplitude: if is_peak { height } else { peak },
            centre_px: middle + if is_peak { at } else { bounded(centroid, -middle, middle) },
            sigma_px: if is_peak { width_px } else { area_px.min(length) },
        }
    }
}
