//! The frame about a stripe, independent of the stripe's direction.

use super::blur::Sample;
use crate::scanner::{channel::Plane, params::StripeDirection};

/// An image in stripe coordinates: for a horizontal stripe, a line is a column and a position is a row.
#[derive(Debug)]
pub(super) struct Picture<'a, S> {
    /// The frame.
    pub(crate) plane: &'a Plane<'a, S>,
    /// Direction of the stripe.
    pub(crate) direction: StripeDirection,
}

impl<S: Sample> Picture<'_, S> {
    /// Returns the number of lines, and of positions in each.
    pub(super) fn size(&self) -> (usize, usize) {
        match self.direction {
            StripeDirection::Horizontal => (self.plane.width, self.plane.height),
            StripeDirection::Vertical => (self.plane.height, self.plane.width),
        }
    }

    /// Returns the sample at a position; beyond the border the nearest one.
    #[inline(always)]
    pub(super) fn at(&self, line: isize, position: isize) -> f32 {
        let (x, y) = match self.direction {
            StripeDirection::Horizontal => (line, position),
            StripeDirection::Vertical => (position, line),
        };
        let x = x.clamp(0, self.plane.width as isize - 1) as usize;
        let y = y.clamp(0, self.plane.height as isize - 1) as usize;
        let sample: u32 = self.plane.at(x, y).into();
        sample as f32
    }
}
