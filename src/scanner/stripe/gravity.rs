//! Steps 6 to 8: the width of the stripe, the window it sets, and the grey-level centre of gravity in that window.

use super::{
    blur::UNITS,
    section::{Centre, Noise, Section},
};

/// Rounds of re-centring after which a window that does not stand still is left where it is.
const MAX_ROUNDS: u32 = 12;
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
    coarse_px: f64,
    half_length_px: f64,
    noise: &Noise,
) -> Centre {
    let reach = half_length_px.round().max(1.0) + 0.5;
    let middle = coarse_px.round();
    let sums = WindowSums::of(section, middle - reach, middle + reach);
    Centre { position_px: sums.centroid(), sigma_px: sums.sigma(noise) }
}

/// Step 8 with a window whose ends may lie anywhere, centred on its own result.
///
/// The window covers `2L + 1` pixels, as the rounded one does. A pixel that an end cuts counts with the part inside,
/// at the grey level of that part's middle, interpolated linearly.
pub fn fractional_window_gravity(
    section: &Section<'_>,
    coarse_px: f64,
    half_length_px: f64,
    noise: &Noise,
) -> Centre {
    let reach = half_length_px.max(1.0) + 0.5;
    let (first, last) = (f64::from(section.candidate.first), f64::from(section.candidate.last));
    let mut centre = Centre { position_px: coarse_px, sigma_px: 0.0 };
    let mut whole = WholePixels::default();
    for _ in 0..MAX_ROUNDS {
        let (low, high) = (centre.position_px - reach, centre.position_px + reach);
        let sums = WindowSums::moved(section, low, high, whole);
        whole = sums.whole;
        // The centroid f(c) of a window about c moves by f'(c) when the window moves: by what its ends take in.
        let pull = (reach * (grey_at(section, low) + grey_at(section, high)) / sums.level).min(0.9);
        // Newton's step towards c = f(c). Noise that moves f by δ moves that c by δ / (1 - f').
        let step = (sums.centroid() - centre.position_px) / (1.0 - pull);
        let next = (centre.position_px + step).clamp(first, last);
        let moved = (next - centre.position_px).abs();
        centre = Centre { position_px: next, sigma_px: sums.sigma(noise) / (1.0 - pull) };
        if moved < STANDSTILL_PX {
            break;
        }
    }
    centre
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

/// Σ G, Σ i·G over a window with ends between pixels. Pixel i covers [i - ½, i + ½].
struct WindowSums<'a> {
    section: &'a Section<'a>,
    /// The ends, cut to what the section holds.
    low: f64,
    high: f64,
    level: f64,
    /// Σ i·G, i relative to the middle of the window.
    moment: f64,
    whole: WholePixels,
}

/// Σ G and Σ i·G over the samples `from..to`, i relative to `from`: what stays when a window moves a little.
#[derive(Clone, Copy, Default)]
struct WholePixels {
    from: usize,
    to: usize,
    level: f64,
    moment: f64,
}

impl WholePixels {
    fn of(samples: &[u32], from: usize, to: usize) -> Self {
        let (mut level, mut moment) = (0.0, 0.0);
        for (k, &sample) in samples[from..to].iter().enumerate() {
            level += grey(sample);
            moment += k as f64 * grey(sample);
        }
        Self { from, to, level, moment }
    }
}

impl<'a> WindowSums<'a> {
    /// Formula 7's sums between two positions: the whole pixels, then the two that the ends cut.
    fn of(section: &'a Section<'a>, low: f64, high: f64) -> Self {
        Self::moved(section, low, high, WholePixels::default())
    }

    /// The same; `whole` are the whole pixels of a window nearby.
    fn moved(section: &'a Section<'a>, low: f64, high: f64, whole: WholePixels) -> Self {
        let samples = section.samples;
        let origin = f64::from(section.origin);
        let (low, high) = (low.max(origin - 0.5), high.min(origin + samples.len() as f64 - 0.5));
        let middle = f64::midpoint(low, high);
        let index = |position: f64| ((position - origin + 0.5) as usize).min(samples.len() - 1);
        let (from, to) = (index(low), index(high));
        let mut sums = Self { section, low, high, level: 0.0, moment: 0.0, whole };
        if from == to {
            sums.add_cut(low, high, middle);
            return sums;
        }
        if (whole.from, whole.to) != (from + 1, to) {
            sums.whole = WholePixels::of(samples, from + 1, to);
        }
        let first_whole = origin + (from + 1) as f64;
        sums.level = sums.whole.level;
        sums.moment = sums.whole.moment + (first_whole - middle) * sums.whole.level;
        sums.add_cut(low, first_whole - 0.5, middle);
        sums.add_cut(origin + to as f64 - 0.5, high, middle);
        sums
    }

    /// A part of one pixel, at the grey level of its own middle.
    fn add_cut(&mut self, start: f64, end: f64, middle: f64) {
        let at = f64::midpoint(start, end);
        let level = (end - start) * grey_at(self.section, at);
        self.level += level;
        self.moment += level * (at - middle);
    }

    fn centroid(&self) -> f64 {
        f64::midpoint(self.low, self.high) + self.moment / self.level
    }

    /// Error propagation of formula 7: Σ (i - c)² var(G) / (Σ G)².
    fn sigma(&self, noise: &Noise) -> f64 {
        let length = self.high - self.low;
        // Σ (i - c)² over the pixels of a window of that length.
        let squares = ((length.powi(3) - length) / 12.0).max(0.0);
        let mut variance = noise.constant * squares;
        if noise.per_level > 0.0 {
            variance += noise.per_level * self.spread();
        }
        variance.sqrt() / self.level
    }

    /// Σ (i - c)² G over the whole pixels of the window.
    fn spread(&self) -> f64 {
        let origin = f64::from(self.section.origin);
        let centre = self.centroid();
        let from = (self.low - origin + 0.5) as usize;
        let to = ((self.high - origin + 0.5) as usize).min(self.section.samples.len());
        let terms = self.section.samples[from..to].iter().enumerate();
        terms.map(|(i, &sample)| (origin + (from + i) as f64 - centre).powi(2) * grey(sample)).sum()
    }
}

/// Grey level at a place between samples, linear; beyond the ends the nearest sample.
fn grey_at(section: &Section<'_>, position: f64) -> f64 {
    let samples = section.samples;
    let at = (position - f64::from(section.origin)).clamp(0.0, (samples.len() - 1) as f64);
    let left = at as usize;
    let right = (left + 1).min(samples.len() - 1);
    let share = at - left as f64;
    (f64::from(samples[left]) * (1.0 - share) + f64::from(samples[right]) * share)
        / f64::from(UNITS)
}

fn grey(sample: u32) -> f64 {
    f64::from(sample) / f64::from(UNITS)
}
