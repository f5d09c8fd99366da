//! Steps 6 to 8: the width of the stripe, the window it sets, and the grey-level centre of gravity in that window.

use super::{
    blur::UNITS,
    section::{Centre, Noise, Section},
};

/// Rounds of re-centring after which a window that does not stand still is left where it is.
const MAX_ROUNDS: u32 = 20;
/// A window that moves by less stands still, pixels.
const STANDSTILL_PX: f64 = 1e-4;

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
/// Locks the result to pixels (the project's accuracy tests show by how much); `window: fractional` does not.
pub fn rounded_window_gravity(
    section: &Section<'_>,
    coarse: &Centre,
    half_length_px: f64,
    noise: &Noise,
) -> Centre {
    let reach = half_length_px.round().max(1.0) + 0.5;
    let middle = coarse.position_px.round();
    let sums = WindowSums::of(section, middle - reach, middle + reach);
    Centre { position_px: sums.centroid(), sigma_px: sums.sigma(noise) }
}

/// Step 8 with a window whose ends may lie anywhere, centred on its own result until it stands still.
///
/// The window covers `2L + 1` pixels, as the rounded one does. A pixel that an end cuts counts with the part inside,
/// the grey level along it interpolated linearly.
pub fn fractional_window_gravity(
    section: &Section<'_>,
    coarse: &Centre,
    half_length_px: f64,
    noise: &Noise,
) -> Centre {
    let reach = half_length_px.max(1.0) + 0.5;
    let (first, last) = (f64::from(section.candidate.first), f64::from(section.candidate.last));
    let mut centre = coarse.position_px;
    for _ in 0..MAX_ROUNDS {
        let next =
            WindowSums::of(section, centre - reach, centre + reach).centroid().clamp(first, last);
        let moved = (next - centre).abs();
        centre = next;
        if moved < STANDSTILL_PX {
            break;
        }
    }
    let sums = WindowSums::of(section, centre - reach, centre + reach);
    // c = f(c) at rest, so noise that moves f by δ moves c by δ / (1 - f'(c)), and f'(c) is what the ends contribute.
    let pull = (reach * sums.edge_levels / sums.level).min(0.95);
    Centre { position_px: centre, sigma_px: sums.sigma(noise) / (1.0 - pull) }
}

/// Formula 7 over the whole candidate: the plain grey-level centre of gravity.
pub fn gray_gravity(section: &Section<'_>, noise: &Noise) -> Centre {
    let sums = WindowSums::of(
        section,
        f64::from(section.candidate.first) - 0.5,
        f64::from(section.candidate.last) + 0.5,
    );
    Centre { position_px: sums.centroid(), sigma_px: sums.sigma(noise) }
}

/// Σ G, Σ i·G and what else a centroid needs, over a window with ends between pixels. Pixel i covers [i - ½, i + ½].
struct WindowSums {
    level: f64,
    moment: f64,
    second: f64,
    /// Σ G·(i - middle)², for shot noise.
    weighted_second: f64,
    /// Grey levels at the two ends, added.
    edge_levels: f64,
    /// What `moment` is relative to.
    middle: f64,
}

impl WindowSums {
    /// Formula 7's sums between two positions; what lies beyond the section's samples is left out.
    fn of(section: &Section<'_>, low: f64, high: f64) -> Self {
        let origin = f64::from(section.origin);
        let (low, high) =
            (low.max(origin - 0.5), high.min(origin + section.samples.len() as f64 - 0.5));
        let level = |i: usize| f64::from(section.samples[i]) / f64::from(UNITS);
        let index = |position: f64| {
            ((position - origin + 0.5).floor().max(0.0) as usize).min(section.samples.len() - 1)
        };
        let (from, to) = (index(low), index(high));
        let middle = f64::midpoint(low, high);
        let mut sums = Self {
            level: 0.0,
            moment: 0.0,
            second: 0.0,
            weighted_second: 0.0,
            edge_levels: 0.0,
            middle,
        };
        for i in from..=to {
            let pixel = origin + i as f64;
            let (start, end) = (low.max(pixel - 0.5), high.min(pixel + 0.5));
            let part = end - start;
            let at = f64::midpoint(start, end);
            // Within a cut pixel the grey level is that of its covered part.
            let grey =
                if part < 1.0 { interpolate(section.samples, at - origin) } else { level(i) };
            let distance = at - middle;
            sums.level += grey * part;
            sums.moment += grey * part * distance;
            sums.second += part * distance * distance;
            sums.weighted_second += part * grey * distance * distance;
        }
        sums.edge_levels = interpolate(section.samples, low - origin)
            + interpolate(section.samples, high - origin);
        sums
    }

    fn centroid(&self) -> f64 {
        self.middle + self.moment / self.level
    }

    /// Σ (i - c)² var(G) / (Σ G)²
    fn sigma(&self, noise: &Noise) -> f64 {
        (noise.constant * self.second + noise.per_level * self.weighted_second).sqrt() / self.level
    }
}

/// Grey level at a place between samples, linear; beyond the ends the nearest sample.
fn interpolate(samples: &[u32], at: f64) -> f64 {
    let at = at.clamp(0.0, (samples.len() - 1) as f64);
    let left = at.floor() as usize;
    let right = (left + 1).min(samples.len() - 1);
    let share = at - left as f64;
    (f64::from(samples[left]) * (1.0 - share) + f64::from(samples[right]) * share)
        / f64::from(UNITS)
}
