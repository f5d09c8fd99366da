//! Samples of something that moves, in order of time, and what it was between them. Bounded.

use std::collections::VecDeque;

use thiserror::Error;

use super::doubt;
use crate::statistics::median;

/// Samples that are kept: seconds of a fast encoder, and more than any frame looks back.
pub const MAX_SAMPLES: usize = 8192;

/// Intervals whose median is the usual one.
const NUM_INTERVALS: usize = 9;
/// So many usual intervals without a sample are a gap, where nobody has chosen how long one is.
const GAP_INTERVALS: i64 = 4;
/// Samples in order among themselves, but before the last one, after which the clock counts as set back. Fewer are
/// stragglers.
const STRAGGLERS: u32 = 3;

/// Something that was measured, and can be thought of between two measurements.
pub trait Measured: Copy {
    /// What it was between `self` (share 0) and `later` (share 1); beyond 1: if the motion went on as it was.
    #[must_use]
    fn between(&self, later: &Self, share: f64) -> Self;

    /// How far it moved: metres or radians, never negative.
    fn distance(&self, other: &Self) -> f64;
}

/// What is no doubt in a track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Longest time between two samples, nanoseconds; 0: four times the usual one.
    pub max_gap_ns: i64,
    /// Farthest that it moves between two samples, metres or radians after the axis's scale; 0: any distance.
    pub max_step: f64,
}

/// Why a sample is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Refused {
    /// Drivers without a clock stamp so: nothing can be said of such a time.
    #[error("its stamp is 0")]
    NoStamp,
    /// A second one of that time.
    #[error("its stamp is that of the sample before")]
    Duplicate,
    /// Older than what is known.
    #[error("its stamp lies before that of an earlier sample")]
    OutOfOrder,
}

/// What was found at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found<T> {
    /// The value then.
    pub value: T,
    /// Bits of [`doubt`].
    pub doubts: u8,
    /// Whether a sample was taken at that very time.
    pub is_exact: bool,
}

#[derive(Clone, Copy, Debug)]
struct Sample<T> {
    stamp_ns: i64,
    received_ns: i64,
    value: T,
    /// Longest time that is no gap, as known then; `None`: not yet.
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
    /// Stamp of the last straggler, and how many ascended up to it.
    behind: Option<(i64, u32)>,
}

impl<T: Measured> Track<T> {
    /// A track without samples that will hold `max_samples` at most, and at least 2. It takes its memory now.
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

    /// Other limits, for samples to come.
    pub const fn set_limits(&mut self, limits: Limits) {
        self.limits = limits;
    }

    /// Takes a sample of the time `stamp_ns` that was received at `received_ns`. Of too many, the oldest goes. When the
    /// clock was set back, all before it goes; `Ok(true)` says so.
    ///
    /// # Errors
    /// It does not lie behind the samples before, or has no stamp; nothing has changed then.
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

    /// Forgets all samples.
    pub fn clear(&mut self) {
        self.samples.clear();
        self.num_intervals = 0;
        self.behind = None;
    }

    /// Whether nothing that comes can change what it was at `time_ns`.
    pub fn has_reached(&self, time_ns: i64) -> bool {
        self.samples.back().is_some_and(|last| last.stamp_ns >= time_ns)
    }

    /// The last sample, and its time, nanoseconds.
    pub fn last(&self) -> Option<(i64, T)> {
        self.samples.back().map(|last| (last.stamp_ns, last.value))
    }

    /// Longest time without a sample that is no gap, nanoseconds; `None` before it is known.
    pub fn gap_ns(&self) -> Option<i64> {
        if self.limits.max_gap_ns > 0 {
            return Some(self.limits.max_gap_ns);
        }
        let mut intervals_ns = self.intervals_ns;
        let known = &mut intervals_ns[..self.num_intervals.min(NUM_INTERVALS)];
        median(known).map(|usual| usual.saturating_mul(GAP_INTERVALS))
    }

    /// How long before `time_ns` the last sample was taken, nanoseconds; `None`: there is none before it.
    pub fn age_ns(&self, time_ns: i64) -> Option<i64> {
        let before = self.num_before(time_ns).checked_sub(1)?;
        Some(time_ns.saturating_sub(self.samples[before].stamp_ns))
    }

    /// What it was at `time_ns`, as far as samples tell that were received until `until_ns`.
    ///
    /// `None`: no sample lies before that time, or the last one so long ago that anything may have happened.
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
        let max_step = self.limits.max_step;
        let is_far = max_step > 0.0 && earlier.value.distance(&later.value) > max_step;
        if is_far { doubt::GAP } else { 0 }
    }

    /// Samples before that time.
    fn num_before(&self, time_ns: i64) -> usize {
        self.samples.partition_point(|sample| sample.stamp_ns < time_ns)
    }
}

/// Where `time_ns` lies between two times, `from_ns < to_ns`: 0 at the first, 1 at the second.
fn share(from_ns: i64, to_ns: i64, time_ns: i64) -> f64 {
    let between = |from: i64, to: i64| (i128::from(to) - i128::from(from)) as f64;
    between(from_ns, time_ns) / between(from_ns, to_ns)
}

#[cfg(test)]
mod tests;
