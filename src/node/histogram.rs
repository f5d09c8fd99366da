//! A histogram of durations with a fixed amount of memory, for percentiles.

use std::time::Duration;

/// Buckets per factor of two: percentiles are exact to 1/16.
const STEPS: u64 = 16;
/// Buckets up to 2^64 ns.
const NUM_BUCKETS: usize = (64 * STEPS) as usize;

/// Histogram of durations.
#[derive(Clone, Debug)]
pub(crate) struct Histogram {
    counts: Vec<u64>,
    total: u64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { counts: vec![0; NUM_BUCKETS], total: 0 }
    }
}

impl Histogram {
    /// Counts one duration.
    pub(crate) fn record(&mut self, duration: Duration) {
        let nanos = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
        self.counts[bucket(nanos)] += 1;
        self.total += 1;
    }

    /// Adds the counts of `other`.
    pub(crate) fn add(&mut self, other: &Self) {
        self.counts.iter_mut().zip(&other.counts).for_each(|(sum, count)| *sum += count);
        self.total += other.total;
    }

    /// True if nothing was counted.
    pub(crate) const fn is_empty(&self) -> bool {
        self.total == 0
    }

    /// Clears all counts.
    pub(crate) fn clear(&mut self) {
        self.counts.fill(0);
        self.total = 0;
    }

    /// Returns the duration, milliseconds, that a fraction of all durations (0 to 1) does not exceed; 0 if nothing was
    /// counted.
    pub(crate) fn percentile_ms(&self, share: f64) -> f64 {
        let rank = ((self.total as f64 * share).ceil() as u64).max(1);
        let mut seen = 0;
        for (index, count) in self.counts.iter().enumerate() {
            seen += count;
            if seen >= rank {
                return middle_ns(index) / 1e6;
            }
        }
        0.0
    }
}

/// Values below `STEPS` have one bucket each; above, every power of two is divided into `STEPS` equal buckets.
fn bucket(nanos: u64) -> usize {
    if nanos < STEPS {
        return nanos as usize;
    }
    let shift = nanos.ilog2() - STEPS.ilog2();
    (u64::from(shift) * STEPS + (nanos >> shift)) as usize
}

fn middle_ns(index: usize) -> f64 {
    let index = index as u64;
    if index < STEPS {
        return index as f64;
    }
    let shift = index / STEPS - 1;
    let low = (index - shift * STEPS) as f64;
    (low + 0.5) * (shift as f64).exp2()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_exact_to_a_sixteenth() {
        let mut histogram = Histogram::default();
        assert!(histogram.percentile_ms(0.5).abs() < 1e-12);
        for micros in 1..=1000 {
            histogram.record(Duration::from_micros(micros));
        }
        assert!((histogram.percentile_ms(0.50) / 0.500 - 1.0).abs() < 1.0 / 16.0);
        assert!((histogram.percentile_ms(0.99) / 0.990 - 1.0).abs() < 1.0 / 16.0);
    }

    #[test]
    fn every_duration_has_a_bucket_near_it() {
        for nanos in [0, 1, 15, 16, 17, 31, 32, 1000, 123_456_789, u64::MAX / 3, u64::MAX] {
            let index = bucket(nanos);
            assert!(index < NUM_BUCKETS);
            assert!((middle_ns(index) - nanos as f64).abs() <= nanos as f64 / 16.0, "{nanos}");
        }
    }
}
