//! Selects the stripe among several candidates in one cross-section.
//!
//! First drops candidates that are too faint, too narrow or too wide, then those too far from the last frame's stripes.
//! From the rest it selects one candidate per line, once for each allowed stripe. A run with a valley counts as several
//! candidates.

use super::{
    blur::UNITS,
    continuity::{BREAK, LineFinder, Node},
    section::{Candidate, Levels, LineCandidate},
    split::split,
    tracking::Tracker,
    valley::ValleyNoise,
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
    candidate: Candidate,
    /// Half pixels: the middle of its largest samples for [`PeakSelection::Continuity`], else of the candidate.
    middle: u32,
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
        let deepest_noise = levels.valleys.limit(levels.segment_threshold);
        let is_whole = |found: &LineCandidate| found.candidate.dip <= deepest_noise;
        let is_alone = |pair: &[LineCandidate]| pair[0].line != pair[1].line;
        // Most frames have one candidate with one maximum per line, and nothing to select.
        if self.is_plain() && found.windows(2).all(is_alone) && found.iter().all(is_whole) {
            chosen.extend_from_slice(found);
            return;
        }
        self.limit(found, levels, sample);
        let margin = self.params.tracking_margin_px.unwrap_or(0).saturating_mul(2);
        let last_frame = self.tracker.num_points();
        if margin > 0 && last_frame > 0 {
            let is_near =
                |possible: &&Possible| self.tracker.is_near(possible.line, possible.middle, margin);
            self.left.clear();
            self.left.extend(self.possible.iter().filter(is_near));
            self.choose(levels);
        }
        // No track, or the track was lost.
        if margin == 0 || last_frame == 0 || 2 * self.taken.len() < last_frame {
            self.left.clone_from(&self.possible);
            self.choose(levels);
        }
        if margin > 0 {
            self.remember();
        }
        chosen.extend(
            self.taken
                .iter()
                .map(|&Possible { line, candidate, .. }| LineCandidate { line, candidate }),
        );
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
        let deepest_noise = levels.valleys.limit(levels.segment_threshold);
        let is_continuity = params.peak_selection == PeakSelection::Continuity;
        possible.clear();
        for in_line in found.chunk_by(|a, b| a.line == b.line) {
            let from = possible.len();
            for &LineCandidate { line, candidate } in in_line {
                let sample = |at: u32| sample(line, at);
                let mut put = |candidate: Candidate, middle: u32| {
                    if candidate.peak >= min_peak && widths.contains(&candidate.length()) {
                        possible.push(Possible { line, candidate, middle });
                    }
                };
                if is_continuity {
                    split(&candidate, &levels.valleys, sample, |part| {
                        let (candidate, middle) = part.core(sample);
                        put(candidate, middle);
                    });
                } else if candidate.dip <= deepest_noise {
                    put(candidate, candidate.first + candidate.last);
                } else {
                    split(&candidate, &levels.valleys, sample, |part| {
                        let candidate = part.candidate();
                        put(candidate, candidate.first + candidate.last);
                    });
                }
            }
            let count = (possible.len() - from) as u32;
            if is_continuity && count as usize > MAX_IN_LINE {
                let of_line = &mut possible[from..];
                let position = |possible: &Possible| possible.candidate.first;
                let peak = |possible: &Possible| possible.candidate.peak;
                of_line.sort_unstable_by_key(|p| (std::cmp::Reverse(peak(p)), position(p)));
                possible.truncate(from + MAX_IN_LINE);
                possible[from..].sort_unstable_by_key(position);
            }
            for possible in &mut possible[from..] {
                possible.candidate.count = count;
            }
        }
    }

    /// Selects one stripe after another from `left`.
    fn choose(&mut self, levels: &Levels<'_>) {
        self.taken.clear();
        self.starts.clear();
        for stripe in 0..self.params.max_stripes {
            let is_worth_it = self.pick(levels) || stripe == 0;
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
    fn pick(&mut self, levels: &Levels<'_>) -> bool {
        let Self { params, left, nodes, finder, picked, .. } = self;
        if params.peak_selection == PeakSelection::Continuity {
            nodes.clear();
            nodes.extend(left.iter().map(|Possible { line, candidate, middle }| Node {
                line: *line,
                middle: *middle,
                peak: candidate.peak,
            }));
            let threshold = levels.segment_threshold;
            return finder.find(nodes, threshold, params.max_step_px, picked) > BREAK;
        }
        picked.clear();
        let (mut from, mut previous) = (0, None);
        for line in left.chunk_by(|a, b| a.line == b.line) {
            if let Some(best) = best_of(params.peak_selection, line, previous, &levels.valleys) {
                previous = Some(line[best]);
                picked.push(from + best as u32);
            }
            from += line.len() as u32;
        }
        true
    }

    /// Stores the selected stripes for the next frame.
    fn remember(&mut self) {
        self.tracker.clear();
        for (at, Possible { line, middle, .. }) in self.taken.iter().enumerate() {
            if self.starts.contains(&at) {
                self.tracker.start_stripe();
            }
            self.tracker.push(*line, *middle);
        }
    }
}

/// Returns the index of the best candidate of a line; of equal ones the first. Of several that are the brightest within
/// noise, it is the one nearest to that of the line before, so that two equal stripes are not mixed.
fn best_of(
    selection: PeakSelection,
    line: &[Possible],
    previous: Option<Possible>,
    noise: &ValleyNoise,
) -> Option<usize> {
    let is_better = |candidate: &Candidate, best: &Candidate| match selection {
        PeakSelection::Brightest | PeakSelection::Continuity => candidate.peak > best.peak,
        PeakSelection::First => false,
        PeakSelection::Last => true,
        PeakSelection::Widest => candidate.length() > best.length(),
    };
    let best = (0..line.len()).reduce(|best, other| {
        if is_better(&line[other].candidate, &line[best].candidate) { other } else { best }
    })?;
    match previous {
        Some(previous) if selection == PeakSelection::Brightest && line.len() > 1 => {
            let peak = line[best].candidate.peak;
            let faintest = peak - noise.limit(peak) / 2;
            let is_bright = |&at: &usize| line[at].candidate.peak >= faintest;
            let distance = |&at: &usize| line[at].middle.abs_diff(previous.middle);
            (0..line.len()).filter(is_bright).min_by_key(distance)
        }
        _ => Some(best),
    }
}
