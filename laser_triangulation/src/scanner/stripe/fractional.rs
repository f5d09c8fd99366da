//! Step 8 without rounding: a window with fractional ends, centred on its own result.
//!
//! The paper rounds the window to pixels, which biases the result towards pixel centres. Here the blurred cross-section
//! is a curve, its samples joined by straight lines. The window `[c - R, c + R]` cuts that curve anywhere; c is the
//! position at which the window's centre of gravity is c itself.

use super::{
    lanes::{Centres, LANES, Lane, Sections, each},
    section::Noise,
};

/// Rounds of re-centring; a window still moving after these stays at its last position.
const MAX_ROUNDS: u32 = 12;
/// The window covers at least three pixels, as the rounded one does.
const MIN_REACH_PX: f32 = 1.5;
/// A window that moves by less than this has converged, pixels. Each of Newton's steps squares the error: after a step
/// of this length the error is a millionth of a pixel.
const STANDSTILL_PX: f32 = 4e-3;

/// Computes formula 7 as integrals, c = ∫ x·G dx / ∫ G dx over `[c - R, c + R]`: the centre of gravity of a window
/// about itself that reaches R = L to either side. The border of the image cuts the window short.
#[inline(always)]
pub(super) fn fractional_window_gravity(
    sections: &Sections,
    coarse_px: &Lane,
    half_length_px: &Lane,
    noise: &Noise<'_>,
) -> Centres {
    let reach = each(|lane| half_length_px[lane].max(MIN_REACH_PX));
    let start = each(|lane| sections.start[lane] - sections.first[lane]);
    let end = each(|lane| sections.end[lane] - 1.0 - sections.first[lane]);
    let last = sections.last_place();
    let mut centre = each(|lane| coarse_px[lane].max(0.0).min(last[lane]));
    let (mut length, mut level, mut slack) = ([0.0; LANES], [0.0; LANES], [1.0; LANES]);
    let mut moves = sections.in_use();
    for _ in 0..MAX_ROUNDS {
        let low = each(|lane| (centre[lane] - reach[lane]).max(start[lane]));
        let high = each(|lane| (centre[lane] + reach[lane]).min(end[lane]));
        let window = Integral::of(sections, &low, &high);
        let mut moved_px = [0.0; LANES];
        for lane in 0..LANES {
            let centroid = window.moment[lane] / window.level[lane];
            // When the window about c moves, its centroid f(c) changes by f'(c), from the light at the window's ends.
            // An end held back by the border contributes nothing.
            let low_pull = window.low_level[lane] * (centroid - low[lane]);
            let high_pull = window.high_level[lane] * (high[lane] - centroid);
            let pull = (if low[lane] > start[lane] { low_pull } else { 0.0 }
                + if high[lane] < end[lane] { high_pull } else { 0.0 })
                / window.level[lane];
            // Newton's step towards c = f(c). An error δ of f shifts that c by δ / (1 - f').
            let room = 1.0 - pull.min(0.9);
            let step = (centroid - centre[lane]) / room;
            let next = (centre[lane] + step).max(0.0).min(last[lane]);
            // A window that converged in an earlier round stays, whatever its neighbours do.
            let is_moving = (moves[lane] > 0.0) & (window.level[lane] > 0.0);
            moved_px[lane] = if is_moving { (next - centre[lane]).abs() } else { 0.0 };
            centre[lane] = if is_moving { next } else { centre[lane] };
            length[lane] = if is_moving { high[lane] - low[lane] } else { length[lane] };
            level[lane] = if is_moving { window.level[lane] } else { level[lane] };
            slack[lane] = if is_moving { room } else { slack[lane] };
        }
        moves = each(|lane| if moved_px[lane] < STANDSTILL_PX { 0.0 } else { 1.0 });
        if moves.iter().all(|&moves| moves <= 0.0) {
            break;
        }
    }
    let sigma = noise.ramp_sigmas(&length, &level);
    Centres {
        position_px: centre,
        sigma_px: each(|lane| {
            let is_known = level[lane] > 0.0;
            if is_known { sigma[lane] / level[lane] / slack[lane] } else { reach[lane] }
        }),
    }
}

/// ∫ G and ∫ x·G of the curve between two positions, and the curve's levels there.
struct Integral {
    level: Lane,
    moment: Lane,
    low_level: Lane,
    high_level: Lane,
}

impl Integral {
    /// Integrates between the positions `low` and `high` within the window.
    ///
    /// Samples joined by straight lines are the sum of one triangle per sample, G·(1 - |u|) for |u| ≤ 1, u pixels from
    /// it. Up to u that triangle contributes ∫ = u - u|u|/2 and ∫ u du = u²/2 - |u|³/3, up to a constant.
    #[inline(always)]
    fn of(sections: &Sections, low: &Lane, high: &Lane) -> Self {
        let none = [0.0; LANES];
        let mut sum = Self { level: none, moment: none, low_level: none, high_level: none };
        // Round down first: a sum that includes the candidate's row would round, and the set of cut rows would then
        // depend on the candidate's place in the batch.
        let from = each(|lane| sections.first[lane] + low[lane].floor());
        let to = each(|lane| sections.first[lane] + high[lane].floor() + 1.0);
        let whole = sections.within(
            &each(|lane| sections.first[lane] + low[lane].ceil() + 1.0),
            &each(|lane| to[lane] - 2.0),
        );
        let reached = sections.reach(&from, &to);
        let (before, behind) = if whole.is_empty() {
            // If both ends lie in one row, it is checked for both.
            for i in reached {
                sum.add_cut::<true, true>(sections, i, low, high);
            }
            return sum;
        } else {
            (reached.start..whole.start, whole.end..reached.end)
        };
        for i in before {
            sum.add_cut::<true, false>(sections, i, low, high);
        }
        // A lane's whole triangle: area 1, lever 0, and no level at an end.
        for i in whole {
            let (place, sample) = (sections.place(i), sections.blurred[i]);
            for lane in 0..LANES {
                sum.level[lane] += sample[lane];
                sum.moment[lane] += sample[lane] * place[lane];
            }
        }
        for i in behind {
            sum.add_cut::<false, true>(sections, i, low, high);
        }
        sum
    }

    /// Adds a row whose triangles the window may cut at its LOW or HIGH end. An end that cannot cut it is skipped,
    /// which changes no bit.
    #[inline(always)]
    fn add_cut<const LOW: bool, const HIGH: bool>(
        &mut self,
        sections: &Sections,
        i: usize,
        low: &Lane,
        high: &Lane,
    ) {
        let (place, sample) = (sections.place(i), sections.blurred[i]);
        for lane in 0..LANES {
            let x = place[lane];
            let is_inside = (!LOW | (x > low[lane] - 1.0)) & (!HIGH | (x < high[lane] + 1.0));
            let grey = if is_inside { sample[lane] } else { 0.0 };
            let a = if LOW { (low[lane] - x).clamp(-1.0, 1.0) } else { -1.0 };
            let b = if HIGH { (high[lane] - x).clamp(-1.0, 1.0) } else { 1.0 };
            let (a_size, b_size) = (a.abs(), b.abs());
            let area = (b - 0.5 * b * b_size) - (a - 0.5 * a * a_size);
            let lever = b * b * (0.5 - b_size / 3.0) - a * a * (0.5 - a_size / 3.0);
            self.level[lane] += grey * area;
            self.moment[lane] += grey * (x * area + lever);
            if LOW {
                self.low_level[lane] += grey * (1.0 - a_size);
            }
            if HIGH {
                self.high_level[lane] += grey * (1.0 - b_size);
            }
        }
    }
}
