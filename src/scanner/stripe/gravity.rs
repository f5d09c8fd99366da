//! Steps 6 to 8 as Yao et al. 2023 have them: the width, the window it sets, and the grey-level centre of gravity in
//! whole pixels.

use super::section::{Centre, Noise, Section, grey};

/// Step 6: the width D, the number of the candidate's samples above the width threshold.
pub fn width_samples(section: &Section<'_>, width_threshold: u32) -> u32 {
    section.run().iter().filter(|&&sample| sample > width_threshold).count() as u32
}

/// Step 7: how far the window reaches to either side of its centre, L = 2D/3, pixels.
pub fn window_half_length_px(width_samples: u32) -> f64 {
    2.0 * f64::from(width_samples) / 3.0
}

/// Step 8 with the window as printed in the paper: the coarse peak rounded to a pixel, L rounded, but at least 1.
///
/// In the paper's example a coarse peak at 1165.115 is taken as 1165, and D = 7 makes L = 14/3 = 4.67, which it prints
/// "rounded to 4"; the nearest is 5, and that is taken here. Locks the result to pixels (`rounded_window_locks_to_pixels`
/// shows by how much); `window: fractional` does not.
pub fn rounded_window_gravity(
    section: &Section<'_>,
    coarse_px: f64,
    half_length_px: f64,
    noise: &Noise<'_>,
) -> Centre {
    let reach = half_length_px.round().max(1.0) as usize;
    let middle = coarse_px.round() as usize - section.origin as usize;
    gravity(
        section,
        middle.saturating_sub(reach),
        (middle + reach + 1).min(section.samples.len()),
        noise,
    )
}

/// Formula 7 over the whole candidate: the plain grey-level centre of gravity.
pub fn gray_gravity(section: &Section<'_>, noise: &Noise<'_>) -> Centre {
    let from = (section.candidate.first - section.origin) as usize;
    gravity(section, from, from + section.candidate.length() as usize, noise)
}

/// Formula 7, Σ i·G / Σ G, over the section's samples `from..to`.
fn gravity(section: &Section<'_>, from: usize, to: usize, noise: &Noise<'_>) -> Centre {
    let (mut level, mut moment) = (0.0, 0.0);
    for (k, &sample) in section.samples[from..to].iter().enumerate() {
        level += grey(sample);
        moment += k as f64 * grey(sample);
    }
    Centre {
        position_px: f64::from(section.origin) + from as f64 + moment / level,
        sigma_px: noise.ramp_sigma((to - from) as f64, level) / level,
    }
}
