//! Unwraps encoder counts.

/// Unwraps the counts of one encoder.
#[derive(Clone, Copy, Debug)]
pub struct Counter {
    bits: Option<u32>,
    last: Option<(i64, i64)>,
}

impl Counter {
    /// Creates a counter of `bits` bits, 1 to 63. Without a width, or with another one, it does not wrap.
    pub const fn new(bits: Option<u32>) -> Self {
        Self { bits, last: None }
    }

    /// Returns unwrapped counts, on the shortest way from the last sample: the counter must move less than half its
    /// range between two samples. Saturates at the limits of 64 bits.
    pub fn unwrap(&mut self, raw: i64) -> i64 {
        let Some(bits) = self.bits.filter(|bits| (1..64).contains(bits)) else { return raw };
        let unused = 64 - bits;
        let raw = ((raw as u64) << unused >> unused) as i64;
        let counts = self.last.map_or(raw, |(last_raw, last_counts)| {
            // The difference as a signed number of `bits` bits.
            let step = raw.wrapping_sub(last_raw) << unused >> unused;
            last_counts.saturating_add(step)
        });
        self.last = Some((raw, counts));
        counts
    }

    /// Restarts with the next sample.
    pub const fn restart(&mut self) {
        self.last = None;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_wrap_is_unwrapped() {
        let mut counter = Counter::new(Some(16));
        let counts = [65_530, 65_535, 3, 9, 0, 65_529].map(|raw| counter.unwrap(raw));
        assert_eq!(counts, [65_530, 65_535, 65_539, 65_545, 65_536, 65_529]);
        let mut signed = Counter::new(Some(16));
        assert_eq!([-2, -1, 0, 1].map(|raw| signed.unwrap(raw)), [65_534, 65_535, 65_536, 65_537]);
    }

    #[test]
    fn counts_of_a_counter_that_does_not_wrap_are_unchanged() {
        for bits in [None, Some(0), Some(64), Some(u32::MAX)] {
            let mut counter = Counter::new(bits);
            for raw in [0, i64::MAX, i64::MIN, -1] {
                assert_eq!(counter.unwrap(raw), raw);
            }
        }
    }

    proptest! {
        #[test]
        fn any_motion_sampled_often_enough_is_followed(
            bits in 8..=32_u32, start in any::<u32>(), steps in prop::collection::vec(-0.49..0.49_f64, 1..100),
        ) {
            let range = 1_i64 << bits;
            let mut counter = Counter::new(Some(bits));
            let mut counts = i64::from(start) % range;
            prop_assert_eq!(counter.unwrap(counts), counts);
            for step in steps {
                counts += (step * range as f64) as i64;
                prop_assert_eq!(counter.unwrap(counts.rem_euclid(range)), counts);
            }
        }

        #[test]
        fn no_raw_counts_overflow(bits in prop::option::of(0..70_u32), raws in prop::collection::vec(any::<i64>(), 0..50)) {
            let mut counter = Counter::new(bits);
            for raw in raws {
                counter.unwrap(raw);
            }
        }
    }
}
