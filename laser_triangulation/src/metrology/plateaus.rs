//! Straight pieces of a line that jumps between them, such as the image of a stair gauge.

use std::ops::Range;

use thiserror::Error;

use crate::statistics::{median, sigma_about_zero};

/// Most points of a line before it is thinned out: the search time grows with the square of their number.
const MAX_SEARCHED: usize = 2048;
/// Fewest points of a plateau.
const MIN_POINTS: usize = 12;
/// Window of the median that removes single wrong points from the search.
const MEDIAN_REACH: usize = 3;
/// Number of additional plateaus that are searched, so that a surplus is detected.
const MORE: usize = 3;
/// Smallest jump between plateaus, pixels, and in standard deviations of the points.
const MIN_JUMP_PX: f64 = 0.3;
const MIN_JUMP_SIGMA: f64 = 6.0;
/// A further jump counts if it reaches this share of the smallest expected one, or this many pixels.
const MORE_SHARE: f64 = 0.3;
const MORE_JUMP_PX: f64 = 1.0;
/// Divisor: this fraction of a plateau is left out at each of its ends.
const TRIM: usize = 6;

/// The reason why a line cannot be cut into plateaus.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PlateauError {
    /// The line is too short.
    #[error("the line has {num} points; {wanted} plateaus need {} or more", .wanted * MIN_POINTS)]
    TooShort {
        /// Points of the line.
        num: usize,
        /// Number of plateaus expected.
        wanted: usize,
    },
    /// No line can be fitted through a plateau.
    #[error("plateau {plateau} has too few points")]
    TooFewPoints {
        /// Number of the plateau along the stripe, from 0.
        plateau: usize,
    },
    /// The number of plateaus differs from the number of heights.
    #[error("{} given, but the line has {}{}: {}", heights(*.wanted), plateaus(*.found), at_least(*.found, *.wanted), listed(.places))]
    Count {
        /// Heights given.
        wanted: usize,
        /// Plateaus found.
        found: usize,
        /// Their first and last positions along the line, in its unit; pixels for a stripe.
        places: Vec<[f64; 2]>,
    },
}

fn heights(num: usize) -> String {
    if num == 1 { "1 height is".into() } else { format!("{num} heights are") }
}

fn plateaus(num: usize) -> String {
    if num == 1 { "1 plateau".into() } else { format!("{num} plateaus") }
}

fn at_least(found: usize, wanted: usize) -> &'static str {
    if found == wanted + MORE { " or more" } else { "" }
}

fn listed(places: &[[f64; 2]]) -> String {
    let places: Vec<_> = places.iter().map(|[from, to]| format!("{from:.0} to {to:.0}")).collect();
    format!("{} along the stripe, pixels (the parameters roi.* choose a part)", places.join(", "))
}

/// A plateau as indices into the line's points.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    /// From border to border.
    pub(crate) whole: Range<usize>,
    /// Without the outer sixths, which blur and the edges of the gauge spoil.
    pub(crate) inner: Range<usize>,
}

/// Cuts a line into `count` plateaus: pieces that are straight, perhaps inclined, with a jump at every border.
///
/// `points` are (along, across) in pixels, ascending along the stripe. The cuts are those of the smallest sum of squared
/// distances from straight pieces, found by dynamic programming (Bellman 1961).
///
/// # Errors
/// Too few points, or a number of plateaus other than `count`.
pub(crate) fn cut(points: &[[f64; 2]], count: usize) -> Result<Vec<Piece>, PlateauError> {
    let num = points.len();
    if count == 0 || num < count * MIN_POINTS {
        return Err(PlateauError::TooShort { num, wanted: count });
    }
    let stride = num.div_ceil(MAX_SEARCHED);
    let thinned: Vec<[f64; 2]> = medians(points).into_iter().step_by(stride).collect();
    let min_length = (MIN_POINTS / stride).max(thinned.len() / 50).max(3);
    let cuts = Cuts::search(&thinned, count + MORE, min_length);
    let least = MIN_JUMP_PX.max(MIN_JUMP_SIGMA * noise_of(points));
    let smallest = |pieces: &[Range<usize>]| {
        let jumps = pieces.windows(2).map(|pair| jump(&thinned, &pair[0], &pair[1]));
        jumps.fold(f64::INFINITY, f64::min)
    };
    let wanted = cuts.pieces(count).filter(|pieces| smallest(pieces) > least);
    let of_wanted = wanted.as_deref().map_or(f64::INFINITY, smallest);
    let more = if of_wanted.is_finite() { MORE_SHARE * of_wanted } else { 0.0 };
    let more = more.max(MORE_JUMP_PX).max(least);
    let found = (1..=count + MORE).rev().find_map(|number| {
        let pieces = cuts.pieces(number)?;
        let limit = if number > count { more } else { least };
        (number == 1 || smallest(&pieces) > limit).then_some(pieces)
    });
    let found = found.unwrap_or_default();
    if found.len() != count {
        let along = |at: usize| thinned[at][0];
        let places = found.iter().map(|piece| [along(piece.start), along(piece.end - 1)]).collect();
        return Err(PlateauError::Count { wanted: count, found: found.len(), places });
    }
    Ok(found.iter().map(|piece| piece_of(piece, stride, num)).collect())
}

/// A piece of the thinned line, as indices into the whole one.
fn piece_of(piece: &Range<usize>, stride: usize, num: usize) -> Piece {
    let (start, end) = (piece.start * stride, (piece.end * stride).min(num));
    let trim = (end - start) / TRIM;
    Piece { whole: start..end, inner: start + trim..end - trim }
}

fn medians(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut window = Vec::with_capacity(2 * MEDIAN_REACH + 1);
    let median_at = |at: usize, window: &mut Vec<f64>| {
        let range = at.saturating_sub(MEDIAN_REACH)..(at + MEDIAN_REACH + 1).min(points.len());
        window.clear();
        window.extend(points[range].iter().map(|point| point[1]));
        median(window).unwrap_or(f64::NAN)
    };
    (0..points.len()).map(|at| [points[at][0], median_at(at, &mut window)]).collect()
}

/// Returns the standard deviation of a point, from differences of neighbours; up to half of them may contain a jump.
fn noise_of(points: &[[f64; 2]]) -> f64 {
    let mut steps: Vec<f64> =
        points.windows(2).map(|pair| (pair[1][1] - pair[0][1]).abs()).collect();
    sigma_about_zero(&mut steps).map_or(0.0, |sigma| sigma / std::f64::consts::SQRT_2)
}

/// Returns the distance of two straight pieces where they meet.
fn jump(points: &[[f64; 2]], left: &Range<usize>, right: &Range<usize>) -> f64 {
    let sums = Sums::new(points);
    let at = 0.5 * (points[left.end - 1][0] + points[right.start][0]);
    (sums.line(left).at(at) - sums.line(right).at(at)).abs()
}

/// A straight piece.
struct Straight {
    mean: [f64; 2],
    slope: f64,
    squares: f64,
}

impl Straight {
    fn at(&self, along: f64) -> f64 {
        self.mean[1] + self.slope * (along - self.mean[0])
    }
}

/// Running sums: a straight line through any piece has a constant cost.
struct Sums(Vec<[f64; 5]>, [f64; 2]);

impl Sums {
    fn new(points: &[[f64; 2]]) -> Self {
        // Relative to the middle, to reduce rounding errors.
        let middle = points[points.len() / 2];
        let mut sums = Vec::with_capacity(points.len() + 1);
        let mut sum = [0.0; 5];
        sums.push(sum);
        for point in points {
            let (u, v) = (point[0] - middle[0], point[1] - middle[1]);
            for (sum, term) in sum.iter_mut().zip([u, v, u * u, u * v, v * v]) {
                *sum += term;
            }
            sums.push(sum);
        }
        Self(sums, middle)
    }

    fn line(&self, piece: &Range<usize>) -> Straight {
        let (from, to) = (&self.0[piece.start], &self.0[piece.end]);
        let n = (piece.end - piece.start) as f64;
        let [u, v, uu, uv, vv] = [0, 1, 2, 3, 4].map(|i| to[i] - from[i]);
        let (suu, suv, svv) = (uu - u * u / n, uv - u * v / n, vv - v * v / n);
        let slope = if suu > 0.0 { suv / suu } else { 0.0 };
        let mean = [u / n + self.1[0], v / n + self.1[1]];
        Straight { mean, slope, squares: (svv - slope * suv).max(0.0) }
    }
}

/// The best cuts into 1, 2, … pieces.
struct Cuts {
    /// Start of the last piece, for each number of pieces and each end; `usize::MAX`: not possible.
    starts: Vec<Vec<usize>>,
}

impl Cuts {
    fn search(points: &[[f64; 2]], max_pieces: usize, min_length: usize) -> Self {
        let num = points.len();
        let sums = Sums::new(points);
        let mut costs = vec![f64::INFINITY; num + 1];
        costs[0] = 0.0;
        let mut starts = Vec::new();
        for _ in 0..max_pieces {
            let mut next = vec![f64::INFINITY; num + 1];
            let mut begins = vec![usize::MAX; num + 1];
            for end in min_length..=num {
                for (start, before) in costs[..=end - min_length].iter().enumerate() {
                    if before.is_infinite() {
                        continue;
                    }
                    let cost = before + sums.line(&(start..end)).squares;
                    if cost < next[end] {
                        (next[end], begins[end]) = (cost, start);
                    }
                }
            }
            starts.push(begins);
            costs = next;
        }
        Self { starts }
    }

    /// Returns the pieces of the best cut into that many; `None` if they would be too short.
    fn pieces(&self, number: usize) -> Option<Vec<Range<usize>>> {
        let mut end = self.starts[0].len() - 1;
        let mut pieces = Vec::new();
        for begins in self.starts[..number].iter().rev() {
            let start = *begins.get(end).filter(|start| **start != usize::MAX)?;
            pieces.push(start..end);
            end = start;
        }
        pieces.reverse();
        (end == 0).then_some(pieces)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// Returns a line of 600 points with equal pieces at the given levels, an inclination, noise and some wrong points.
    fn stair(levels: &[f64], slope: f64, noise: f64) -> Vec<[f64; 2]> {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        (0..600)
            .map(|i| {
                let along = 100.0 + i as f64;
                let normal: f64 = StandardNormal.sample(&mut random);
                let wrong = if i % 97 == 50 { 40.0 } else { 0.0 };
                [along, levels[i * levels.len() / 600] + slope * along + noise * normal + wrong]
            })
            .collect()
    }

    #[test]
    fn a_stair_is_cut_at_its_jumps() {
        for (noise, slope) in [(0.05, 0.0), (0.2, 0.01), (0.0, -0.02)] {
            let pieces = cut(&stair(&[300.0, 290.0, 270.0, 275.0], slope, noise), 4).unwrap();
            for (at, Piece { inner: piece, .. }) in pieces.iter().enumerate() {
                let [from, to] = [at * 150 + 25, at * 150 + 125];
                assert!(piece.start.abs_diff(from) < 4 && piece.end.abs_diff(to) < 4, "{piece:?}");
            }
        }
    }

    #[test]
    fn a_different_number_of_plateaus_is_an_error_with_their_positions() {
        let stair = stair(&[300.0, 290.0, 300.0], 0.0, 0.1);
        let error = cut(&stair, 1).unwrap_err().to_string();
        assert!(error.contains("1 height is given") && error.contains("3 plateaus"), "{error}");
        assert!(error.contains("100 to 299"), "{error}");
        let error = cut(&stair, 5).unwrap_err().to_string();
        assert!(error.contains("3 plateaus"), "{error}");
        assert_eq!(cut(&stair[..20], 3), Err(PlateauError::TooShort { num: 20, wanted: 3 }));
    }

    #[test]
    fn a_bent_line_is_one_plateau() {
        let bent: Vec<_> = (0..600)
            .map(|i| f64::from(i) / 300.0 - 1.0)
            .map(|u| [300.0 * u, 100.0 + 6.0 * u * u])
            .collect();
        assert_eq!(cut(&bent, 1).unwrap(), vec![Piece { whole: 0..600, inner: 100..500 }]);
    }
}
