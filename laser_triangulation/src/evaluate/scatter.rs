//! Scatter along the stripe over the scatter that the stated standard deviations predict, without ground truth: on flat
//! parts the second differences of neighbouring points, and their distances from a parabola through nine, are noise.
//!
//! Both combine neighbours linearly, Σ wₖ pₖ. The prediction of its variance is Σ wᵢ wⱼ sᵢ sⱼ ρ(i − j) with the stated
//! standard deviations s and the correlation ρ that the method's own filter causes in white noise. Second differences
//! weigh the noise from column to column, the parabola also that over a few columns, such as speckle: where the two
//! ratios differ, the noise has another correlation than the prediction.
//!
//! Noise bends flat parts, too, and a filter along the stripe makes it bend them more than neighbouring points differ.
//! A limit below that bend would select the places whose noise happens to be straight, and understate the scatter.

pub mod speckle;

use std::ops::Range;

use serde::Serialize;

use crate::{
    scanner::{
        params::{ExtractionParams, StripeDirection},
        stripe::{Centerline, correlation::Correlation, flag},
    },
    statistics,
};

/// Second difference along the stripe.
const SECOND_DIFFERENCE: [f64; 3] = [1.0, -2.0, 1.0];
/// Distance at which centres hardly share grains of speckle, or pixels beyond those that the prediction contains.
const APART: usize = 7;
/// Second difference of points at the distance [`APART`].
const DIFFERENCE_APART: [f64; 2 * APART + 1] = {
    let mut weights = [0.0; 2 * APART + 1];
    weights[0] = 1.0;
    weights[APART] = -2.0;
    weights[2 * APART] = 1.0;
    weights
};
/// Distance of the middle one of nine points from the parabola through them (Savitzky and Golay 1964).
const FROM_PARABOLA: [f64; 9] = {
    const S: f64 = 231.0;
    let smooth = [-21.0, 14.0, 39.0, 54.0, 59.0, 54.0, 39.0, 14.0, -21.0];
    let mut weights = [0.0; 9];
    let mut at = 0;
    while at < 9 {
        weights[at] = -smooth[at] / S;
        at += 1;
    }
    weights[4] += 1.0;
    weights
};
/// Points to either side that must continue the line without a gap, and through which the form is fitted.
const REACH: usize = 10;
/// Points of a window.
const WINDOW: usize = 2 * REACH + 1;
/// A part is flat if a parabola through [`WINDOW`] points has a second difference below this share of the frame's
/// median second difference, which then adds less than a tenth to it.
const FLAT_SHARE: f64 = 0.2;
/// It is flat, too, if that second difference is below so many of its standard deviations: noise.
const CHANCE: f64 = 3.0;
/// That second difference as a weighted sum of the points.
const BEND: [f64; WINDOW] = {
    let mean_square = (REACH * (REACH + 1)) as f64 / 3.0;
    let mut weights = [0.0; WINDOW];
    let (mut at, mut norm) = (0, 0.0);
    while at < WINDOW {
        let place = at as f64 - REACH as f64;
        weights[at] = place * place - mean_square;
        norm += weights[at] * weights[at];
        at += 1;
    }
    at = 0;
    while at < WINDOW {
        weights[at] *= 2.0 / norm;
        at += 1;
    }
    weights
};
/// Second differences of the form below this count as flat in any frame, pixels: rounding.
const ALWAYS_FLAT_PX: f64 = 0.002;
/// A larger step between neighbours is an edge, pixels.
const EDGE_PX: f64 = 3.0;
/// A frame with fewer flat places has no ratio.
const MIN_FLAT: usize = 40;

/// Scatter over prediction in one frame; 1 if the stated standard deviations are right.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ScatterRatio {
    /// Of the second differences: 1.4826 times the median of |difference| ÷ predicted standard deviation.
    pub second_differences: f64,
    /// Of the second differences of points 7 px apart, which hardly share grains of speckle.
    pub apart: f64,
    /// Of the distances from a parabola through nine points.
    pub from_parabola: f64,
    /// Median standard deviation stated at the flat places, pixels.
    pub sigma_px: f64,
    /// Flat places.
    pub places: usize,
}

/// A point: position across the stripe and stated standard deviation, pixels; NaN if it is interpolated.
#[derive(Clone, Copy)]
struct Point {
    along_px: f64,
    across_px: f64,
    sigma_px: f64,
    is_doubted: bool,
}

/// Returns the ratios of a centreline that was extracted with these parameters without smoothing; `None` if fewer than 40
/// places are flat. Interpolated points do not count, nor do differences of points with [`flag::MISFIT`]: a misfit
/// moves neighbours alike, so that their scatter does not show it.
#[must_use]
pub fn scatter_ratio(
    line: &Centerline,
    direction: StripeDirection,
    params: &ExtractionParams,
) -> Option<ScatterRatio> {
    let points = points(line, direction);
    let runs = runs(line, &points);
    let places: Vec<&[Point]> = runs
        .iter()
        .flat_map(|run| points[run.clone()].windows(WINDOW))
        .filter(|window| window.iter().all(|point| point.sigma_px > 0.0))
        .collect();
    let correlation = Correlation::along_the_stripe(params);
    let limit = largest_bend_of_flat(&places, &correlation)?;
    let flat: Vec<&[Point]> =
        places.into_iter().filter(|window| combine(window, &BEND).abs() <= limit).collect();
    if flat.len() < MIN_FLAT {
        return None;
    }
    let mut sigmas: Vec<f64> = flat.iter().map(|window| window[REACH].sigma_px).collect();
    Some(ScatterRatio {
        second_differences: ratio(&flat, &SECOND_DIFFERENCE, &correlation)?,
        apart: ratio(&flat, &DIFFERENCE_APART, &correlation)?,
        from_parabola: ratio(&flat, &FROM_PARABOLA, &correlation)?,
        sigma_px: statistics::median(&mut sigmas)?,
        places: flat.len(),
    })
}

fn points(line: &Centerline, direction: StripeDirection) -> Vec<Point> {
    let (along, across) = line.along_and_across(direction);
    let measured = |at: usize| line.flags[at] & flag::INTERPOLATED == 0;
    let point = |(at, (&along, &across)): (usize, (&f32, &f32))| Point {
        along_px: f64::from(along),
        across_px: f64::from(across),
        sigma_px: if measured(at) { f64::from(line.sigma_px[at]) } else { f64::NAN },
        is_doubted: line.flags[at] & flag::MISFIT != 0,
    };
    along.iter().zip(across).enumerate().map(point).collect()
}

/// Returns the stretches without gap, edge or change of the stripe.
fn runs(line: &Centerline, points: &[Point]) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    let mut start = 0;
    for at in 1..=points.len() {
        let continues = at < points.len() && !line.stripe_start.contains(&(at as u32)) && {
            let (last, next) = (points[at - 1], points[at]);
            ((next.along_px - last.along_px).abs() - 1.0).abs() < 0.5
                && (next.across_px - last.across_px).abs() <= EDGE_PX
        };
        if !continues {
            runs.push(start..at);
            start = at;
        }
    }
    runs
}

/// The points in the middle of a window that weights combine.
fn middle<'a>(window: &'a [Point], weights: &[f64]) -> &'a [Point] {
    let half = weights.len() / 2;
    &window[REACH - half..=REACH + half]
}

fn combine(window: &[Point], weights: &[f64]) -> f64 {
    middle(window, weights)
        .iter()
        .zip(weights)
        .map(|(point, weight)| weight * point.across_px)
        .sum()
}

/// Returns the largest second difference of the parabola through a window that counts as flat, pixels.
fn largest_bend_of_flat(places: &[&[Point]], correlation: &Correlation) -> Option<f64> {
    let mut bends: Vec<f64> =
        places.iter().map(|window| combine(window, &SECOND_DIFFERENCE).abs()).collect();
    let median_px = statistics::median(&mut bends)?;
    // That of neighbours, if the stated one is too small. Points in doubt state more than noise.
    let of_neighbours_px =
        statistics::MAD_TO_SIGMA * median_px / correlation.variance(&SECOND_DIFFERENCE).sqrt();
    let middles = places.iter().map(|window| window[REACH]);
    let mut sigmas: Vec<f64> =
        middles.filter(|point| !point.is_doubted).map(|point| point.sigma_px).collect();
    let sigma_px = statistics::median(&mut sigmas).unwrap_or(0.0).max(of_neighbours_px);
    let by_chance = CHANCE * sigma_px * correlation.variance(&BEND).sqrt();
    Some((FLAT_SHARE * median_px).max(ALWAYS_FLAT_PX).max(by_chance))
}

fn ratio(flat: &[&[Point]], weights: &[f64], correlation: &Correlation) -> Option<f64> {
    let normalised = |window: &&[Point]| {
        let weighed = || middle(window, weights).iter().zip(weights);
        if weighed().any(|(point, weight)| point.is_doubted && weight.abs() > 0.0) {
            return None;
        }
        let sigmas: Vec<f64> = weighed().map(|(point, weight)| weight * point.sigma_px).collect();
        Some(combine(window, weights).abs() / correlation.variance(&sigmas).sqrt())
    };
    let mut magnitudes: Vec<f64> = flat.iter().filter_map(normalised).collect();
    (magnitudes.len() >= MIN_FLAT).then(|| statistics::sigma_about_zero(&mut magnitudes))?
}

#[cfg(test)]
mod tests {
    use rand_distr::{Distribution, StandardNormal};

    use super::*;
    use crate::{scanner::params::Method, simulate::noise::frame_rng};

    /// A line whose noise is white noise under `weights`, with a curve and a step.
    fn line(weights: &[f64], stated_px: f32) -> Centerline {
        let num = 20_000;
        let white: Vec<f64> =
            StandardNormal.sample_iter(frame_rng(7, 0)).take(num + weights.len()).collect();
        let gain = weights.iter().map(|weight| weight * weight).sum::<f64>().sqrt();
        let noise = |at: usize| {
            white[at..].iter().zip(weights).map(|(x, weight)| x * weight).sum::<f64>() / gain
        };
        let form = |at: usize| {
            let along = at as f64;
            let bulge = if at % 500 < 60 { 8.0 * (along / 9.0).sin() } else { 0.0 };
            20.0 + 0.1 * along + bulge + if at > 2000 { 30.0 } else { 0.0 }
        };
        Centerline {
            u_px: (0..num).map(|at| at as f32).collect(),
            v_px: (0..num).map(|at| (form(at) + 0.05 * noise(at)) as f32).collect(),
            stripe_start: vec![0],
            width_px: vec![5.0; num],
            intensity: vec![100.0; num],
            sigma_px: vec![stated_px; num],
            flags: vec![0; num],
        }
    }

    fn ratios(weights: &[f64], stated_px: f32, params: &ExtractionParams) -> [f64; 3] {
        let line = line(weights, stated_px);
        let found = scatter_ratio(&line, StripeDirection::Horizontal, params).unwrap();
        assert!(found.places > 2000, "{found:?}");
        [found.second_differences, found.from_parabola, found.apart]
    }

    fn gaussian(sigma_px: f64) -> Vec<f64> {
        let reach = (4.0 * sigma_px).ceil() as i32;
        (-reach..=reach).map(|x| (-0.5 * (f64::from(x) / sigma_px).powi(2)).exp()).collect()
    }

    fn is_near(ratio: f64, expected: f64) -> bool {
        (ratio / expected - 1.0).abs() < 0.08
    }

    #[test]
    fn true_white_and_blurred_noise_gives_one_and_a_false_sigma_its_factor() {
        let white = ExtractionParams { method: Method::GaussianMl, ..ExtractionParams::default() };
        let blurred = ExtractionParams::default();
        let ridge = ExtractionParams { method: Method::Steger, ..blurred };
        let kernel = gaussian(1.4);
        let wide = gaussian(ridge.ridge_sigma_px);
        for (weights, params) in [(&[1.0] as &[f64], &white), (&kernel, &blurred), (&wide, &ridge)]
        {
            for (stated_px, expected) in [(0.05, 1.0), (0.01, 5.0), (0.1, 0.5)] {
                let found = ratios(weights, stated_px, params);
                assert!(
                    found.iter().all(|&ratio| is_near(ratio, expected)),
                    "{stated_px} {} {found:?}",
                    params.method.name()
                );
            }
        }
        // Noise with another correlation than the prediction shows in the difference of the two.
        let [short, long, _] = ratios(&kernel, 0.05, &white);
        assert!(short < 0.3 && long > 1.5 * short, "{short} {long}");
    }

    #[test]
    fn too_few_flat_places_give_no_ratio() {
        let params = ExtractionParams::default();
        let mut line = line(&[1.0], 0.05);
        line.u_px.iter_mut().for_each(|u_px| *u_px *= 2.0);
        assert_eq!(scatter_ratio(&line, StripeDirection::Horizontal, &params), None);
        let empty = Centerline::default();
        assert_eq!(scatter_ratio(&empty, StripeDirection::Horizontal, &params), None);
    }
}
