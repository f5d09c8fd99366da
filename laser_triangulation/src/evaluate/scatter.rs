//! Scatter along the stripe over the scatter that the stated standard deviations predict, without ground truth: on flat
//! parts the second differences of neighbouring points, and their distances from a parabola through nine, are noise.
//!
//! Both combine neighbours linearly, Σ wₖ pₖ. The prediction of its variance is Σ wᵢ wⱼ sᵢ sⱼ ρ(i − j) with the stated
//! standard deviations s and the correlation ρ that the method's own filter causes in white noise. Second differences
//! weigh the noise from column to column, the parabola also that over a few columns, such as speckle: where the two
//! ratios differ, the noise has another correlation than the prediction.

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
/// Distance at which centres share neither pixels nor grains of speckle.
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
/// A part is flat if a parabola through 2 · [`REACH`] + 1 points has a second difference below this share of the frame's
/// median second difference, which then adds less than a tenth to it.
const FLAT_SHARE: f64 = 0.2;
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
    /// Of the second differences of points 7 px apart, which share neither pixels nor grains of speckle.
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
        .flat_map(|run| points[run.clone()].windows(2 * REACH + 1))
        .filter(|window| window.iter().all(|point| point.sigma_px > 0.0))
        .collect();
    let mut bends: Vec<f64> =
        places.iter().map(|window| combine(window, &SECOND_DIFFERENCE).abs()).collect();
    let limit = (FLAT_SHARE * statistics::median(&mut bends)?).max(ALWAYS_FLAT_PX);
    let flat: Vec<&[Point]> =
        places.into_iter().filter(|window| bend_of_form(window) <= limit).collect();
    if flat.len() < MIN_FLAT {
        return None;
    }
    let correlation = Correlation::along_the_stripe(params);
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

/// Returns the magnitude of the second difference of a parabola through the window.
fn bend_of_form(window: &[Point]) -> f64 {
    let places = (0..window.len()).map(|at| (at as f64 - REACH as f64).powi(2));
    let mean = places.clone().sum::<f64>() / window.len() as f64;
    let (mut product, mut norm) = (0.0, 0.0);
    for (square, point) in places.zip(window) {
        product += (square - mean) * point.across_px;
        norm += (square - mean).powi(2);
    }
    (2.0 * product / norm).abs()
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
        let num = 4000;
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

    fn ratios(weights: &[f64], stated_px: f32, params: &ExtractionParams) -> [f64; 2] {
        let line = line(weights, stated_px);
        let found = scatter_ratio(&line, StripeDirection::Horizontal, params).unwrap();
        assert!(found.places > 2000, "{found:?}");
        [found.second_differences, found.from_parabola]
    }

    fn is_near(ratio: f64, expected: f64) -> bool {
        (ratio / expected - 1.0).abs() < 0.08
    }

    #[test]
    fn true_white_and_blurred_noise_gives_one_and_a_false_sigma_its_factor() {
        let white = ExtractionParams { method: Method::GaussianMl, ..ExtractionParams::default() };
        let blurred = ExtractionParams::default();
        let kernel: Vec<f64> =
            (-3..=3).map(|x| (-0.5 * (f64::from(x) / 1.4).powi(2)).exp()).collect();
        for (weights, params) in [(&[1.0] as &[f64], &white), (&kernel, &blurred)] {
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
        let [short, long] = ratios(&kernel, 0.05, &white);
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
