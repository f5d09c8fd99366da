//! Weighted least squares in the logarithm (Guo 2011, "A Simple Algorithm for Fitting a Gaussian Function",
//! doi 10.1109/MSP.2011.941846).
//!
//! The logarithm of a Gaussian is a parabola, ln(y - B) = p₀ + p₁t + p₂t², with its maximum at -p₁/2p₂. The noise of
//! the logarithm is that of y divided by the level, so each sample weighs level² / variance. Guo takes the levels from
//! the previous round's fit (his eq. 12), because otherwise a noisy sample would be weighted by its own noise. That fit
//! also selects the samples: those above a tenth of the height (of full scale, where that is lower), and those that
//! saturation cannot have affected.
//!
//! The background B is the mean of the raw samples beyond 3.2 standard deviations of the first guess; a neighbour or a
//! sloping background there biases the result. Below a signal of about ten times the noise the logarithm distorts the
//! noise; there [`gaussian_ml`](super::gaussian_ml) is better by a quarter or more.
//!
//! A thin stripe near full scale, or a faint one, leaves too few samples for a parabola, or one that says less about the
//! centre than the candidate's length. There [`gaussian_ml`](super::gaussian_ml), which also uses samples that may be
//! clipped, decides, if it agrees with the first guess. A wide stripe without a parabola is no Gaussian: speckle, or two
//! lines in one.

use super::{
    elementary::exp,
    gaussian_ml::{
        gaussian_ml,
        start::{SIGMA_RANGE_PX, Start},
    },
    lanes::{Centres, LANES, Lane, Sections, each},
    logarithm::ln,
    noise::PixelNoise,
    parabola::{NormalSums, Parabola},
};

/// Number of reweighting rounds.
const ROUNDS: u32 = 4;
/// Samples below this share of the height or of full scale are ignored.
const FAINTEST: f32 = 0.1;
/// Samples this far beyond the first guess are background, standard deviations of the stripe.
const BACKGROUND_SIGMAS: f32 = 3.2;
/// Standard deviation of a uniform distribution, as a share of its length: 1/√12.
const UNIFORM: f32 = 0.289;
/// Stripes up to this standard deviation have at most six samples above a tenth of their height, pixels.
const THIN_PX: f32 = 1.4;
/// The most probable centre replaces a guess that lies this close to it, pixels. From 0.1 to 0.5 px the errors on rendered
/// thin lines and in rendered speckle hardly depend on it.
const AGREES_PX: f32 = 0.25;

/// Returns the parabola's maximum in every lane. Where there is none, returns the most probable centre if the stripe is thin
/// and that centre agrees with the first guess, else the guess with the uncertainty of a uniform distribution over the
/// candidate.
#[inline(always)]
pub(super) fn log_gaussian(sections: &Sections, noise: PixelNoise, full_scale: f32) -> Centres {
    let (mut centres, stripe_sigma_px) = maxima(sections, noise, full_scale);
    let (length, in_use) = (sections.length(), sections.in_use());
    let is_guess = each(|lane| {
        let is_known = centres.sigma_px[lane] < UNIFORM * length[lane];
        if is_known | (stripe_sigma_px[lane] > THIN_PX) { 0.0 } else { in_use[lane] }
    });
    if is_guess.iter().any(|&is_guess| is_guess > 0.0) {
        let likely = gaussian_ml(sections, noise, full_scale);
        let Centres { position_px, sigma_px } = &mut centres;
        for lane in 0..LANES {
            let agrees = (likely.position_px[lane] - position_px[lane]).abs() <= AGREES_PX;
            let instead = (is_guess[lane] > 0.0) & agrees;
            position_px[lane] = if instead { likely.position_px[lane] } else { position_px[lane] };
            sigma_px[lane] = if instead { likely.sigma_px[lane] } else { sigma_px[lane] };
        }
    }
    centres
}

/// Returns the parabola's maximum in every lane. Where none is found, returns the first guess with the uncertainty of a
/// uniform distribution over the candidate. Returns the stripe's standard deviation beside it, pixels.
#[inline(always)]
fn maxima(sections: &Sections, noise: PixelNoise, full_scale: f32) -> (Centres, Lane) {
    let mut start = Start::of(sections, noise, full_scale);
    start.curve.background = background(sections, &start);
    let length = sections.length();
    let mut sigma_px: Lane = each(|lane| UNIFORM * length[lane]);
    for _ in 0..ROUNDS {
        let sums = weighed(sections, &start, noise, full_scale);
        for lane in 0..LANES {
            let scale = start.curve.sigma_px[lane];
            let centre = start.curve.centre_px[lane];
            let parabola = maximum(&sums, lane);
            let step = parabola.place;
            let next = centre + scale * step;
            let (low, high) = SIGMA_RANGE_PX;
            let sigma = scale * (-0.5 / parabola.curvature).sqrt();
            let is_peak = (parabola.curvature < -1e-3)
                & (step.abs() < 2.0)
                & (next > -1.0)
                & (next < length[lane])
                & (sigma > low)
                & (sigma < high)
                & (parabola.variance > 0.0);
            let curve = &mut start.curve;
            curve.centre_px[lane] = if is_peak { next } else { centre };
            curve.sigma_px[lane] = if is_peak { sigma } else { scale };
            let height =
                curve.amplitude[lane] * exp(parabola.rise.min(1.0) - 1.0) * std::f32::consts::E;
            curve.amplitude[lane] = if is_peak { height } else { curve.amplitude[lane] };
            sigma_px[lane] = if is_peak {
                (scale * parabola.variance.sqrt()).min(length[lane])
            } else {
                UNIFORM * length[lane]
            };
        }
    }
    (Centres { position_px: start.curve.centre_px, sigma_px }, start.curve.sigma_px)
}

/// Returns the mean of the samples that the stripe does not reach; if there are none, the first guess's background.
#[inline(always)]
fn background(sections: &Sections, start: &Start) -> Lane {
    let (mut sum, mut rows) = ([0.0_f32; LANES], [0.0_f32; LANES]);
    for i in start.rows(sections) {
        let (place, samples) = (sections.place(i), sections.raw[i]);
        for lane in 0..LANES {
            let away = (place[lane] - start.curve.centre_px[lane]).abs();
            let far = away > BACKGROUND_SIGMAS * start.curve.sigma_px[lane];
            let counts = far & start.holds(i as f32, lane);
            sum[lane] += if counts { samples[lane] } else { 0.0 };
            rows[lane] += if counts { 1.0 } else { 0.0 };
        }
    }
    each(
        |lane| {
            if rows[lane] > 0.0 { sum[lane] / rows[lane] } else { start.curve.background[lane] }
        },
    )
}

/// The maximum of one lane's parabola.
struct Maximum {
    /// p₂.
    curvature: f32,
    /// -p₁ / 2p₂.
    place: f32,
    /// Value of the parabola there.
    rise: f32,
    /// Variance of the maximum's place.
    variance: f32,
}

/// Sets up the normal equations in t = (x - c)/s of the previous round's curve; logarithms relative to its height.
#[inline(always)]
fn weighed(sections: &Sections, start: &Start, noise: PixelNoise, full_scale: f32) -> NormalSums {
    let mut sums = NormalSums::default();
    let curve = &start.curve;
    let by_sigma = each(|lane| 1.0 / curve.sigma_px[lane]);
    let by_amplitude = each(|lane| 1.0 / curve.amplitude[lane]);
    // A sample whose level is three standard deviations below full scale is rarely clipped.
    let bright = full_scale - 3.0 * noise.variance(full_scale).sqrt();
    for i in start.rows(sections) {
        let (place, samples) = (sections.place(i), sections.raw[i]);
        for lane in 0..LANES {
            let x = place[lane];
            let t = (x - curve.centre_px[lane]) * by_sigma[lane];
            let share = exp(-0.5 * t * t);
            let level = curve.amplitude[lane] * share;
            let total = level + curve.background[lane];
            let sample = samples[lane];
            let counts = (level > FAINTEST * curve.amplitude[lane].min(full_scale))
                & start.holds(i as f32, lane)
                & (sample < full_scale)
                & (total < bright.max(0.8 * full_scale));
            let weight = if counts { level * level / noise.variance(total) } else { 0.0 };
            // Noise may leave no positive value for the logarithm.
            let seen = (sample - curve.background[lane]).max(0.05 * level).max(1e-6);
            let logarithm = ln(seen * by_amplitude[lane]);
            sums.add(lane, weight, t, logarithm);
        }
    }
    sums
}

/// Solves the equations; their inverse is the covariance.
#[inline(always)]
fn maximum(sums: &NormalSums, lane: usize) -> Maximum {
    let Parabola { constant, slope, curvature, matrix, determinant, .. } = sums.solve(lane);
    let [a11, a12, a22] = matrix;
    let place = -0.5 * slope / curvature;
    // d(-p₁/2p₂) = -(dp₁ + 2 dp₂ · place) / 2p₂
    let by_curvature = 2.0 * place;
    let variance = (a22 - 2.0 * by_curvature * a12 + by_curvature * by_curvature * a11)
        / (determinant * 4.0 * curvature * curvature);
    Maximum { curvature, place, rise: constant + 0.5 * slope * place, variance }
}
