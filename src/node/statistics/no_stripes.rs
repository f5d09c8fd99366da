//! Frames without a stripe, and the likely reasons.

use crate::scanner::diagnosis::{Diagnosis, REASONS};

/// Frames without a stripe. Some of them are examined for the reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct NoStripes {
    /// All of them.
    pub(crate) frames: u64,
    /// Examined ones by the kind of reason, each with its last diagnosis.
    examined: [Option<(Diagnosis, u64)>; REASONS],
}

impl NoStripes {
    /// Counts a frame, with its diagnosis if it was examined. Returns true if its reason is new.
    pub(crate) fn count(&mut self, diagnosis: Option<Diagnosis>) -> bool {
        self.frames += 1;
        diagnosis.is_some_and(|diagnosis| self.note(diagnosis, 1) == 1)
    }

    fn note(&mut self, diagnosis: Diagnosis, frames: u64) -> u64 {
        let Some(kind) = self.examined.get_mut(diagnosis.reason.index()) else { return 0 };
        let before = kind.map_or(0, |(_, frames)| frames);
        *kind = Some((diagnosis, before + frames));
        before + frames
    }

    /// Returns the diagnosis of each kind with the number of frames, the most frequent first.
    pub(crate) fn reasons(&self) -> Vec<(Diagnosis, u64)> {
        let mut reasons: Vec<_> = self.examined.iter().flatten().copied().collect();
        reasons.sort_by_key(|(_, frames)| std::cmp::Reverse(*frames));
        reasons
    }

    /// Returns the most frequent reason and its number of frames.
    pub(crate) fn likely(&self) -> Option<(Diagnosis, u64)> {
        self.reasons().into_iter().next()
    }

    /// Returns the number of examined frames.
    pub(crate) fn num_examined(&self) -> u64 {
        self.examined.iter().flatten().map(|(_, frames)| frames).sum()
    }

    /// Adds the frames of `other`.
    pub(crate) fn add(&mut self, other: &Self) {
        self.frames += other.frames;
        for (diagnosis, frames) in other.examined.iter().flatten() {
            self.note(*diagnosis, *frames);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scanner::diagnosis::Reason;

    #[test]
    fn the_most_frequent_reason_is_the_likely_one() {
        let of = |reason| Some(Diagnosis { reason, turned: None });
        let mut counted = NoStripes::default();
        assert!(counted.count(of(Reason::NoLine)), "new");
        assert!(counted.count(of(Reason::Region)));
        assert!(!counted.count(of(Reason::Region)), "known");
        assert!(!counted.count(None), "not examined");
        let mut sum = NoStripes::default();
        sum.add(&counted);
        sum.add(&counted);
        assert_eq!((sum.frames, sum.num_examined()), (8, 6));
        let likely = sum.likely().unwrap();
        assert_eq!((likely.0.reason, likely.1), (Reason::Region, 4));
    }
}
