//! One cross-section of the stripe and the quantities that all estimators share.
//!
//! Positions run across the stripe: rows for a horizontal stripe, columns for a vertical one, pixel centres at
//! integers, counted from the border of the searched region.

use super::{
    blur::{Kernel, UNITS},
    lanes::{Lane, MAX_ROWS, each},
    valley::ValleyNoise,
};
use crate::scanner::params::{ExtractionParams, GravityWindow, Method};
use std::ops::Range;

/// The run of stripe pixels that was chosen in a cross-section.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Candidate {
    /// First position above the segment threshold.
    pub(crate) first: u32,
    /// Last position above the segment threshold.
    pub(crate) last: u32,
    /// Largest blurred sample, blurred units.
    pub(crate) peak: u32,
    /// Number of candidates in this cross-section, this one included; 0: none was found.
    pub(crate) count: u32,
    /// Depth of the deepest valley between two maxima in it, below the lower one, blurred units; 0: one maximum.
    pub(crate) dip: u32,
    /// First position that its cross-section may hold; a neighbour lies before it.
    pub(crate) from: u32,
    /// Last position that its cross-section may hold; a neighbour lies beyond it.
    pub(crate) to: u32,
}

impl Candidate {
    /// Returns the only candidate of a cross-section, without neighbours.
    pub(super) const fn alone(first: u32, last: u32, peak: u32, dip: u32) -> Self {
        Self { first, last, peak, count: 1, dip, from: 0, to: u32::MAX }
    }

    /// Returns the part from one position to another, both counted from its first, whose cross-section reaches as far
    /// to either side again, but not beyond its neighbours.
    pub(super) fn part(&self, first: u32, last: u32) -> Self {
        let (first, last) = (self.first + first, self.first + last);
        let reach = (last - first) / 2 + 2;
        Self {
            first,
            last,
            from: first.saturating_sub(reach).max(self.from),
            to: last.saturating_add(reach).min(self.to),
            ..*self
        }
    }

    /// True if its cross-section ends where a neighbour begins.
    pub(super) const fn touches_neighbour(&self) -> bool {
        self.from > 0 || self.to < u32::MAX
    }

    /// Returns the number of samples above the segment threshold.
    pub(super) const fn length(&self) -> u32 {
        self.last - self.first + 1
    }

    /// True if it is too long for the cross-section of a stripe; estimators then skip it.
    pub(super) const fn is_broad(&self) -> bool {
        self.length() as usize > MAX_ROWS
    }

    /// Returns its positions and up to `margin` more on either side, within a cross-section of `length` positions.
    pub(super) fn reach(&self, margin: u32, length: usize) -> Range<usize> {
        let from = self.first.saturating_sub(margin).max(self.from) as usize;
        from..((self.last + margin).min(self.to) as usize + 1).min(length)
    }
}

/// A candidate and the cross-section in which it was found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct LineCandidate {
    /// Column of the searched region for a horizontal stripe, row for a vertical one.
    pub(crate) line: u32,
    /// The candidate in that line.
    pub(crate) candidate: Candidate,
}

/// The extraction's parameters in the units of the blurred samples of one image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Levels<'a> {
    /// Estimator.
    pub(crate) method: Method,
    /// Window of the improved gravity.
    pub(crate) window: GravityWindow,
    /// Pixels above this level are stripe, blurred units.
    pub(crate) segment_threshold: u32,
    /// Samples above this level count towards the width, sample units.
    pub(crate) width_threshold: f32,
    /// Full scale, sample units.
    pub(crate) full_scale: u32,
    /// Amplitudes below this many standard deviations of a raw pixel's noise are low.
    pub(crate) min_snr: f64,
    /// Noise of a raw pixel.
    pub(crate) noise: Noise<'a>,
    /// Noise of the blurred samples, which valleys must exceed.
    pub(crate) valleys: ValleyNoise,
}

impl<'a> Levels<'a> {
    /// Scales parameters from grey levels of an 8-bit scale to samples with the given full scale.
    pub(super) fn new(params: &ExtractionParams, kernel: &'a Kernel, full_scale: u32) -> Self {
        let scale = f64::from(full_scale) / 255.0;
        let units = |grey: f64| (grey * scale * f64::from(UNITS)).round() as u32;
        let read_variance = (params.read_noise * scale).powi(2);
        let noise = Noise {
            // Rounding to integers adds 1/12.
            constant: read_variance + 1.0 / 12.0,
            per_level: params.shot_gain * scale,
            kernel,
        };
        Self {
            method: params.method,
            window: params.window,
            segment_threshold: units(params.segment_threshold),
            width_threshold: grey(units(params.width_threshold)) as f32,
            full_scale,
            min_snr: params.min_snr,
            noise,
            valleys: ValleyNoise::new(&noise, full_scale),
        }
    }
}

impl Levels<'_> {
    /// Returns the same levels with another segment threshold, blurred units; the width threshold scales with it.
    #[must_use]
    pub(super) fn with_segment_threshold(self, threshold: u32) -> Self {
        let width_threshold = match self.segment_threshold {
            0 => self.width_threshold,
            segment => {
                (f64::from(self.width_threshold) * f64::from(threshold) / f64::from(segment)) as f32
            }
        };
        Self { segment_threshold: threshold, width_threshold, ..self }
    }

    /// Returns the segment threshold, sample units.
    pub(super) fn segment_threshold_grey(&self) -> f32 {
        grey(self.segment_threshold) as f32
    }

    /// True if a candidate's largest blurred sample is low against the noise of a raw pixel of level `intensity`.
    pub(super) fn is_low(&self, peak: u32, intensity: f32) -> bool {
        let variance = self.noise.constant + self.noise.per_level * f64::from(intensity);
        grey(peak) * grey(peak) < self.min_snr * self.min_snr * variance
    }

    /// Returns the number of positions that the section should hold on either side of a candidate. This covers the
    /// longest window, 2D/3, and the half maximum of a faint stripe, which lies outside the candidate.
    pub(super) const fn margin(&self, candidate: &Candidate) -> u32 {
        let faint = candidate.peak / 2 <= self.segment_threshold;
        (if faint { candidate.length() } else { 2 * candidate.length() / 3 }) + 3
    }
}

/// Returns the grey level of a blurred sample.
pub(super) fn grey(sample: u32) -> f64 {
    f64::from(sample) / f64::from(UNITS)
}

/// Noise of the raw samples, in sample units: variance `constant + per_level * level`; and the blur applied to them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Noise<'a> {
    /// Variance of read noise and rounding.
    pub(crate) constant: f64,
    /// Variance of the shot noise per level.
    pub(crate) per_level: f64,
    /// The blur.
    pub(crate) kernel: &'a Kernel,
}

impl Noise<'_> {
    /// Returns the standard deviation of Σ (i - c) G over windows of `length` pixels about c, each with Σ G = `level`.
    #[inline(always)]
    pub(super) fn ramp_sigmas(&self, length: &Lane, level: &Lane) -> Lane {
        let energy = self.kernel.ramp_energies(length);
        let (constant, per_level) = (self.constant as f32, self.per_level as f32);
        let gain = self.kernel.noise_gain() as f32;
        each(|lane| {
            // Assumes shot noise of the mean level everywhere. The window's ends, which matter most, are darker.
            let variance = constant + per_level * level[lane] / length[lane].max(1.0);
            (variance * gain * energy[lane]).sqrt()
        })
    }
}
