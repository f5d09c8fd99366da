//! Splits one run of bright samples into several maxima: a stripe that touches its halo, a reflection or another
//! surface.

use super::section::Candidate;
use std::ops::RangeInclusive;

/// Two maxima are separate candidates if the samples between them fall to half the smaller one or less. Two Gaussians
/// 2.5 standard deviations apart are one candidate, 3.4 apart are two.
const VALLEY: u32 = 2;
/// Samples below a quarter of the maximum belong to a halo under the stripe, not to the stripe. This cuts a Gaussian at
/// 1.7 standard deviations.
const SKIRT: u32 = 4;

/// A candidate, and the middle of its largest samples in half pixels, which is an integer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Maximum {
    /// The samples about the maximum.
    pub(crate) candidate: Candidate,
    /// Half pixels.
    pub(crate) middle: u32,
}

/// A largest or smallest sample.
#[derive(Clone, Copy)]
struct Extreme {
    level: u32,
    /// First position of that level.
    at: u32,
}

/// Calls `put` with every maximum of a run, in order; `sample` returns the sample at a position of the run.
pub(super) fn split(run: &Candidate, sample: impl Fn(u32) -> u32, mut put: impl FnMut(Maximum)) {
    let mut first = run.first;
    // The largest sample since `first`, and the smallest since that one.
    let mut peak = Extreme { level: 0, at: first };
    let mut valley = Extreme { level: u32::MAX, at: first };
    for at in run.first..=run.last {
        let level = sample(at);
        if valley.level <= peak.level.min(level) / VALLEY {
            put(about(peak, first..=valley.at - 1, &sample));
            first = valley.at;
            peak = Extreme { level, at };
            valley = Extreme { level: u32::MAX, at };
        } else if level > peak.level {
            peak = Extreme { level, at };
            valley = Extreme { level: u32::MAX, at };
        } else if level < valley.level {
            valley = Extreme { level, at };
        }
    }
    put(about(peak, first..=run.last, &sample));
}

/// Returns the maximum whose largest sample is `peak`, limited to the positions `within`.
fn about(peak: Extreme, within: RangeInclusive<u32>, sample: &impl Fn(u32) -> u32) -> Maximum {
    let Extreme { level: peak, at } = peak;
    let (from, to) = within.into_inner();
    let is_above = |&at: &u32| sample(at) >= peak.div_ceil(SKIRT);
    let first = (from..at).rev().take_while(is_above).last().unwrap_or(at);
    let last = (at + 1..=to).take_while(is_above).last().unwrap_or(at);
    let last_peak = (at..=last).rev().find(|&at| sample(at) == peak).unwrap_or(at);
    Maximum { candidate: Candidate { first, last, peak, count: 1 }, middle: at + last_peak }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns first and last position, peak and middle of every maximum.
    fn maxima(levels: &[u32]) -> Vec<(u32, u32, u32, f64)> {
        let run = Candidate { first: 5, last: 4 + levels.len() as u32, ..Candidate::default() };
        let mut found = Vec::new();
        split(
            &run,
            |at| levels[at as usize - 5],
            |maximum| {
                let Candidate { first, last, peak, .. } = maximum.candidate;
                found.push((first - 5, last - 5, peak, f64::from(maximum.middle) / 2.0 - 5.0));
            },
        );
        found
    }

    #[test]
    fn a_stripe_is_one() {
        assert_eq!(maxima(&[9]), [(0, 0, 9, 0.0)]);
        assert_eq!(maxima(&[19, 50, 80, 80, 40, 19]), [(1, 4, 80, 2.5)]);
        assert_eq!(maxima(&[19, 50, 80, 41, 80, 50, 19]), [(1, 5, 80, 3.0)], "speckle");
    }

    #[test]
    fn a_valley_parts_two() {
        assert_eq!(maxima(&[19, 80, 30, 10, 90, 30]), [(1, 2, 80, 1.0), (4, 5, 90, 4.0)]);
        assert_eq!(maxima(&[30, 80, 30, 60, 90, 120]), [(0, 1, 80, 1.0), (2, 5, 120, 5.0)]);
    }

    #[test]
    fn a_halo_is_left_out() {
        assert_eq!(maxima(&[39, 39, 39, 90, 160, 80, 39, 39]), [(3, 5, 160, 4.0)]);
    }
}
