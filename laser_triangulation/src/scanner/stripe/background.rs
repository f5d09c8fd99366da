//! Removes light that is not the laser's from the blurred image before the stripe is searched.
//!
//! `local` subtracts the opening across the stripe, the largest of the smallest samples in a window. Structures at
//! least as wide as the window stay in the opening; narrower maxima are cut off. Blurred image minus opening is the
//! white top-hat (Meyer 1979; Soille, Morphological Image Analysis, 2nd ed., section 4.5). `reference` subtracts a
//! stored frame without laser.

use super::blur::Number;
use crate::scanner::params::{Background, ExtractionParams, StripeDirection};

/// Columns opened together: rows of the image are read in pieces of this many samples.
const BATCH: usize = 32;

/// Subtracts the background from each frame. Keeps its buffers.
#[derive(Debug)]
pub(super) struct BackgroundFilter<T> {
    kind: Background,
    /// Samples to either side of the middle of the opening's window.
    reach: usize,
    /// The blurred ambient frame; empty before [`Self::set_ambient`].
    ambient: Vec<T>,
    rows: Opening<T>,
    columns: Opening<[T; BATCH]>,
}

impl<T: Number> BackgroundFilter<T> {
    /// Creates a filter with these settings.
    pub(super) fn new(params: &ExtractionParams) -> Self {
        Self {
            kind: params.background,
            reach: params.background_window_px as usize / 2,
            ambient: Vec::new(),
            rows: Opening::default(),
            columns: Opening::default(),
        }
    }

    /// True if the image changes at all; [`Self::subtract`] then needs every sample of it.
    pub(super) const fn is_needed(&self) -> bool {
        !matches!(self.kind, Background::None)
    }

    /// Stores a blurred frame without laser light. It must have the size of the frames that follow.
    pub(super) fn set_ambient(&mut self, blurred: &[T]) {
        self.ambient.clear();
        self.ambient.extend_from_slice(blurred);
    }

    /// Subtracts the background from a blurred image of `width` columns.
    pub(super) fn subtract(&mut self, samples: &mut [T], width: usize, direction: StripeDirection) {
        match (self.kind, direction) {
            (Background::None, _) => {}
            (Background::Reference, _) => {
                for (sample, &ambient) in samples.iter_mut().zip(&self.ambient) {
                    *sample = above(*sample, ambient);
                }
            }
            (Background::Local, StripeDirection::Vertical) => {
                for row in samples.chunks_exact_mut(width) {
                    self.rows.line.clear();
                    self.rows.line.extend_from_slice(row);
                    self.rows.open(self.reach, Ord::min, Ord::max);
                    for (sample, &opened) in row.iter_mut().zip(&self.rows.line) {
                        *sample = above(*sample, opened);
                    }
                }
            }
            (Background::Local, StripeDirection::Horizontal) => {
                for from in (0..width).step_by(BATCH) {
                    self.subtract_columns(samples, width, from);
                }
            }
        }
    }

    fn subtract_columns(&mut self, samples: &mut [T], width: usize, from: usize) {
        let to = (from + BATCH).min(width);
        let opening = &mut self.columns;
        opening.line.clear();
        opening.line.extend(samples.chunks_exact(width).map(|row| {
            let mut batch = [T::default(); BATCH];
            batch[..to - from].copy_from_slice(&row[from..to]);
            batch
        }));
        opening.open(
            self.reach,
            |a, b| std::array::from_fn(|i| a[i].min(b[i])),
            |a, b| std::array::from_fn(|i| a[i].max(b[i])),
        );
        for (row, opened) in samples.chunks_exact_mut(width).zip(&opening.line) {
            for (sample, &opened) in row[from..to].iter_mut().zip(opened) {
                *sample = above(*sample, opened);
            }
        }
    }
}

/// Returns the excess of a sample over the background, at least 0.
fn above<T: Number>(sample: T, background: T) -> T {
    sample.max(background) - background
}

/// Opens lines one after another.
#[derive(Debug)]
struct Opening<E> {
    line: Vec<E>,
    /// Smallest (largest) sample from the start of a block of one window to here, and from here to its end.
    before: Vec<E>,
    behind: Vec<E>,
}

impl<E> Default for Opening<E> {
    fn default() -> Self {
        Self { line: Vec::new(), before: Vec::new(), behind: Vec::new() }
    }
}

impl<E: Copy> Opening<E> {
    /// Replaces `line` by its opening in windows of `2 reach + 1` samples. The ends of the line cut windows short.
    fn open(&mut self, reach: usize, min: impl Fn(E, E) -> E, max: impl Fn(E, E) -> E) {
        self.slide(reach, min);
        self.slide(reach, max);
    }

    /// Computes the extreme of every window with three comparisons a sample, for any window length: van Herk 1992 (doi
    /// 10.1016/0167-8655(92)90069-C), Gil and Werman 1993 (doi 10.1109/34.211471).
    fn slide(&mut self, reach: usize, extreme: impl Fn(E, E) -> E) {
        let Self { line, before, behind } = self;
        let (length, window) = (line.len(), 2 * reach + 1);
        before.clear();
        before.extend_from_slice(line);
        behind.clear();
        behind.extend_from_slice(line);
        for at in 1..length {
            if at % window != 0 {
                before[at] = extreme(before[at - 1], before[at]);
            }
        }
        for at in (1..length).rev() {
            if at % window != 0 {
                behind[at - 1] = extreme(behind[at - 1], behind[at]);
            }
        }
        for (at, sample) in line.iter_mut().enumerate() {
            let (first, last) = (at.saturating_sub(reach), (at + reach).min(length - 1));
            *sample = match (first / window == last / window, first % window == 0) {
                (false, _) => extreme(behind[first], before[last]),
                (true, true) => before[last],
                // Only the end of the line cuts a window short within a block.
                (true, false) => behind[first],
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{super::reference::opened, *};
    use proptest::prelude::*;

    #[test]
    fn what_is_wider_than_the_window_is_background() {
        let line = [9, 9, 9, 0, 0, 5, 5, 0, 3, 3, 3, 3, 3, 8, 3, 3];
        // Windows of 3: the plateau of 2 is narrower, the one of 3 at the border and the one of 5 are not.
        assert_eq!(opened(&line, 3), [9, 9, 9, 0, 0, 0, 0, 0, 3, 3, 3, 3, 3, 3, 3, 3]);
        assert!(opened(&[], 3).is_empty());
    }

    proptest! {
        #[test]
        fn sliding_windows_equal_the_definition(
            line in prop::collection::vec(any::<u32>(), 0..90),
            window_px in 1..60_u32,
        ) {
            let mut opening = Opening { line: line.clone(), ..Opening::default() };
            opening.open(window_px as usize / 2, u32::min, u32::max);
            prop_assert_eq!(opening.line, opened(&line, window_px));
        }
    }
}
