//! Steps 6 to 8 as in Yao et al. 2023: the width, the window derived from it, and the grey-level centre of gravity in
//! whole pixels.

use super::{
    lanes::{Centres, LANES, Lane, Sections, each},
    section::Noise,
};

/// Step 6: returns the width D, the number of the candidate's samples above the width threshold, a grey level in sample
/// units.
#[inline(always)]
pub(super) fn width_samples(sections: &Sections, width_threshold: f32) -> Lane {
    let mut width = [0.0; LANES];
    let last = sections.last_place();
    for i in sections.candidate_rows() {
        let (place, level) = (sections.place(i), sections.blurred[i]);
        for lane in 0..LANES {
            let is_wide = (place[lane] >= 0.0)
                & (place[lane] <= last[lane])
                & (level[lane] > width_threshold);
            width[lane] += if is_wide { 1.0 } else { 0.0 };
        }
    }
    width
}

/// Step 7: returns the window's half length, L = 2D/3, pixels.
#[inline(always)]
pub(super) fn window_half_length_px(width_samples: &Lane) -> Lane {
    each(|lane| 2.0 * width_samples[lane] / 3.0)
}

/// Step 8 with the window as printed in the paper: the coarse peak rounded to a pixel; L rounded, but at least 1.
///
/// In the paper's example the coarse peak 1165.115 becomes 1165, and D = 7 gives L = 14/3 = 4.67, which the paper
/// prints as "rounded to 4". The nearest integer is 5, which is used here. Rounding locks the result to pixels
/// (`rounded_window_locks_to_pixels` shows by how much); `window: fractional` does not.
#[inline(always)]
pub(super) fn rounded_window_gravity(
    sections: &Sections,
    coarse_px: &Lane,
    half_length_px: &Lane,
    noise: &Noise<'_>,
) -> Centres {
    let reach = each(|lane| round(half_length_px[lane]).max(1.0));
    let middle = each(|lane| round(coarse_px[lane]));
    let from =
        each(|lane| (middle[lane] - reach[lane]).max(sections.start[lane] - sections.first[lane]));
    let to = each(|lane| {
        (middle[lane] + reach[lane]).min(sections.end[lane] - 1.0 - sections.first[lane])
    });
    gravity(sections, &from, &to, noise)
}

/// Formula 7 over the whole candidate: the plain grey-level centre of gravity.
#[inline(always)]
pub(super) fn gray_gravity(sections: &Sections, noise: &Noise<'_>) -> Centres {
    gravity(sections, &[0.0; LANES], &sections.last_place(), noise)
}

/// Formula 7, Σ i·G / Σ G, over the samples at the places `from..=to`.
#[inline(always)]
fn gravity(sections: &Sections, from: &Lane, to: &Lane, noise: &Noise<'_>) -> Centres {
    let (mut level, mut moment) = ([0.0; LANES], [0.0; LANES]);
    let row = |place: &Lane| each(|lane| sections.first[lane] + place[lane]);
    for i in sections.reach(&row(from), &row(to)) {
        let (place, sample) = (sections.place(i), sections.blurred[i]);
        for lane in 0..LANES {
            let is_inside = (place[lane] >= from[lane]) & (place[lane] <= to[lane]);
            let grey = if is_inside { sample[lane] } else { 0.0 };
            level[lane] += grey;
            moment[lane] += place[lane] * grey;
        }
    }
    let length = each(|lane| to[lane] - from[lane] + 1.0);
    let sigma = noise.ramp_sigmas(&length, &level);
    Centres {
        position_px: each(|lane| moment[lane] / level[lane]),
        sigma_px: each(|lane| sigma[lane] / level[lane]),
    }
}

/// Rounds a non-negative number to the nearest integer, half up.
#[inline(always)]
fn round(number: f32) -> f32 {
    (number + 0.5) as u32 as f32
}
