//! Medians of figures of many frames in bounded memory.

/// Smallest exponent, 2^-12: smaller figures count as 0.
const LOWEST: u32 = (127 - 12) << 3;
/// Classes: 16 octaves of eight.
const CLASSES: usize = 128;
/// Bits of a number that distinguish no classes.
const SHIFT: u32 = 20;

/// Positive figures in classes, eight an octave: a median is right within 6 %.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Classes {
    /// Figures below the lowest class.
    zeros: u64,
    counts: [u64; CLASSES],
}

impl Default for Classes {
    fn default() -> Self {
        Self { zeros: 0, counts: [0; CLASSES] }
    }
}

impl Classes {
    /// Adds a figure, if there is one.
    pub(crate) fn extend(&mut self, figure: Option<f32>) {
        let Some(figure) = figure else { return };
        let class = (figure.max(0.0).to_bits() >> SHIFT).checked_sub(LOWEST);
        match class.map(|class| (class as usize).min(CLASSES - 1)) {
            Some(class) => self.counts[class] += 1,
            None => self.zeros += 1,
        }
    }

    /// Returns the median figure; `None` without figures.
    pub(crate) fn median(&self) -> Option<f64> {
        let all = self.zeros + self.counts.iter().sum::<u64>();
        let mut above = self.zeros;
        if all == 0 {
            return None;
        }
        if 2 * above > all {
            return Some(0.0);
        }
        let class = self.counts.iter().position(|count| {
            above += count;
            2 * above > all
        });
        // The middle of the class.
        let bits = |class: usize| ((LOWEST + class as u32) << SHIFT) | (1 << (SHIFT - 1));
        class.map(|class| f64::from(f32::from_bits(bits(class))))
    }

    /// Adds the figures of `other`.
    pub(crate) fn add(&mut self, other: &Self) {
        self.zeros += other.zeros;
        for (count, added) in self.counts.iter_mut().zip(other.counts) {
            *count += added;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_median_is_within_six_percent() {
        for unit in [0.0007_f32, 0.02, 0.3, 5.0] {
            let mut classes = Classes::default();
            for i in 1..=101_u8 {
                classes.extend(Some(unit * f32::from(i) / 51.0));
            }
            let median = classes.median().unwrap() / f64::from(unit);
            assert!((median - 1.0).abs() < 0.07, "{unit}: {median}");
        }
    }

    #[test]
    fn zeros_and_nothing_have_medians_too() {
        let mut classes = Classes::default();
        classes.extend(None);
        assert_eq!(classes.median(), None);
        for figure in [0.0, 0.0, 1.0] {
            classes.extend(Some(figure));
        }
        assert_eq!(classes.median(), Some(0.0));
        let mut other = Classes::default();
        for figure in [1e9; 4] {
            other.extend(Some(figure));
        }
        classes.add(&other);
        assert!(classes.median().unwrap() > 10.0);
    }
}
