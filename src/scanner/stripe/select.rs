//! Which of several candidates in one cross-section is the stripe.

use super::section::{Candidate, Found};
use crate::scanner::params::{ExtractionParams, PeakSelection};

/// Chooses candidates frame after frame.
#[derive(Clone, Debug)]
pub struct Selector {
    params: ExtractionParams,
}

impl Selector {
    /// A selector with these settings.
    pub const fn new(params: ExtractionParams) -> Self {
        Self { params }
    }

    /// Replaces `chosen` by the candidates that are stripe, stripe after stripe, each in order of its lines. `found` are
    /// all candidates, in order of their lines, those of a line in order of their position.
    pub fn select(&mut self, found: &[Found], chosen: &mut Vec<Found>) {
        chosen.clear();
        for line in found.chunk_by(|a, b| a.line == b.line) {
            // Equal ones lose against earlier ones.
            let best = line.iter().copied().reduce(|best, other| {
                if self.is_better(&other.candidate, &best.candidate) { other } else { best }
            });
            chosen.extend(best.map(|Found { line: at, candidate }| Found {
                line: at,
                candidate: Candidate { count: line.len() as u32, ..candidate },
            }));
        }
    }

    fn is_better(&self, candidate: &Candidate, best: &Candidate) -> bool {
        match self.params.peak_selection {
            PeakSelection::Brightest | PeakSelection::Continuity => candidate.peak > best.peak,
            PeakSelection::First => false,
            PeakSelection::Last => true,
            PeakSelection::Widest => candidate.length() > best.length(),
        }
    }
}
