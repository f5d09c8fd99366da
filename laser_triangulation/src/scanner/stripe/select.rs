//! Selects the stripe among several candidates in one cross-section.
//!
//! First drops candidates that are too faint, too narrow or too wide, then those too far from the last frame's stripes.
//! From the rest it selects one candidate per line, once for each allowed stripe.

use super::{
    blur::UNITS,
    continuity::{BREAK, LineFinder, Node},
    section::{Candidate, Levels, LineCandidate},
    split::{Maximum, split},
    tracking::Tracker,
};
use crate::scanner::params::{ExtractionParams, PeakSelection};

/// Maximum candidates per line that [`PeakSelection::Continuity`] compares, the brightest ones; bounds the time on
/// noisy images.
const MAX_IN_LINE: usize = 8;

/// Selects candidates frame after frame. Stores the last frame's stripes if tracking is enabled.
#[derive(Clone, Debug)]
pub(super) struct Selector {
    params: ExtractionParams,
    /// Candidates within the limits, and those of them not selected yet.
    possible: Vec<Possible>,
    left: Vec<Possible>,
    taken: Vec<Possible>,
    /// Index in `taken` at which each stripe begins.
    starts: Vec<usize>,
    finder: LineFinder,
    nodes: Vec<Node>,
    /// Indices into `left`, ascending.
    picked: Vec<u32>,
    tracker: Tracker,
}

/// A candidate within the limits.
#[derive(Clone, Copy, Debug)]
struct Possible {
    line: u32,
    maximum: Maximum,
}

impl Selector {
    /// Creates a selector with these settings.
    pub(super) fn new(params: ExtractionParams) -> Self {
        Self {
            params,
            possible: Vec::new(),
            left: Vec::new(),
            taken: Vec::new(),
            starts: Vec::new(),
            finder: LineFinder::default(),
            nodes: Vec::new(),
            picked: Vec::new(),
            tracker: Tracker::default(),
        }
    }

    /// Discards the last frame's stripes: the next frame is searched everywhere.
    pub(super) const fn reset(&mut self) {
        self.tracker.clear();
    }

    /// Replaces `chosen` by the candidates that are stripe, stripe after stripe, each in order of its lines. `found`
    /// holds all candidates, sorted by line and position; `sample` returns a candidate's sample in a line and at a
    /// position.
    pub(super) fn select(
        &mut self,
        found: &[LineCandidate],
        levels: &Levels<'_>,
        sample: impl Fn(u32, u32) -> u32,
        chosen: &mut Vec<LineCandidate>,
    ) {
        chosen.clear();
        if self.is_plain() {
            // Most frames have one candidate per line, and nothing to select.
            if found.windows(2).all(|pair| pair[0].line != pair[1].line) {
                chosen.extend_from_slice(found);
                return;
            }
            chosen.extend(found.chunk_by(|a, b| a.line == b.line).filter_map(|line| {
                let best = best_of(self.params.peak_selection, line, |found| &found.candidate)?;
                let LineCandidate { line: at, candidate } = line[best];
                let count = line.len() as u32;
                Some(LineCandidate { line: at, candidate: Candidate { count, ..candidate } })
            }));
            return;
        }
        self.limit(found, levels, sample);
        let margin = self.params.tracking_margin_px.unwrap_or(0).saturating_mul(2);
        let last_frame = self.tracker.num_points();
        if margin > 0 && last_frame > 0 {
            let is_near = |possible: &&Possible| {
                self.tracker.is_near(possible.line, possible.maximum.middle, margin)
            };
            self.left.clear();
            self.left.extend(self.possible.iter().filter(is_near));
            self.choose(levels.segment_threshold);
        }
        // No track, or the track was lost.
        if margin == 0 || last_frame == 0 || 2 * self.taken.len() < last_frame {
            self.left.clone_from(&self.possible);
            self.choose(levels.segment_threshold);
        }
        if margin > 0 {
            self.remember();
        }
        chosen.extend(self.taken.iter().map(|&Possible { line, maximum }| LineCandidate {
            line,
            candidate: maximum.candidate,
        }));
    }

    /// True if only the brightest, first, last or widest candidate is wanted, without further limits.
    fn is_plain(&self) -> bool {
        let params = &self.params;
        params.peak_selection != PeakSelection::Continuity
            && params.min_contrast <= 0.0
            && params.min_width_px <= 1
            && params.max_width_px.is_none()
            && params.max_stripes <= 1
            && params.tracking_margin_px.is_none()
    }

    /// Fills `possible` with the candidates within the limits.
    fn limit(
        &mut self,
        found: &[LineCandidate],
        levels: &Levels<'_>,
        sample: impl Fn(u32, u32) -> u32,
    ) {
        let Self { params, possible, .. } = self;
        let scale = f64::from(levels.full_scale) / 255.0 * f64::from(UNITS);
        let min_peak = (params.min_contrast * scale).round() as u32;
        let max_width = params.max_width_px.unwrap_or(u32::MAX);
        let widths = params.min_width_px..=max_width;
        possible.clear();
        for in_line in found.chunk_by(|a, b| a.line == b.line) {
            let from = possible.len();
            for &LineCandidate { line, candidate } in in_line {
                let mut put = |maximum: Maximum| {
                    let Candidate { peak, .. } = maximum.candidate;
                    if peak >= min_peak && widths.contains(&maximum.candidate.length()) {
                        possible.push(Possible { line, maximum });
                    }
                };
                if params.peak_selection == PeakSelection::Continuity {
                    split(&candidate, |at| sample(line, at), put);
                } else {
                    put(Maximum { candidate, middle: candidate.first + candidate.last });
                }
            }
            let count = (possible.len() - from) as u32;
            if params.peak_selection == PeakSelection::Continuity && count as usize > MAX_IN_LINE {
                let of_line = &mut possible[from..];
                let position = |possible: &Possible| possible.maximum.candidate.first;
                let peak = |possible: &Possible| possible.maximum.candidate.peak;
                of_line.sort_unstable_by_key(|p| (std::cmp::Reverse(peak(p)), position(p)));
                possible.truncate(from + MAX_IN_LINE);
                possible[from..].sort_unstable_by_key(position);
            }
            for possible in &mut possible[from..] {
                possible.maximum.candidate.count = count;
            }
        }
    }

    /// Selects one stripe after another from `left`.
    fn choose(&mut self, threshold: u32) {
        self.taken.clear();
        self.starts.clear();
        for stripe in 0..self.params.max_stripes {
            let is_worth_it = self.pick(threshold) || stripe == 0;
            if self.picked.is_empty() || !is_worth_it {
                break;
            }
            self.starts.push(self.taken.len());
            self.taken.extend(self.picked.iter().map(|&at| self.left[at as usize]));
            let (mut at, mut picked) = (0, self.picked.iter().peekable());
            self.left.retain(|_| {
                at += 1;
                picked.next_if_eq(&&(at - 1)).is_none()
            });
        }
    }

    /// Fills `picked` with the next stripe; returns true if it could be a stripe beside a stronger one.
    fn pick(&mut self, threshold: u32) -> bool {
        let Self { params, left, nodes, finder, picked, .. } = self;
        if params.peak_selection == PeakSelection::Continuity {
            nodes.clear();
            nodes.extend(left.iter().map(|Possible { line, maximum }| Node {
                line: *line,
                middle: maximum.middle,
                peak: maximum.candidate.peak,
            }));
            return finder.find(nodes, threshold, params.max_step_px, picked) > BREAK;
        }
        picked.clear();
        let mut from = 0;
        for line in left.chunk_by(|a, b| a.line == b.line) {
            let best = best_of(params.peak_selection, line, |left| &left.maximum.candidate);
            picked.extend(best.map(|best| from + best as u32));
            from += line.len() as u32;
        }
        true
    }

    /// Stores the selected stripes for the next frame.
    fn remember(&mut self) {
        self.tracker.clear();
        for (at, Possible { line, maximum }) in self.taken.iter().enumerate() {
            if self.starts.contains(&at) {
                self.tracker.start_stripe();
            }
            self.tracker.push(*line, maximum.middle);
        }
    }
}

/// Returns the index of the best candidate of a line; of equal ones the first.
fn best_of<T>(selection: PeakSelection, line: &[T], of: fn(&T) -> &Candidate) -> Option<usize> {
    let is_better = |candidate: &Candidate, best: &Candidate| match selection {
        PeakSelection::Brightest | PeakSelection::Continuity => candidate.peak > best.peak,
        PeakSelection::First => false,
        PeakSelection::Last => true,
        PeakSelection::Widest => candidate.length() > best.length(),
    };
    (0..line.len()).reduce(
        |best, other| {
            if is_better(of(&line[other]), of(&line[best])) { other } else { best }
        },
    )
}
