//! The grid of circles, symmetric or asymmetric.

use std::fmt;

use super::target;

/// Fewest circles a side of a grid may have.
const MIN_SIDE: u32 = 3;

/// The arrangement of the circles, as OpenCV's `findCirclesGrid` has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CircleArrangement {
    /// In columns and rows.
    Symmetric,
    /// Every other row is shifted by half of the distance between neighbours of a row.
    Asymmetric,
}

/// A grid of equal circles, dark on a light ground or light on a dark one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CircleGrid {
    /// Arrangement of the circles.
    pub arrangement: CircleArrangement,
    /// Circles of a row.
    pub columns: u32,
    /// Rows.
    pub rows: u32,
    /// Distance between neighbouring rows, metres: in a symmetric grid also that between the centres of a row, in an
    /// asymmetric grid half of it.
    pub pitch_m: f64,
}

impl CircleGrid {
    /// Reads `COLUMNSxROWS:PITCH`.
    pub(super) fn parse(arrangement: CircleArrangement, text: &str) -> Option<Self> {
        let (sides, pitch) = text.split_once(':')?;
        let [columns, rows] = target::sides(sides, MIN_SIDE)?;
        Some(Self { arrangement, columns, rows, pitch_m: target::metres(pitch)? })
    }

    /// Returns the number of circles of the whole grid.
    pub const fn num_circles(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// Returns the columns and rows, in pitches, that the centres of the whole grid span.
    pub(super) const fn span(&self) -> [u32; 2] {
        match self.arrangement {
            CircleArrangement::Symmetric => [self.columns, self.rows],
            CircleArrangement::Asymmetric => [2 * self.columns, self.rows],
        }
    }
}

impl fmt::Display for CircleGrid {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self.arrangement {
            CircleArrangement::Symmetric => "circles",
            CircleArrangement::Asymmetric => "asymmetric-circles",
        };
        write!(formatter, "{name}:{}x{}:{}", self.columns, self.rows, self.pitch_m)
    }
}
