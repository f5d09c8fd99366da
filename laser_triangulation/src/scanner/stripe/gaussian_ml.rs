//! Maximum likelihood: the Gaussian, integrated over pixels, under which the raw samples are most probable.
//!
//! A cross-section is A G(x; c, s) + B with four unknowns; a sample of level μ has normal noise of variance v(μ) =
//! read² + shot·μ + 1/12 and is clipped to 0 … full scale. A few rounds of Fisher scoring (Kay, Estimation Theory,
//! 1993, section 7.7) maximize the likelihood: θ ← θ + J⁻¹ Σ score ∇μ with J = Σ information ∇μ ∇μᵀ. Clipped samples
//! are censored, not left out. The inverse of J gives the uncertainty of the centre: the Cramér–Rao bound at the
//! estimate.
//!
//! Weak priors about the start constrain what a cross-section cannot determine: s and B of very noisy stripes, and all
//! parameters of stripes of one pixel or of only saturated samples. Where the noise is a sixth of the stripe's height,
//! the priors weigh a few percent of the samples; for better stripes, less.

pub(super) mod curve;
mod likelihood;
mod normal_equations;
pub(super) mod start;

use super::{
    elementary::bounded,
    lanes::{Centres, LANES, Lane, Sections, each},
    noise::PixelNoise,
};
use curve::Curve;
use normal_equations::{NormalEquations, Solution};
use start::{SIGMA_RANGE_PX, Start};

/// Maximum number of rounds; a lane that still moves keeps its last estimate.
const MAX_ROUNDS: u32 = 16;
/// A lane has converged when its centre moves by less than this share of its uncertainty, and its shape by less than
/// [`STILL_SHAPE`]. That step is still taken; the next one would be only a small share of it.
const STILL_CENTRE: f32 = 0.06;
/// Smallest reported uncertainty, the limit of single precision, pixels.
const LEAST_PX: f32 = 1e-5;
/// Relative change of height and width below which the shape has converged.
const STILL_SHAPE: f32 = 0.04;

/// Returns the most probable centre of every lane.
#[inline(always)]
pub(super) fn gaussian_ml(sections: &Sections, noise: PixelNoise, full_scale: f32) -> Centres {
    let start = Start::of(sections, noise, full_scale);
    let prior = Prior::of(sections, &start.curve, noise);
    let mut curve = start.curve;
    let mut sigma_px = [0.0; LANES];
    let mut moving = sections.in_use();
    for _ in 0..MAX_ROUNDS {
        let equations = NormalEquations::of(sections, &start, &curve, noise, full_scale);
        for lane in 0..LANES {
            let solution = equations.solve(lane, &prior.of_lane(lane, &curve));
            let next = stepped(&curve, &solution, lane, sections.last[lane] - sections.first[lane]);
            let is_still = solution.still();
            let goes = moving[lane] > 0.0;
            curve.amplitude[lane] = if goes { next.amplitude } else { curve.amplitude[lane] };
            curve.centre_px[lane] = if goes { next.centre_px } else { curve.centre_px[lane] };
            curve.sigma_px[lane] = if goes { next.sigma_px } else { curve.sigma_px[lane] };
            curve.background[lane] = if goes { next.background } else { curve.background[lane] };
            sigma_px[lane] = if goes { next.uncertainty_px } else { sigma_px[lane] };
            moving[lane] = if goes & !is_still { 1.0 } else { 0.0 };
        }
        if moving.iter().all(|&moves| moves <= 0.0) {
            break;
        }
    }
    let length = sections.length();
    Centres {
        position_px: curve.centre_px,
        sigma_px: each(|lane| bounded(sigma_px[lane], LEAST_PX, length[lane])),
    }
}

/// One lane's curve after a step.
struct Next {
    amplitude: f32,
    centre_px: f32,
    sigma_px: f32,
    background: f32,
    uncertainty_px: f32,
}

/// Takes a step, limited to the range in which the linear model holds.
#[inline(always)]
fn stepped(curve: &Curve, solution: &Solution, lane: usize, last: f32) -> Next {
    let (amplitude, sigma_px) = (curve.amplitude[lane], curve.sigma_px[lane]);
    let [by_amplitude, by_sigma, by_background, by_centre] = solution.step;
    let (low, high) = SIGMA_RANGE_PX;
    let centre_px = curve.centre_px[lane] + sigma_px * bounded(by_centre, -1.0, 1.0);
    Next {
        amplitude: (amplitude * (1.0 + bounded(by_amplitude, -0.5, 1.0))).max(1e-3),
        centre_px: bounded(centre_px, -1.0, last + 1.0),
        sigma_px: bounded(sigma_px * (1.0 + bounded(by_sigma, -0.4, 0.6)), low, high),
        background: curve.background[lane] + amplitude * bounded(by_background, -0.5, 0.5),
        uncertainty_px: solution.centre_variance.sqrt() * sigma_px,
    }
}

/// Prior knowledge, each with its precision: the centre lies in the candidate; the width equals the start's within
/// about a factor of two; the background equals the start's within [`BACKGROUND_SPREAD`].
struct Prior {
    curve: Curve,
    centre_precision: Lane,
    background_precision: Lane,
}

/// Standard deviation of the prior of s, as a share of s.
const SIGMA_SPREAD: f32 = 0.5;
/// Standard deviation of the prior of B, in multiples of the noise of a dark pixel.
const BACKGROUND_SPREAD: f32 = 3.0;
/// The height has no prior, but each step of its logarithm is damped by this much information.
const AMPLITUDE_PRECISION: f32 = 0.25;

/// Precisions and gradients of the prior for one lane, in the units of the normal equations.
struct LanePrior {
    precision: [f32; 4],
    gradient: [f32; 4],
}

impl Prior {
    #[inline(always)]
    fn of(sections: &Sections, curve: &Curve, noise: PixelNoise) -> Self {
        let centre_precision = each(|lane| {
            let half = 0.5 * (sections.last[lane] - sections.first[lane]) + 0.5;
            1.0 / (half * half)
        });
        let spread = BACKGROUND_SPREAD * BACKGROUND_SPREAD * noise.constant;
        Self { curve: *curve, centre_precision, background_precision: [1.0 / spread; LANES] }
    }

    /// Returns the prior for steps relative to the curve's own height and width.
    #[inline(always)]
    fn of_lane(&self, lane: usize, curve: &Curve) -> LanePrior {
        let (amplitude, sigma_px) = (curve.amplitude[lane], curve.sigma_px[lane]);
        let start = self.curve.sigma_px[lane] * SIGMA_SPREAD;
        let by_sigma = sigma_px / (start * start);
        let by_background = amplitude * self.background_precision[lane];
        let by_centre = sigma_px * self.centre_precision[lane];
        LanePrior {
            precision: [
                AMPLITUDE_PRECISION,
                by_sigma * sigma_px,
                by_background * amplitude,
                by_centre * sigma_px,
            ],
            gradient: [
                0.0,
                by_sigma * (self.curve.sigma_px[lane] - sigma_px),
                by_background * (self.curve.background[lane] - curve.background[lane]),
                by_centre * (self.curve.centre_px[lane] - curve.centre_px[lane]),
            ],
        }
    }
}
