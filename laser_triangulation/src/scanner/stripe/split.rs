//! Splits one run of bright samples into several maxima: a stripe that touches its halo, a reflection or another
//! surface.

use super::{section::Candidate, valley::ValleyNoise};

/// Samples below a quarter of the maximum belong to a halo under the stripe, not to the stripe. This cuts a Gaussian at
/// 1.7 standard deviations.
const SKIRT: u32 = 4;

/// A largest or smallest sample.
#[derive(Clone, Copy, Debug)]
struct Extreme {
    level: u32,
    /// First position of that level.
    at: u32,
}

/// The samples about one maximum of a run, between two valleys or the ends of the run.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    peak: Extreme,
    first: u32,
    last: u32,
    /// First and last position that belong to no neighbour.
    from: u32,
    to: u32,
}

impl Candidate {
    /// Returns the run of samples from the position `first` on.
    pub(super) fn of_run(first: u32, samples: impl ExactSizeIterator<Item = u32>) -> Self {
        let last = first + samples.len() as u32 - 1;
        let (mut peak, mut valley, mut dip) = (0_u32, 0, 0);
        for sample in samples {
            dip = peak.min(sample).saturating_sub(valley).max(dip);
            valley = if sample > peak { sample } else { valley.min(sample) };
            peak = peak.max(sample);
        }
        Self::alone(first, last, peak, dip)
    }
}

/// Calls `put` with every part of a run, in order; `sample` returns the sample at a position of the run.
pub(super) fn split(
    run: &Candidate,
    noise: &ValleyNoise,
    sample: impl Fn(u32) -> u32,
    mut put: impl FnMut(&Part),
) {
    let (mut first, mut from) = (run.first, run.from);
    // The largest sample since `first`, and the smallest since that one.
    let mut peak = Extreme { level: 0, at: first };
    let mut valley = Extreme { level: u32::MAX, at: first };
    for at in run.first..=run.last {
        let level = sample(at);
        let lower = peak.level.min(level);
        if lower.saturating_sub(valley.level) > noise.limit(lower) {
            let last = valley.at - 1;
            put(&Part { peak, first, last, from, to: last });
            (first, from) = (valley.at, valley.at);
            peak = Extreme { level, at };
            valley = Extreme { level: u32::MAX, at };
        } else if level > peak.level {
            peak = Extreme { level, at };
            valley = Extreme { level: u32::MAX, at };
        } else if level < valley.level {
            valley = Extreme { level, at };
        }
    }
    put(&Part { peak, first, last: run.last, from, to: run.to });
}

impl Part {
    /// Returns all of it as a candidate.
    pub(super) const fn candidate(&self) -> Candidate {
        let Self { peak, first, last, from, to } = *self;
        Candidate { first, last, peak: peak.level, count: 1, dip: 0, from, to }
    }

    /// Returns the samples about its maximum without the halo under them, and the middle of its largest samples, half
    /// pixels.
    pub(super) fn core(&self, sample: impl Fn(u32) -> u32) -> (Candidate, u32) {
        let Extreme { level: peak, at } = self.peak;
        let is_above = |&at: &u32| sample(at) >= peak.div_ceil(SKIRT);
        let first = (self.first..at).rev().take_while(is_above).last().unwrap_or(at);
        let last = (at + 1..=self.last).take_while(is_above).last().unwrap_or(at);
        let last_peak = (at..=last).rev().find(|&at| sample(at) == peak).unwrap_or(at);
        (Candidate { first, last, ..self.candidate() }, at + last_peak)
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::{blur::Kernel, section::Noise},
        *,
    };
    use proptest::prelude::*;

    /// Read noise of 2 levels, unblurred: a valley is deeper than 10.
    fn noise() -> ValleyNoise {
        let kernel = Kernel::gaussian(0);
        let noise =
            ValleyNoise::new(&Noise { constant: 4.0, per_level: 0.0, kernel: &kernel }, 255);
        assert_eq!(noise.limit(100 * 256), 10 * 256);
        noise
    }

    fn run_of(levels: &[u32]) -> Candidate {
        Candidate::of_run(5, levels.iter().map(|level| level * 256))
    }

    /// Returns first and last position of every part.
    fn parts(levels: &[u32]) -> Vec<(u32, u32)> {
        let mut found = Vec::new();
        let run = run_of(levels);
        split(
            &run,
            &noise(),
            |at| levels[at as usize - 5] * 256,
            |part| {
                let Candidate { first, last, from, to, .. } = part.candidate();
                assert_eq!(from, if first == run.first { 0 } else { first });
                assert_eq!(to, if last == run.last { u32::MAX } else { last });
                found.push((first - 5, last - 5));
            },
        );
        found
    }

    /// Returns first and last position, peak and middle of every maximum without its halo.
    fn cores(levels: &[u32]) -> Vec<(u32, u32, u32, f64)> {
        let mut found = Vec::new();
        let sample = |at: u32| levels[at as usize - 5] * 256;
        split(&run_of(levels), &noise(), sample, |part| {
            let (Candidate { first, last, peak, .. }, middle) = part.core(sample);
            found.push((first - 5, last - 5, peak / 256, f64::from(middle) / 2.0 - 5.0));
        });
        found
    }

    #[test]
    fn a_stripe_is_one() {
        assert_eq!(cores(&[9]), [(0, 0, 9, 0.0)]);
        assert_eq!(cores(&[19, 50, 80, 80, 40, 19]), [(1, 4, 80, 2.5)]);
        assert_eq!(cores(&[19, 50, 80, 70, 80, 50, 19]), [(1, 5, 80, 3.0)], "noise");
        assert_eq!(parts(&[19, 50, 80, 70, 80, 50, 19]), [(0, 6)]);
    }

    #[test]
    fn a_valley_parts_two() {
        assert_eq!(cores(&[19, 80, 30, 10, 90, 30]), [(1, 2, 80, 1.0), (4, 5, 90, 4.0)]);
        assert_eq!(cores(&[30, 80, 30, 60, 90, 120]), [(0, 1, 80, 1.0), (2, 5, 120, 5.0)]);
        assert_eq!(parts(&[19, 50, 80, 69, 80, 50, 19]), [(0, 2), (3, 6)]);
        assert_eq!(parts(&[9, 80, 30, 70, 30, 12, 9, 40]), [(0, 1), (2, 5), (6, 7)]);
    }

    #[test]
    fn a_halo_is_left_out() {
        assert_eq!(cores(&[39, 39, 39, 90, 160, 80, 39, 39]), [(3, 5, 160, 4.0)]);
    }

    proptest! {
        /// Runs without a deep dip are never scanned for valleys.
        #[test]
        fn a_run_is_split_only_if_its_deepest_dip_is_a_valley(
            levels in prop::collection::vec(1..255_u32, 1..40),
        ) {
            let run = run_of(&levels);
            let parts = parts(&levels);
            let lowest = levels.iter().min().unwrap() * 256;
            if run.dip <= noise().limit(lowest) {
                prop_assert_eq!(parts.len(), 1);
            }
            let covered: u32 = parts.iter().map(|(first, last)| last - first + 1).sum();
            prop_assert_eq!(covered as usize, levels.len());
        }
    }
}
