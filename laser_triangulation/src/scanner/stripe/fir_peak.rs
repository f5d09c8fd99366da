//! Zero crossing of a smoothed derivative (Forest, Salvi, Cabruja, Pous 2004, "Laser stripe peak detector for 3D scanners. A FIR
//! filter approach", ICPR).
//!
//! The raw cross-section passes through a finite impulse response filter that differentiates and smooths; the centre
//! lies where the response falls through zero. Forest uses a low-pass, the difference of neighbours, and a straight
//! line between the two responses about zero. Here one filter does both, h(k) = k exp(-k²/2w²), and a cubic goes
//! through four responses: a straight line leaves an error of 0.005 px for a two-pixel stripe.
//!
//! The width w follows from the noise. Of all odd filters, the stripe's own slope, -G′(x) ~ x exp(-x²/2s²), has the
//! smallest ratio of noise to slope at zero (a matched filter: the variance of the crossing is Σ h²v / (Σ h G′)²,
//! minimal for h ~ G′ by Cauchy and Schwarz). So w is the stripe's standard deviation s from the first guess. For a
//! saturated stripe, w is the distance at which its flat top ends, the only part with a slope.

use super::{
    elementary::{bounded, exp},
    gaussian_ml::start::Start,
    lanes::{Centres, LANES, Lane, Sections, each, lane_of},
    logarithm::ln,
    noise::PixelNoise,
};

/// Number of positions at which the filter is evaluated, starting one below the guessed centre.
const PLACES: usize = 4;
/// Variance of zero-mean noise after clipping at 0, as a share of its own: 1/2 - 1/2π.
const CLIPPED_SHARE: f32 = 0.341;

/// Finds the zero crossing in every lane. If there is none within a pixel or two of the first guess, returns the guess
/// with the uncertainty of a uniform distribution over the candidate.
#[inline(always)]
pub(super) fn fir_peak(sections: &Sections, noise: PixelNoise, full_scale: f32) -> Centres {
    let start = Start::of(sections, noise, full_scale);
    let base: Lane = each(|lane| start.curve.centre_px[lane].floor());
    let responses = Responses::of(sections, &start, &base, noise, full_scale);
    let mut centres = Centres { position_px: start.curve.centre_px, sigma_px: [0.0; LANES] };
    for (lane, &base) in base.iter().enumerate() {
        let guess = start.curve.centre_px[lane] - base;
        let length = sections.last[lane] - sections.first[lane] + 1.0;
        let crossing = responses.crossing(lane, guess);
        let position = base + crossing.place;
        let is_found = (crossing.place >= -1.0)
            & (crossing.place <= 2.0)
            & (crossing.slope < 0.0)
            & (crossing.variance > 0.0)
            & (position > -1.0)
            & (position < length);
        let guessed = start.curve.centre_px[lane];
        centres.position_px[lane] = if is_found { position } else { guessed };
        let any = 0.289 * length;
        let sigma = (crossing.variance.max(0.0).sqrt() / -crossing.slope).min(length);
        // Where the border or a neighbour cuts the stripe, the crossing is pulled away from it.
        let reach = 1.5 * start.curve.sigma_px[lane];
        let row = sections.first[lane] + position;
        let is_cut = (row - reach < start.from[lane]) | (row + reach > start.to[lane] - 1.0);
        let sigma = if is_cut { sigma.max(any) } else { sigma };
        centres.sigma_px[lane] = if is_found { sigma } else { any };
    }
    centres
}

/// Filter responses at four positions of every lane.
struct Responses {
    response: [Lane; PLACES],
    /// Variances of the responses at the two positions about the guess.
    variance: [Lane; 2],
}

/// Position at which a lane's response falls through zero.
struct Crossing {
    /// Distance from the position at or below the guess.
    place: f32,
    /// Slope of the response there, per pixel.
    slope: f32,
    /// Variance of the response there.
    variance: f32,
}

impl Responses {
    #[inline(always)]
    fn of(
        sections: &Sections,
        start: &Start,
        base: &Lane,
        noise: PixelNoise,
        full_scale: f32,
    ) -> Self {
        let mut responses = Self { response: [[0.0; LANES]; PLACES], variance: [[0.0; LANES]; 2] };
        let rate = filter_rate(start, full_scale);
        for i in start.rows(sections) {
            let (place, samples) = (sections.place(i), sections.raw[i]);
            for lane in 0..LANES {
                let holds = start.holds(i as f32, lane);
                let sample = samples[lane];
                // Beyond the window is background, which contributes zero after subtraction.
                let light = if holds { sample - start.curve.background[lane] } else { 0.0 };
                let share = if sample >= full_scale {
                    0.0
                } else if sample <= 0.0 {
                    CLIPPED_SHARE
                } else {
                    1.0
                };
                let variance = if holds { share * noise.variance(sample) } else { 0.0 };
                for (at, response) in responses.response.iter_mut().enumerate() {
                    let k = place[lane] - base[lane] + 1.0 - at as f32;
                    let tap = k * exp(-rate[lane] * k * k);
                    response[lane] += tap * light;
                    if at == 1 || at == 2 {
                        responses.variance[at - 1][lane] += tap * tap * variance;
                    }
                }
            }
        }
        responses
    }

    /// Finds the cubic's zero by Newton's method, starting at the guess.
    #[inline(always)]
    fn crossing(&self, lane: usize, guess: f32) -> Crossing {
        let [a, b, c, d] = lane_of(&self.response, lane);
        // The cubic goes through (-1, a), (0, b), (1, c), (2, d).
        let second = 0.5 * (a + c) - b;
        let third = (d - a) / 6.0 - 0.5 * (c - b);
        let first = c - b - second - third;
        let mut x = guess;
        let mut slope = 0.0;
        for _ in 0..6 {
            slope = first + x * (2.0 * second + x * 3.0 * third);
            let value = b + x * (first + x * (second + x * third));
            x = bounded(x - value / slope.min(-1e-6), -1.5, 2.5);
        }
        let [low, high] = lane_of(&self.variance, lane);
        let share = bounded(x, 0.0, 1.0);
        Crossing { place: x, slope, variance: low + share * (high - low) }
    }
}

/// Returns 1/2w² of every lane.
#[inline(always)]
fn filter_rate(start: &Start, full_scale: f32) -> Lane {
    each(|lane| {
        let sigma = start.curve.sigma_px[lane];
        let times = (start.curve.amplitude[lane] / full_scale).max(1.0);
        let flat = 2.0 * ln(times);
        0.5 / (sigma * sigma * flat.max(1.0))
    })
}
