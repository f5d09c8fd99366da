//! Step 8 without rounding: a window whose ends may lie anywhere, centred on its own result.
//!
//! The paper rounds the window to pixels, which pulls the result to pixels. Here the blurred cross-section is a curve,
//! its samples joined by straight lines; the window `[c - R, c + R]` cuts that curve where it will, and c is the place
//! at which the window's centre of gravity is c itself.

use super::section::{Centre, Noise, Section, grey};

/// Rounds of re-centring after which a window that does not stand still is left where it is.
const MAX_ROUNDS: u32 = 12;
/// The window covers three pixels at least, as the rounded one does.
const MIN_REACH_PX: f64 = 1.5;
/// A window that moves by less stands still, pixels.
const STANDSTILL_PX: f64 = 1e-4;

/// Formula 7 as integrals, c = ∫ x·G dx / ∫ G dx over `[c - R, c + R]`: the centre of gravity of a window about itself,
/// which reaches R = L to either side of it. A border of the image cuts the window short.
pub fn fractional_window_gravity(
    section: &Section<'_>,
    coarse_px: f64,
    half_length_px: f64,
    noise: &Noise<'_>,
) -> Centre {
    let reach = half_length_px.max(MIN_REACH_PX);
    let origin = f64::from(section.origin);
    let first = f64::from(section.candidate.first) - origin;
    let last = f64::from(section.candidate.last) - origin;
    let end = (section.samples.len() - 1) as f64;
    let mut centre = (coarse_px - origin).clamp(first, last);
    let mut sigma_px = reach;
    let mut inner = Inner::default();
    for _ in 0..MAX_ROUNDS {
        let (low, high) = ((centre - reach).max(0.0), (centre + reach).min(end));
        let window = Integral::of(section.samples, low, high, &mut inner);
        if window.level <= 0.0 {
            break;
        }
        let centroid = window.moment / window.level;
        // The centroid f(c) of a window about c moves by f'(c) when the window moves: by what its ends take in. An end
        // that the border holds back takes in nothing.
        let low_pull = if low > 0.0 { window.low_level * (centroid - low) } else { 0.0 };
        let high_pull = if high < end { window.high_level * (high - centroid) } else { 0.0 };
        let pull = ((low_pull + high_pull) / window.level).min(0.9);
        // Newton's step towards c = f(c). Noise that moves f by δ moves that c by δ / (1 - f').
        let step = (centroid - centre) / (1.0 - pull);
        let next = (centre + step).clamp(first, last);
        let moved = (next - centre).abs();
        centre = next;
        sigma_px = noise.ramp_sigma(high - low, window.level) / window.level / (1.0 - pull);
        if moved < STANDSTILL_PX {
            break;
        }
    }
    Centre { position_px: origin + centre, sigma_px }
}

/// ∫ G and ∫ x·G of the curve between two places, and the curve's levels there.
struct Integral {
    level: f64,
    moment: f64,
    low_level: f64,
    high_level: f64,
}

/// The same between two samples; it stays when the window moves a little.
#[derive(Default)]
struct Inner {
    first: usize,
    last: usize,
    level: f64,
    moment: f64,
}

impl Inner {
    /// Every sample but the outermost two stands for a triangle two pixels wide, those for half of one.
    fn of(samples: &[u32], first: usize, last: usize) -> Self {
        let (mut level, mut moment) = (0.0, 0.0);
        for (k, &sample) in samples[first..=last].iter().enumerate() {
            level += grey(sample);
            moment += k as f64 * grey(sample);
        }
        let (start, end, length) =
            (grey(samples[first]), grey(samples[last]), (last - first) as f64);
        level -= 0.5 * (start + end);
        moment += start / 6.0 - end * (0.5 * length + 1.0 / 6.0);
        Self { first, last, level, moment: moment + first as f64 * level }
    }
}

impl Integral {
    /// Between `low` and `high`, places within the samples. `inner` remembers what lies between two samples.
    fn of(samples: &[u32], low: f64, high: f64, inner: &mut Inner) -> Self {
        let (first, last) = (low.ceil() as usize, high.floor() as usize);
        let (low_level, high_level) = (level_at(samples, low), level_at(samples, high));
        let mut integral = Self { level: 0.0, moment: 0.0, low_level, high_level };
        if first > last {
            integral.add_piece((low, low_level), (high, high_level));
            return integral;
        }
        if (inner.first, inner.last, inner.level > 0.0) != (first, last, true) {
            *inner = Inner::of(samples, first, last);
        }
        (integral.level, integral.moment) = (inner.level, inner.moment);
        integral.add_piece((low, low_level), (first as f64, grey(samples[first])));
        integral.add_piece((last as f64, grey(samples[last])), (high, high_level));
        integral
    }

    /// A straight piece of the curve from (place, level) to (place, level).
    fn add_piece(&mut self, (start, start_level): (f64, f64), (end, end_level): (f64, f64)) {
        let length = end - start;
        let area = 0.5 * (start_level + end_level) * length;
        self.level += area;
        self.moment += start * area + length * length * (start_level / 6.0 + end_level / 3.0);
    }
}

/// The curve's level at a place within the samples.
fn level_at(samples: &[u32], at: f64) -> f64 {
    let left = at as usize;
    let right = (left + 1).min(samples.len() - 1);
    let share = at - left as f64;
    grey(samples[left]) * (1.0 - share) + grey(samples[right]) * share
}
