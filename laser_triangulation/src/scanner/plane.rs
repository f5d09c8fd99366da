//! One channel of an image.

use thiserror::Error;

use super::{channel::SearchedRegion, image::MAX_SIDE_PX};

/// One channel of an image: a borrowed view of its samples, row by row.
#[derive(Clone, Copy, Debug)]
pub struct Plane<'a, S> {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Samples from the start of one row to the start of the next.
    pub(crate) stride: usize,
    /// The last row may end after `width` samples.
    pub(crate) samples: &'a [S],
}

impl<'a, S: Copy> Plane<'a, S> {
    /// Views `samples` as rows of `width` samples that start `stride` samples apart.
    ///
    /// # Errors
    /// A side that is zero or longer than [`MAX_SIDE_PX`], a stride shorter than a row, or fewer samples than the rows need.
    pub fn new(
        width: usize,
        height: usize,
        stride: usize,
        samples: &'a [S],
    ) -> Result<Self, PlaneError> {
        let sides = 1..=MAX_SIDE_PX as usize;
        let needed = |rows: usize| stride.checked_mul(rows)?.checked_add(width);
        let is_valid = sides.contains(&width)
            && sides.contains(&height)
            && stride >= width
            && needed(height - 1).is_some_and(|needed| samples.len() >= needed);
        if is_valid {
            Ok(Self { width, height, stride, samples })
        } else {
            Err(PlaneError { width, height, stride, samples: samples.len() })
        }
    }

    /// Columns.
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub const fn height(&self) -> usize {
        self.height
    }

    /// The samples of row `y`.
    ///
    /// # Panics
    /// If the plane has no row `y`.
    pub fn row(&self, y: usize) -> &'a [S] {
        &self.samples[y * self.stride..][..self.width]
    }

    /// The rows, from the top.
    pub fn rows(self) -> impl Iterator<Item = &'a [S]> {
        (0..self.height).map(move |y| self.row(y))
    }

    /// The sample in column `x` of row `y`.
    pub(crate) fn at(&self, x: usize, y: usize) -> S {
        self.samples[y * self.stride + x]
    }

    pub(super) fn crop(self, region: &SearchedRegion) -> Self {
        let samples = &self.samples[region.y * self.stride + region.x..];
        Plane { width: region.width, height: region.height, stride: self.stride, samples }
    }
}

/// A buffer does not hold a plane of the stated size.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{samples} samples cannot hold {width} x {height} pixels with rows {stride} samples apart")]
pub struct PlaneError {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Samples from the start of one row to the start of the next.
    pub stride: usize,
    /// Samples in the buffer.
    pub samples: usize,
}

/// A plane of 8-bit or of 16-bit samples.
#[derive(Clone, Copy, Debug)]
pub enum AnyPlane<'a> {
    /// 0 to 255.
    Eight(Plane<'a, u8>),
    /// 0 to 65535.
    Sixteen(Plane<'a, u16>),
}

impl<'a> From<Plane<'a, u8>> for AnyPlane<'a> {
    fn from(plane: Plane<'a, u8>) -> Self {
        Self::Eight(plane)
    }
}

impl<'a> From<Plane<'a, u16>> for AnyPlane<'a> {
    fn from(plane: Plane<'a, u16>) -> Self {
        Self::Sixteen(plane)
    }
}
