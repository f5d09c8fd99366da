//! The numbers in the names of pictures: which ones are missing.

use std::collections::BTreeMap;

use super::natural::{is_number, runs};

/// Share of the names that must be numbered alike for the others to be odd.
const MOST: f64 = 0.6;

/// A longer gap is no loss of pictures but another series.
const MAX_GAP: u64 = 100_000;

/// Pictures that are missing between two others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Gap {
    /// Number of the first missing picture.
    pub(super) first: u64,
    /// Number of the last missing picture.
    pub(super) last: u64,
    /// How many there are.
    pub(super) count: u64,
}

/// The places of the pictures of a numbered series.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Numbering {
    /// Place of each picture, from 0, missing ones included.
    pub(super) places: Vec<u32>,
    /// The gaps.
    pub(super) gaps: Vec<Gap>,
}

impl Numbering {
    /// Returns the numbering of names in their natural order; `None` unless the names differ in one number only, which
    /// grows by the same step at least every second time and otherwise by multiples of it.
    pub(super) fn of(names: &[&[u8]]) -> Option<Self> {
        let numbers = numbers(names)?;
        let mut by_step = BTreeMap::<u64, usize>::new();
        for step in steps(&numbers) {
            *by_step.entry(step?).or_default() += 1;
        }
        // The smallest of the most frequent steps.
        let (&unit, &count) = by_step.iter().rev().max_by_key(|(_, count)| **count)?;
        let is_regular = by_step.keys().all(|step| step % unit == 0 && step / unit <= MAX_GAP);
        if !is_regular || 2 * count + 1 < numbers.len() {
            return None;
        }
        let first = *numbers.first()?;
        let place = |number: &u64| u32::try_from((number - first) / unit).ok();
        let gaps = numbers.iter().zip(numbers.iter().skip(1)).filter_map(|(&before, &after)| {
            let count = (after - before) / unit - 1;
            (count > 0).then_some(Gap { first: before + unit, last: after - unit, count })
        });
        Some(Self {
            places: numbers.iter().map(place).collect::<Option<_>>()?,
            gaps: gaps.collect(),
        })
    }

    /// Returns the number of missing pictures.
    pub(super) fn num_missing(&self) -> u64 {
        self.gaps.iter().map(|gap| gap.count).sum()
    }
}

/// Returns why names that look numbered have no [`Numbering`]: a number that two names have, or names that are not numbered
/// as most are.
pub(super) fn fault(names: &[&[u8]]) -> Option<String> {
    let text = |name| String::from_utf8_lossy(name).into_owned();
    let twice = |numbers: Vec<u64>| numbers.windows(2).position(|pair| pair[0] == pair[1]);
    if let Some(at) = numbers(names).and_then(twice) {
        return Some(format!(
            "{} and {} have the same number",
            text(names[at]),
            text(names[at + 1])
        ));
    }
    odd(names).map(|(name, count)| {
        format!(
            "{count} of {} names are not numbered like the others, the first is {}",
            names.len(),
            text(name)
        )
    })
}

/// Returns a name that is not numbered as most of the others are, and how many such names there are; `None` if there is no
/// such majority.
fn odd<'a>(names: &[&'a [u8]]) -> Option<(&'a [u8], usize)> {
    // Names that differ in their last number only are numbered alike.
    let pattern = |name: &'a [u8]| {
        let mut parts: Vec<_> = runs(name).collect();
        let last = parts.iter().rposition(|run| is_number(run));
        last.map(|at| parts.remove(at)).map(|_| parts)
    };
    let mut by_pattern = BTreeMap::<_, usize>::new();
    for name in names {
        *by_pattern.entry(pattern(name)).or_default() += 1;
    }
    let (usual, count) = by_pattern.into_iter().max_by_key(|(_, count)| *count)?;
    let is_usual = usual.is_some() && count as f64 > MOST * names.len() as f64;
    let first = names.iter().find(|name| pattern(name) != usual)?;
    is_usual.then_some((first, names.len() - count))
}

/// Steps between consecutive numbers; `None` for a step that is not positive.
fn steps(numbers: &[u64]) -> impl Iterator<Item = Option<u64>> {
    let pairs = numbers.iter().zip(numbers.iter().skip(1));
    pairs.map(|(before, after)| after.checked_sub(*before).filter(|&step| step > 0))
}

/// The number in which the names differ; `None` if they differ in anything else.
fn numbers(names: &[&[u8]]) -> Option<Vec<u64>> {
    let first: Vec<_> = runs(names.first()?).collect();
    let last: Vec<_> = runs(names.last()?).collect();
    let varying = first.iter().zip(&last).position(|(first, last)| first != last)?;
    let number = |name: &&[u8]| {
        let mut found = None;
        let mut num_runs = 0;
        for (at, run) in runs(name).enumerate() {
            num_runs += 1;
            if at == varying && is_number(run) {
                found = std::str::from_utf8(run).ok()?.parse().ok();
            } else if first.get(at) != Some(&run) {
                return None;
            }
        }
        if num_runs == first.len() { found } else { None }
    };
    names.iter().map(number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places, and first and last number of each gap.
    type Found = (Vec<u32>, Vec<(u64, u64)>);

    fn of(names: &[&str]) -> Option<Found> {
        let names: Vec<_> = names.iter().map(|name| name.as_bytes()).collect();
        let numbering = Numbering::of(&names)?;
        let gaps = numbering.gaps.iter().map(|gap| (gap.first, gap.last)).collect();
        Some((numbering.places, gaps))
    }

    #[test]
    fn missing_numbers_are_found() {
        assert_eq!(of(&["a1.png", "a2.png", "a3.png"]), Some((vec![0, 1, 2], vec![])));
        let with_gaps = ["a_07.png", "a_08.png", "a_11.png", "a_12.png", "a_14.png"];
        assert_eq!(of(&with_gaps), Some((vec![0, 1, 4, 5, 7], vec![(9, 10), (13, 13)])));
        let tens = ["f0000_c2.tif", "f0010_c2.tif", "f0020_c2.tif", "f0040_c2.tif"];
        assert_eq!(of(&tens), Some((vec![0, 1, 2, 4], vec![(30, 30)])));
    }

    #[test]
    fn names_that_break_a_numbering_are_found() {
        let odd_of = |names: &[&'static str]| {
            let names: Vec<_> = names.iter().map(|name| name.as_bytes()).collect();
            odd(&names).map(|(name, count)| (String::from_utf8_lossy(name).into_owned(), count))
        };
        let of = |name: &str| Some((name.to_owned(), 1));
        assert_eq!(odd_of(&["dark", "img1", "img2", "img4"]), of("dark"));
        assert_eq!(odd_of(&["img1", "img2", "img2 (1)", "img4"]), of("img2 (1)"));
        assert_eq!(odd_of(&["img1", "img2", "img3"]), None);
        assert_eq!(odd_of(&["left", "right", "top"]), None);
        assert_eq!(odd_of(&["a1", "a2", "b1", "b2"]), None, "two series of equal length");
        assert_eq!(odd_of(&[]), None);
        let twice = fault(&[b"f1", b"f2", b"f02", b"f3"]);
        assert_eq!(twice.as_deref(), Some("f2 and f02 have the same number"));
    }

    #[test]
    fn other_names_have_no_numbering() {
        for names in [
            &["left.png", "right.png"][..],
            &["a1.png", "b2.png", "b3.png"],
            &["a1_1.png", "a2_2.png", "a3_3.png"],
            &["1697712345.png", "1697712378.png", "1697712392.png"],
            &["a1.png", "a2.png", "a3.jpg"],
            &["a1.png", "a01.png"],
            &["a1.png", "a2.png", "a5000000.png", "a5000001.png"],
            &["a99999999999999999999.png", "a99999999999999999998.png"],
            &["a.png"],
            &[],
        ] {
            assert_eq!(of(names), None, "{names:?}");
        }
        assert_eq!(of(&["a3.png", "a17.png"]), Some((vec![0, 1], vec![])), "one step is the step");
    }
}
