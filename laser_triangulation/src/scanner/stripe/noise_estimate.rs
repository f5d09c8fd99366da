//! The camera's noise, from the frame itself: a photon transfer curve.
//!
//! The light changes slowly along the stripe, so second differences a - 2b + c of three neighbouring samples show
//! noise, with six times a sample's variance. They are classified by the mean of the three samples, which does not
//! depend on the difference. In each class the median of the absolute differences, 0.6745 standard deviations for
//! normal noise, is robust against edges and dirt. A straight line through variance over level gives read noise and
//! shot gain (Janesick 2007, Photon Transfer, chapter 5; EMVA 1288, section 6).
//!
//! Texture and speckle along the stripe count as noise, because they move the centre too. A stripe that runs steeply
//! through its columns also counts; up to a slope of about a quarter the effect is small.

use super::{
    blur::Sample,
    picture::Picture,
    section::{LineCandidate, Noise},
};
use crate::statistics::NORMAL_MEDIAN_MAGNITUDE;

/// Classes of levels.
const CLASSES: usize = 16;
/// Cells of a class's histogram: 16 of one level each, then 8 an octave up to 2¹⁸.
const CELLS: usize = 16 + 8 * 14;
/// Approximate number of triples evaluated per frame.
const TRIPLES: u32 = 32_768;
/// Positions of background evaluated on either side of the stripe.
const MARGIN: u32 = 8;
/// Maximum positions per line.
const MOST_POSITIONS: usize = 96;
/// A class with fewer triples is ignored.
const CLASS_LEAST: u32 = 64;
/// Variance of a second difference, in variances of a sample.
const DIFFERENCE_GAIN: f64 = 6.0;
/// Rounding to integers.
const ROUNDING: f64 = 1.0 / 12.0;

/// Estimates noise frame after frame.
#[derive(Clone, Debug)]
pub(super) struct NoiseEstimator {
    classes: Box<[Class; CLASSES]>,
}

/// Second differences of samples of about one level.
#[derive(Clone, Copy, Debug)]
struct Class {
    cells: [u32; CELLS],
    count: u32,
    /// Triples with a clipped sample.
    clipped: u32,
    /// Σ of the triples' mean levels, times three.
    level: u64,
}

/// A straight line through variance over level, sample units.
struct Line {
    /// Variance without light.
    constant: f64,
    /// Increase of the variance per level.
    per_level: f64,
}

impl Default for NoiseEstimator {
    fn default() -> Self {
        Self { classes: Box::new([Class::EMPTY; CLASSES]) }
    }
}

impl NoiseEstimator {
    /// Replaces the stated noise by an estimate from the samples about these candidates. The stated noise stays if no
    /// class of levels has 64 triples (a short stripe, or all of it clipped).
    pub(super) fn estimate<S: Sample>(
        &mut self,
        picture: &Picture<'_, S>,
        found: &[LineCandidate],
        full_scale: u32,
        noise: &mut Noise<'_>,
    ) {
        self.classes.fill(Class::EMPTY);
        let positions: u64 = found.iter().map(|found| reach(found, usize::MAX).len() as u64).sum();
        let step = (positions / u64::from(TRIPLES)) as usize + 1;
        let (lines, length) = picture.size();
        for found in found.iter().step_by(step) {
            let line = found.line as usize;
            if line == 0 || line + 1 >= lines {
                continue;
            }
            for position in reach(found, length) {
                let three = [line - 1, line, line + 1]
                    .map(|line| picture.at(line as isize, position as isize) as u32);
                self.add(three, full_scale);
            }
        }
        if let Some(Line { constant, per_level }) = self.line() {
            noise.constant = constant;
            noise.per_level = per_level;
        }
    }

    fn add(&mut self, three: [u32; 3], full_scale: u32) {
        let [a, b, c] = three;
        let sum = a + b + c;
        let class = (u64::from(sum) * CLASSES as u64 / (3 * u64::from(full_scale) + 1)) as usize;
        let class = &mut self.classes[class.min(CLASSES - 1)];
        if three.iter().any(|&sample| sample == 0 || sample >= full_scale) {
            class.clipped += 1;
            return;
        }
        class.count += 1;
        class.level += u64::from(sum);
        class.cells[cell((a + c).abs_diff(2 * b)).min(CELLS - 1)] += 1;
    }

    /// Fits variance over level by weighted least squares, neither parameter below its physical minimum.
    fn line(&self) -> Option<Line> {
        // Σ w, Σ wL, Σ wL², Σ wV, Σ wLV
        let mut sums = [0.0; 5];
        for class in self.classes.iter().filter(|class| class.is_sound()) {
            let level = class.level as f64 / 3.0 / f64::from(class.count);
            let variance = class.variance();
            // The uncertainty of a variance is proportional to it.
            let weight = f64::from(class.count) / variance.powi(2);
            let terms = [1.0, level, level * level, variance, level * variance];
            for (sum, term) in sums.iter_mut().zip(terms) {
                *sum += weight * term;
            }
        }
        let [w, l, ll, v, lv] = sums;
        if w == 0.0 {
            return None;
        }
        let spread = w * ll - l * l;
        let per_level = if spread > 1e-9 * w * ll { (w * lv - l * v) / spread } else { 0.0 };
        if per_level <= 0.0 {
            return Some(Line { constant: (v / w).max(ROUNDING), per_level: 0.0 });
        }
        let constant = (v - per_level * l) / w;
        if constant < ROUNDING {
            let per_level = ((lv - ROUNDING * l) / ll).max(0.0);
            return Some(Line { constant: ROUNDING, per_level });
        }
        Some(Line { constant, per_level })
    }
}

/// Returns the evaluated positions of a candidate's line.
fn reach(found: &LineCandidate, length: usize) -> std::ops::Range<usize> {
    let candidate = &found.candidate;
    let from = candidate.first.saturating_sub(MARGIN) as usize;
    from..((candidate.last + MARGIN) as usize + 1).min(length).min(from + MOST_POSITIONS)
}

impl Class {
    const EMPTY: Self = Self { cells: [0; CELLS], count: 0, clipped: 0, level: 0 };

    /// True if there are enough samples and clipping has not limited their spread.
    const fn is_sound(&self) -> bool {
        self.count >= CLASS_LEAST && self.clipped * 50 < self.count
    }

    /// Returns the variance of one sample, from the median of the absolute differences; values are assumed uniform
    /// within a cell.
    fn variance(&self) -> f64 {
        let half = f64::from(self.count) / 2.0;
        let mut below = 0.0;
        for (cell, &count) in self.cells.iter().enumerate() {
            let count = f64::from(count);
            if below + count >= half {
                let (from, to) = (edge(cell), edge(cell + 1));
                let median = from + (to - from) * (half - below) / count.max(1.0);
                return ((median / NORMAL_MEDIAN_MAGNITUDE).powi(2) / DIFFERENCE_GAIN)
                    .max(ROUNDING);
            }
            below += count;
        }
        ROUNDING
    }
}

/// Returns the cell of an absolute difference.
const fn cell(difference: u32) -> usize {
    if difference < 16 {
        return difference as usize;
    }
    let octave = difference.ilog2();
    let eighth = (difference >> (octave - 3)) & 7;
    16 + 8 * (octave as usize - 4) + eighth as usize
}

/// Returns the lower edge of a cell. Differences are integers; each represents half a level to either side.
fn edge(cell: usize) -> f64 {
    let lowest = match cell.checked_sub(16) {
        None => cell as f64,
        Some(above) => ((8 + above % 8) as f64) * f64::from(1_u32 << (above / 8 + 1)),
    };
    (lowest - 0.5).max(0.0)
}
