//! `peak_selection: continuity`: selects the candidates that together form the brightest unbroken line along the
//! stripe.
//!
//! Dynamic programming over the lines, as in the tracking of ridges and seams (Amini, Weymouth and Jain 1990, doi
//! 10.1109/34.57681). Of all sequences with at most one candidate per line it finds the one with the largest brightness
//! minus the cost of its steps and breaks. It uses integers, so the result does not depend on the order of sums. Time
//! is linear in the candidates: each is compared with those of the [`REACH`] lines before it.

/// A candidate, reduced to its line, position and brightness.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Node {
    /// Its line; nodes come in order of their lines.
    pub(crate) line: u32,
    /// Position across the stripe, half pixels.
    pub(crate) middle: u32,
    /// Largest blurred sample above the background, blurred units.
    pub(crate) peak: u32,
}

/// Number of consecutive lines that a stripe may miss without being broken.
pub(super) const REACH: u32 = 8;
/// Score of a candidate exactly at the segment threshold.
const WORTH: i64 = 256;
/// Upper limit of a score, as a multiple of [`WORTH`]: beyond this multiple of the threshold, brightness carries no
/// information.
const MAX_TIMES: u64 = 4;
/// Cost of a break: the path includes an isolated group only if its score is higher. Equals six lines at the threshold.
pub(super) const BREAK: i64 = 6 * WORTH;
/// Cost of the largest step without a break; smaller steps cost proportionally less.
const LARGEST_STEP: i64 = WORTH;

/// Finds one line at a time. Keeps its buffers.
#[derive(Debug, Clone, Default)]
pub(super) struct LineFinder {
    /// For each node: the score of the best line that ends there.
    totals: Vec<i64>,
    /// For each node: its predecessor on that line.
    previous: Vec<Option<u32>>,
}

impl LineFinder {
    /// Replaces `line` by the ascending indices of the nodes of the best line and returns its score; `line` is empty if
    /// there are no nodes. `threshold` is the segment threshold in blurred units, `max_step_px` the largest movement of
    /// a stripe from one line to the next.
    pub(super) fn find(
        &mut self,
        nodes: &[Node],
        threshold: u32,
        max_step_px: f64,
        line: &mut Vec<u32>,
    ) -> i64 {
        // Largest step in half pixels, and the cost of one half pixel.
        let max_step = (2.0 * max_step_px).ceil().max(1.0) as i64;
        self.totals.clear();
        self.previous.clear();
        // Best end in all lines before this node's, and in this node's line so far.
        let (mut best, mut best_here) = (None, None);
        let mut first_near = 0;
        for (at, node) in nodes.iter().enumerate() {
            if at > 0 && nodes[at - 1].line != node.line {
                best = better(best, best_here);
            }
            while nodes[first_near].line + REACH < node.line {
                first_near += 1;
            }
            let mut from = best.map_or((0, None), |(total, end)| (total - BREAK, Some(end)));
            if from.0 <= 0 {
                from = (0, None);
            }
            for (near, before) in (first_near..at).zip(&nodes[first_near..at]) {
                let lines = i64::from(node.line - before.line);
                let step = i64::from(node.middle.abs_diff(before.middle));
                if lines > 0 && step <= max_step * lines {
                    let total = self.totals[near] - LARGEST_STEP * step / max_step;
                    if total > from.0 {
                        from = (total, Some(near as u32));
                    }
                }
            }
            let total = from.0 + worth(node.peak, threshold);
            self.totals.push(total);
            self.previous.push(from.1);
            best_here = better(best_here, Some((total, at as u32)));
        }
        line.clear();
        let last = better(best, best_here);
        let mut end = last.map(|(_, end)| end);
        while let Some(at) = end {
            line.push(at);
            end = self.previous[at as usize];
        }
        line.reverse();
        last.map_or(0, |(total, _)| total)
    }
}

/// Returns the better of two ends; of equal ones the earlier.
fn better(one: Option<(i64, u32)>, other: Option<(i64, u32)>) -> Option<(i64, u32)> {
    match (one, other) {
        (Some(a), Some(b)) => Some(if b.0 > a.0 { b } else { a }),
        (a, b) => a.or(b),
    }
}

fn worth(peak: u32, threshold: u32) -> i64 {
    let (peak, threshold) = (u64::from(peak), u64::from(threshold.max(1)));
    (WORTH as u64 * peak.min(MAX_TIMES * threshold) / threshold) as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn find(nodes: &mut [Node], max_step_px: f64) -> Vec<(u32, u32)> {
        nodes.sort_by_key(|node| (node.line, node.middle));
        let mut line = Vec::new();
        LineFinder::default().find(nodes, 100, max_step_px, &mut line);
        line.into_iter().map(|at| (nodes[at as usize].line, nodes[at as usize].middle)).collect()
    }

    fn stripe(lines: std::ops::Range<u32>, middle: u32, peak: u32) -> Vec<Node> {
        lines.map(|line| Node { line, middle, peak }).collect()
    }

    #[test]
    fn brighter_clutter_beside_the_line_is_passed_by() {
        let mut nodes = stripe(0..100, 40, 200);
        nodes.extend(stripe(50..55, 90, 4000));
        nodes.extend(stripe(70..71, 10, 4000));
        assert_eq!(find(&mut nodes, 3.0), (0..100).map(|line| (line, 40)).collect::<Vec<_>>());
    }

    #[test]
    fn gaps_and_jumps_are_part_of_the_line() {
        let mut nodes = stripe(0..40, 40, 200);
        nodes.extend(stripe(60..100, 300, 200));
        assert_eq!(find(&mut nodes, 3.0).len(), 80);
        // In the gap: a few bright pixels that do not belong to the stripe, and a piece that is long enough.
        nodes.extend(stripe(45..47, 900, 200));
        assert_eq!(find(&mut nodes, 3.0).len(), 80);
        nodes.extend(stripe(42..58, 700, 400));
        assert_eq!(find(&mut nodes, 3.0).len(), 96);
    }

    #[test]
    fn a_slope_up_to_the_largest_step_is_followed() {
        let slope = |step: u32| {
            let mut nodes: Vec<Node> =
                (0..100).map(|line| Node { line, middle: step * line, peak: 200 }).collect();
            nodes.extend(stripe(0..100, 1000, 120));
            find(&mut nodes, 3.0)
        };
        assert_eq!(slope(4)[50], (50, 200));
        assert_eq!(slope(8)[50], (50, 1000), "too steep: a line of jumps");
    }

    #[test]
    fn nothing_gives_nothing() {
        assert_eq!(find(&mut [], 3.0), []);
        assert_eq!(find(&mut [Node { line: 7, middle: 3, peak: 0 }], 3.0), [(7, 3)]);
    }
}
