//! Which of several candidates in one cross-section is the stripe.

use super::section::Candidate;
use crate::scanner::params::PeakSelection;

/// Takes candidates in order of their position and keeps the chosen one.
#[derive(Clone, Copy, Debug, Default)]
pub struct Selected {
    best: Option<Candidate>,
    count: u32,
}

impl Selected {
    /// Offers the next candidate; equal ones lose against earlier ones.
    pub fn offer(&mut self, candidate: Candidate, selection: PeakSelection) {
        self.count += 1;
        let better = self.best.is_none_or(|best| match selection {
            PeakSelection::Brightest => candidate.peak > best.peak,
            PeakSelection::First => false,
            PeakSelection::Last => true,
            PeakSelection::Widest => candidate.length() > best.length(),
        });
        if better {
            self.best = Some(candidate);
        }
    }

    /// The chosen one, with the number of candidates that were offered.
    pub fn take(&mut self) -> Option<Candidate> {
        let selected = std::mem::take(self);
        selected.best.map(|best| Candidate { count: selected.count, ..best })
    }
}
