//! In strong speckle errors have longer tails than normal ones. Where that shows, the outliers' own sigma is widened.

use super::difference::is_apart;
use crate::scanner::{
    params::StripeDirection,
    stripe::{Centerline, elementary::in_quadrature},
};

/// Neighbours at this distance share neither pixels nor speckles, lines.
const DISTANCE: usize = 6;
/// Errors have long tails if this share of the points lies farther than so many of their standard deviations from the
/// curve through their neighbours. Of normal errors 2 % do, and a few narrow structures of the surface must not count.
const FAR_SIGMAS: f32 = 3.0;
const LONG_TAILS: f64 = 0.07;
/// Approximate number of points for which that is tested, and the least number.
const DEVIATIONS: usize = 256;
const LEAST: usize = 32;
/// With long tails, points farther off than this many standard deviations are outliers.
const OFF_SIGMAS: f32 = 1.9;

/// Widens the sigma of points that lie far from the curve through their neighbours at [`DISTANCE`], if so many do that the
/// errors have long tails.
pub(super) fn widen(centerline: &mut Centerline, direction: StripeDirection) {
    let (along, across) = match direction {
        StripeDirection::Horizontal => (&centerline.u_px, &centerline.v_px),
        StripeDirection::Vertical => (&centerline.v_px, &centerline.u_px),
    };
    let sigmas = &mut centerline.sigma_px;
    let num = sigmas.len();
    let step = num / DEVIATIONS + 1;
    let is_far = |&at: &usize| deviation_px(along, across, at, DISTANCE) > FAR_SIGMAS * sigmas[at];
    let num_far = (0..num).step_by(step).filter(is_far).count();
    if num < LEAST || ((num_far * step) as f64) < LONG_TAILS * num as f64 {
        return;
    }
    for (at, sigma) in sigmas.iter_mut().enumerate() {
        let deviation = deviation_px(along, across, at, DISTANCE);
        if deviation > OFF_SIGMAS * *sigma {
            *sigma = in_quadrature(*sigma, deviation);
        }
    }
}

/// Returns the deviation of a centre from the curve through its neighbours at a distance: a parabola through three before
/// it or three behind it, or a cubic through two on either side, whichever is closest. 0 without such neighbours.
fn deviation_px(along: &[f32], across: &[f32], at: usize, distance: usize) -> f32 {
    let here = across[at];
    // NaN where there is no such neighbour.
    let before = |steps: usize| {
        let offset = steps * distance;
        if at < offset || !is_apart(along[at - offset], along[at], offset) {
            return f32::NAN;
        }
        across[at - offset]
    };
    let behind = |steps: usize| {
        let offset = steps * distance;
        if at + offset >= along.len() || !is_apart(along[at], along[at + offset], offset) {
            return f32::NAN;
        }
        across[at + offset]
    };
    let (a, b, c) = (before(1), before(2), before(3));
    let (d, e, f) = (behind(1), behind(2), behind(3));
    let before_it = (here - 3.0 * (a - b) - c).abs();
    let behind_it = (here - 3.0 * (d - e) - f).abs();
    let between = (here - (4.0 * (a + d) - (b + e)) / 6.0).abs();
    // `min` ignores NaN.
    let closest = before_it.min(behind_it).min(between);
    if closest.is_nan() { 0.0 } else { closest }
}

#[cfg(test)]
mod tests {
    use super::{super::tests::line, *};

    #[test]
    fn long_tails_widen_the_outliers_and_a_few_narrow_structures_stay() {
        let deviation_px = 0.4;
        for (every, least_covered, most_others) in [(16, 118, 200), (100, 0, 0)] {
            let mut line = line(0.02, 0.03, 2000);
            let structures: Vec<usize> = (40..1960).step_by(every).collect();
            for &at in &structures {
                line.v_px[at] += deviation_px;
            }
            let before = line.clone();
            widen(&mut line, StripeDirection::Horizontal);
            let wide: Vec<usize> =
                (0..2000).filter(|&at| line.sigma_px[at] > 3.0 * before.sigma_px[at]).collect();
            let others = wide.iter().filter(|at| !structures.contains(at)).count();
            let is_covered = |&&at: &&usize| 3.0 * line.sigma_px[at] > deviation_px;
            let covered = structures.iter().filter(is_covered).count();
            assert!(covered >= least_covered, "{every}: {covered} of {}", structures.len());
            assert!(others <= most_others, "{every}: {wide:?}");
        }
    }

    #[test]
    fn a_deviation_is_the_smallest_of_three() {
        // A parabola, and a step: every place has a side that continues it.
        let smooth = |at: usize| {
            let along = at as f32;
            0.25 * along + 0.125 * along * along + if at >= 13 { 5.0 } else { 0.0 }
        };
        let along: Vec<f32> = (0..27).map(|at| at as f32).collect();
        let mut across: Vec<f32> = (0..27).map(smooth).collect();
        let deviations = |across: &[f32]| -> Vec<f32> {
            (0..across.len()).map(|at| deviation_px(&along, across, at, 2)).collect()
        };
        assert_eq!(deviations(&across), [0.0; 27]);
        across[6] += 1.0;
        across[26] -= 2.0;
        let found = deviations(&across);
        assert_eq!((found[6], found[26]), (1.0, 2.0));
        // Beyond the ends and a gap are no neighbours.
        let gap = [0.0, 1.0, 2.0, 9.0, 10.0, 11.0, 12.0, 13.0];
        let across = [0.0, 0.0, 3.0, 7.0, 7.0, 7.0, 7.0, 7.0];
        assert!(deviation_px(&gap, &across, 2, 1).abs() < f32::EPSILON);
    }
}
