//! Time-ordered samples of a moving quantity, with interpolation between them. Bounded.

use std::collections::VecDeque;

use thiserror::Error;

use super::doubt;
use crate::statistics::median;

/// Maximum number of samples: seconds of a fast encoder, more than any frame looks back.
pub const MAX_SAMPLES: usize = 8192;

/// Number of intervals whose median is the usual interval.
const NUM_INTERVALS: usize = 9;
/// Default gap, in usual intervals without a sample.
const GAP_INTERVALS: i64 = 4;
/// Number of samples in ascending order but older than the last one, after which the clock counts as set back. Fewer
/// are stragglers.
const STRAGGLERS: u32 = 3;

/// A measured quantity that can be interpolated between two measurements.
pub trait Measured: Copy {
    /// Interpolates between `self` (share 0) and `later` (share 1); extrapolates beyond 1.
    #[must_use]
    fn between(&self, later: &Self, share: f64) -> Self;

    /// Returns the distance moved: metres or radians, never negative.
    fn distance(&self, other: &Self) -> f64;
}

/// Limits beyond which a value is in doubt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Longest time between two samples, nanoseconds; `None`: four times the usual one.
    pub max_gap_ns: Option<i64>,
    /// Farthest that it moves between two samples, metres or radians after the axis's scale; `None`: any distance.
    pub max_step: Option<f64>,
}

/// Reasons to reject a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Refused {
    /// Drivers without a clock send this stamp, which carries no time.
    #[error("its stamp is 0")]
    NoStamp,
    /// Another sample has the same stamp.
    #[error("its stamp is that of the sample before")]
    Duplicate,
    /// The sample is older than the last one.
    #[error("its stamp lies before that of an earlier sample")]
    OutOfOrder,
}

/// The value found for a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found<T> {
    /// The value at that time.
    pub value: T,
    /// Bits of [`doubt`].
    pub doubts: u8,
    /// True if a sample was taken at exactly that time.
    pub is_exact: bool,
}

#[derive(Clone, Copy, Debug)]
struct Sample<T> {
    stamp_ns: i64,
    received_ns: i64,
    value: T,
    /// Longest time that is no gap, as known at that sample; `None`: not known yet.
    gap_ns: Option<i64>,
}

/// The samples.
#[derive(Clone, Debug)]
pub struct Track<T> {
    limits: Limits,
    max_samples: usize,
    samples: VecDeque<Sample<T>>,
    intervals_ns: [i64; NUM_INTERVALS],
    num_intervals: usize,
    /// Stamp of the last straggler, and the number of stragglers in ascending order up to it.
    behind: Option<(i64, u32)>,
}

impl<T: Measured> Track<T> {
    /// Creates an empty track for at most `max_samples` samples, at least 2. Allocates all its memory.
    pub fn new(limits: Limits, max_samples: usize) -> Self {
        let max_samples = max_samples.clamp(2, MAX_SAMPLES);
        Self {
            limits,
            max_samples,
            samples: VecDeque::with_capacity(max_samples),
            intervals_ns: [0; NUM_INTERVALS],
            num_intervals: 0,
            behind: None,
        }
    }

    /// Sets other limits, for later samples.
    pub(crate) const fn set_limits(&mut self, limits: Limits) {
        self.limits = limits;
    }

    /// Adds a sample of the time `stamp_ns`, received at `received_ns`. When the track is full, the oldest sample is
    /// dropped. If the clock was set back, all earlier samples are dropped and the result is `Ok(true)`.
    ///
    /// # Errors
    /// The stamp is 0 or not later than that of the last sample; the track is then unchanged.
    pub fn push(&mut self, stamp_ns: i64, received_ns: i64, value: T) -> Result<bool, Refused> {
        if stamp_ns == 0 {
            return Err(Refused::NoStamp);
        }
        let mut was_set_back = false;
        if let Some(last) = self.samples.back() {
            if stamp_ns == last.stamp_ns {
                return Err(Refused::Duplicate);
            }
            if stamp_ns < last.stamp_ns {
                let num = match self.behind {
                    Some((behind_ns, num)) if stamp_ns > behind_ns => num + 1,
                    _ => 1,
                };
                self.behind = Some((stamp_ns, num));
                if num <= STRAGGLERS {
                    return Err(Refused::OutOfOrder);
                }
                self.clear();
                was_set_back = true;
            } else {
                let interval_ns = stamp_ns.saturating_sub(last.stamp_ns);
                self.intervals_ns[self.num_intervals % NUM_INTERVALS] = interval_ns;
                self.num_intervals += 1;
            }
        }
        self.behind = None;
        if self.samples.len() == self.max_samples {
            self.samples.pop_front();
        }
        let gap_ns = self.gap_ns();
        self.samples.push_back(Sample { stamp_ns, received_ns, value, gap_ns });
        Ok(was_set_back)
    }

    /// Removes all samples.
    pub fn clear(&mut self) {
        self.samples.clear();
        self.num_intervals = 0;
        self.behind = None;
    }

    /// True if later samples cannot change the value at `time_ns`.
    pub fn has_reached(&self, time_ns: i64) -> bool {
        self.samples.back().is_some_and(|last| last.stamp_ns >= time_ns)
    }

    /// Returns the last sample and its time, nanoseconds.
    pub fn last(&self) -> Option<(i64, T)> {
        self.samples.back().map(|last| (last.stamp_ns, last.value))
    }

    /// Returns the longest time without a sample that is no gap, nanoseconds; `None` if not known yet.
    pub fn gap_ns(&self) -> Option<i64> {
        if self.limits.max_gap_ns.is_some() {
            return self.limits.max_gap_ns;
        }
        let mut intervals_ns = self.intervals_ns;
        let known = &mut intervals_ns[..self.num_intervals.min(NUM_INTERVALS)];
        median(known).map(|usual| usual.saturating_mul(GAP_INTERVALS))
    }

    /// Returns the time from the last sample before `time_ns` to `time_ns`, nanoseconds; `None` if there is none.
    pub fn age_ns(&self, time_ns: i64) -> Option<i64> {
        let before = self.num_before(time_ns).checked_sub(1)?;
        Some(time_ns.saturating_sub(self.samples[before].stamp_ns))
    }

    /// Returns the value at `time_ns`, from the samples received until `until_ns`.
    ///
    /// `None` if there is no earlier sample, or the last one is too old for an extrapolation.
    pub fn at(&self, time_ns: i64, until_ns: i64) -> Option<Found<T>> {
        let after = self.num_before(time_ns);
        let later = self.samples.get(after).filter(|sample| sample.received_ns <= until_ns);
        let earlier = after.checked_sub(1).and_then(|before| self.samples.get(before));
        match (earlier, later) {
            (_, Some(later)) if later.stamp_ns == time_ns => {
                let doubts = earlier.map_or(0, |earlier| self.step_doubt(earlier, later));
                Some(Found { value: later.value, doubts, is_exact: true })
            }
            (Some(earlier), Some(later)) => Some(self.interpolated(earlier, later, time_ns)),
            (Some(earlier), None) => self.extrapolated(after, earlier, time_ns),
            (None, _) => None,
        }
    }

    fn interpolated(&self, earlier: &Sample<T>, later: &Sample<T>, time_ns: i64) -> Found<T> {
        let mut doubts = self.step_doubt(earlier, later);
        let interval_ns = later.stamp_ns.saturating_sub(earlier.stamp_ns);
        if earlier.gap_ns.or(later.gap_ns).is_some_and(|gap_ns| interval_ns > gap_ns) {
            doubts |= doubt::STALE;
        }
        let share = share(earlier.stamp_ns, later.stamp_ns, time_ns);
        Found { value: earlier.value.between(&later.value, share), doubts, is_exact: false }
    }

    fn extrapolated(&self, after: usize, last: &Sample<T>, time_ns: i64) -> Option<Found<T>> {
        let earlier = self.samples.get(after.checked_sub(2)?)?;
        if time_ns.saturating_sub(last.stamp_ns) > last.gap_ns? {
            return None;
        }
        let share = share(earlier.stamp_ns, last.stamp_ns, time_ns);
        let doubts = doubt::EXTRAPOLATED | self.step_doubt(earlier, last);
        Some(Found { value: earlier.value.between(&last.value, share), doubts, is_exact: false })
    }

    fn step_doubt(&self, earlier: &Sample<T>, later: &Sample<T>) -> u8 {
        let distance = earlier.value.distance(&later.value);
        let is_far = self.limits.max_step.is_some_and(|max_step| distance > max_step);
        if is_far { doubt::GAP } else { 0 }
    }

    /// Returns the number of samples before that time.
    fn num_before(&self, time_ns: i64) -> usize {
        self.samples.partition_point(|sample| sample.stamp_ns < time_ns)
    }
}

/// Returns the relative position of `time_ns` between two times, `from_ns < to_ns`: 0 at the first, 1 at the second.
fn share(from_ns: i64, to_ns: i64, time_ns: i64) -> f64 {
    let between = |from: i64, to: i64| (i128::from(to) - i128::from(from)) as f64;
    between(from_ns, time_ns) / between(from_ns, to_ns)
}

#[cfg(test)]
mod tests;
