//! One cross-section of the stripe and the numbers that every estimator shares.
//!
//! Positions run across the stripe: rows for a horizontal stripe, columns for a vertical one, pixel centres at
//! integers, counted from the border of the searched region.

use super::blur::{Kernel, UNITS};
use crate::scanner::params::{ExtractionParams, Method, Window};
use std::ops::Range;

/// The run of stripe pixels that was chosen in a cross-section.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Candidate {
    /// First position above the segment threshold.
    pub first: u32,
    /// Last position above the segment threshold.
    pub last: u32,
    /// Largest blurred sample, blurred units.
    pub peak: u32,
    /// Candidates of this cross-section, this one included; 0: none was found.
    pub count: u32,
}

impl Candidate {
    /// Samples above the segment threshold.
    pub const fn length(&self) -> u32 {
        self.last - self.first + 1
    }

    /// Its positions and up to `margin` more to either side, within a cross-section of `length` positions.
    pub fn reach(&self, margin: u32, length: usize) -> Range<usize> {
        let from = self.first.saturating_sub(margin) as usize;
        from..((self.last + margin) as usize + 1).min(length)
    }
}

/// A candidate and the cross-section in which it was found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Found {
    /// Column of the searched region for a horizontal stripe, row for a vertical one.
    pub line: u32,
    /// Where it lies in that line.
    pub candidate: Candidate,
}

/// Blurred samples of a cross-section: the candidate and what lies around it.
#[derive(Clone, Copy, Debug)]
pub struct Section<'a> {
    /// Blurred samples, blurred units, of consecutive positions.
    pub samples: &'a [u32],
    /// Unblurred samples at the same positions, sample units.
    pub raw: &'a [u32],
    /// Position of `samples[0]` and `raw[0]`.
    pub origin: u32,
    /// The run of stripe pixels; it lies within `samples`, whose margin only the border cuts short.
    pub candidate: Candidate,
}

impl Section<'_> {
    /// Samples of the candidate.
    pub fn run(&self) -> &[u32] {
        let from = (self.candidate.first - self.origin) as usize;
        &self.samples[from..from + self.candidate.length() as usize]
    }
}

/// The extraction's parameters in the units of the blurred samples of one image.
#[derive(Clone, Copy, Debug)]
pub struct Levels<'a> {
    /// Estimator.
    pub method: Method,
    /// Window of the improved gravity.
    pub window: Window,
    /// A pixel is stripe above this, blurred units.
    pub segment_threshold: u32,
    /// A sample counts towards the width above this, blurred units.
    pub width_threshold: u32,
    /// Full scale, sample units.
    pub full_scale: u32,
    /// Noise of a raw pixel.
    pub noise: Noise<'a>,
}

impl<'a> Levels<'a> {
    /// Scales parameters given in grey levels of an 8-bit scale to samples of that full scale.
    pub fn new(params: &ExtractionParams, kernel: &'a Kernel, full_scale: u32) -> Self {
        let scale = f64::from(full_scale) / 255.0;
        let units = |grey: f64| (grey * scale * f64::from(UNITS)).round() as u32;
        let read_variance = (params.read_noise * scale).powi(2);
        Self {
            method: params.method,
            window: params.window,
            segment_threshold: units(params.segment_threshold),
            width_threshold: units(params.width_threshold),
            full_scale,
            // Rounding to integers adds 1/12.
            noise: Noise {
                constant: read_variance + 1.0 / 12.0,
                per_level: params.shot_gain * scale,
                kernel,
            },
        }
    }
}

impl Levels<'_> {
    /// The same with another segment threshold, blurred units; the width threshold keeps its proportion to it.
    #[must_use]
    pub fn with_segment_threshold(self, threshold: u32) -> Self {
        let proportion = f64::from(self.width_threshold) / f64::from(self.segment_threshold.max(1));
        Self {
            segment_threshold: threshold,
            width_threshold: (f64::from(threshold) * proportion).round() as u32,
            ..self
        }
    }

    /// Positions to either side of a candidate that its section should hold: the window 2D/3 reaches at most so far, and
    /// half the peak of a faint stripe lies outside the candidate.
    pub const fn margin(&self, candidate: &Candidate) -> u32 {
        let faint = candidate.peak / 2 <= self.segment_threshold;
        (if faint { candidate.length() } else { 2 * candidate.length() / 3 }) + 3
    }
}

/// Grey level of a blurred sample.
pub fn grey(sample: u32) -> f64 {
    f64::from(sample) / f64::from(UNITS)
}

/// Noise of the raw samples, in sample units: variance `constant + per_level * level`; and the blur that it went through.
#[derive(Clone, Copy, Debug)]
pub struct Noise<'a> {
    /// Variance of read noise and rounding.
    pub constant: f64,
    /// Variance of the shot noise per level.
    pub per_level: f64,
    /// The blur.
    pub kernel: &'a Kernel,
}

impl Noise<'_> {
    /// Standard deviation of Σ (i - c) G over a window of `length` pixels about c that holds `level` = Σ G.
    pub fn ramp_sigma(&self, length: f64, level: f64) -> f64 {
        // Shot noise as if the mean level were everywhere: the window's ends, which count most, are darker.
        let variance = self.constant + self.per_level * level / length.max(1.0);
        (variance * self.kernel.noise_gain() * self.kernel.ramp_energy(length)).sqrt()
    }

    /// Standard deviation of Σ weight(i) G over blurred samples, whose noise the blur has made correlated.
    pub fn weighted_sigma(&self, samples: &[u32], weight: impl Fn(usize) -> f64) -> f64 {
        let kernel = self.kernel.weights();
        let r = self.kernel.radius();
        let mut variance = 0.0;
        for raw in 0..samples.len() + 2 * r {
            // The raw sample `raw - r` reaches the blurred samples up to r away.
            let reached = raw.saturating_sub(2 * r)..(raw + 1).min(samples.len());
            let by_raw: f64 = reached.map(|i| weight(i) * f64::from(kernel[raw - i])).sum::<f64>()
                / f64::from(UNITS);
            let level = grey(samples[raw.saturating_sub(r).min(samples.len() - 1)]);
            variance += by_raw * by_raw * (self.constant + self.per_level * level);
        }
        (variance * self.kernel.noise_gain()).sqrt()
    }
}

/// The centre of a cross-section and how sure it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Centre {
    /// Position, pixels.
    pub position_px: f64,
    /// One standard deviation from the stated noise, pixels.
    pub sigma_px: f64,
}

/// Full width at half maximum, pixels: where the blurred samples fall below half their peak, interpolated linearly,
/// and the blur's own width taken off in quadrature. Stripes thinner than 2 pixels come out up to a tenth too wide. NaN
/// where the border or a bright background hides an edge.
pub fn full_width_half_maximum(section: &Section<'_>, blur_variance_px2: f64) -> f64 {
    let samples = section.samples;
    let half = f64::from(section.candidate.peak) / 2.0;
    let run_start = (section.candidate.first - section.origin) as usize;
    let Some(peak) = section.run().iter().position(|&sample| sample == section.candidate.peak)
    else {
        return f64::NAN;
    };
    let peak = run_start + peak;
    // Place of the crossing between a sample above half and its outer neighbour below, as a share of the way out.
    let share = |inner: usize, outer: usize| {
        let (inner, outer) = (f64::from(samples[inner]), f64::from(samples[outer]));
        (inner - half) / (inner - outer)
    };
    let is_below = |&sample: &u32| f64::from(sample) < half;
    let (Some(below), Some(above)) =
        (samples[..peak].iter().rposition(is_below), samples[peak..].iter().position(is_below))
    else {
        return f64::NAN;
    };
    let above = peak + above;
    let width = (above - below) as f64 - 2.0 + share(below + 1, below) + share(above - 1, above);
    // 8 ln 2: from a Gaussian's variance to its squared full width at half maximum.
    (width * width - 8.0 * std::f64::consts::LN_2 * blur_variance_px2).max(0.0).sqrt()
}
