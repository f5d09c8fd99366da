//! The target that is shown to the camera, and its name on the command line.

use std::{fmt, str::FromStr};

use thiserror::Error;

use super::{
    board::Board,
    charuco::Charuco,
    checkerboard::Checkerboard,
    circle_grid::{CircleArrangement, CircleGrid},
};

/// Most points or squares a side of a target may have.
pub(super) const MAX_SIDE: u32 = 100;

/// A target of known size.
#[derive(Clone, Copy, Debug)]
pub enum Target {
    /// A checkerboard.
    Checkerboard(Checkerboard),
    /// A checkerboard with numbered markers in its white squares.
    Charuco(Charuco),
    /// A grid of circles.
    Circles(CircleGrid),
}

/// A target that cannot be read.
#[derive(Debug, Error, PartialEq)]
#[error(
    "{text:?} is not a valid target. Write one of these, with at most {MAX_SIDE} a side and lengths in metres, below 1, or as 40mm:\n  \
     checkerboard:8x6:0.040 (COLUMNSxROWS of inner corners, 3 or more; side of a square): 9 x 7 squares of 40 mm\n  \
     charuco:7x5:0.040:0.030:4x4_50 (COLUMNSxROWS of squares, as OpenCV counts, 4 or more; side of a square, side of a marker, \
     dictionary): dictionaries are 4x4_50 to 7x7_1000, apriltag_16h5 to apriltag_36h11, aruco_original and aruco_mip_36h12; \
     it must have enough markers for the board\n  \
     circles:8x6:0.030 (COLUMNSxROWS of circles, 3 or more; distance of their centres)\n  \
     asymmetric-circles:4x11:0.020 (circles of a row, rows; distance of neighbouring rows, half of that in a row)"
)]
pub struct TargetError {
    /// Text that cannot be parsed.
    text: String,
}

impl FromStr for Target {
    type Err = TargetError;

    fn from_str(text: &str) -> Result<Self, TargetError> {
        let parse = || match text.split_once(':')? {
            ("checkerboard", _) => text.parse().ok().map(Self::Checkerboard),
            ("charuco", numbers) => Charuco::parse(numbers).map(Self::Charuco),
            ("circles", numbers) => {
                CircleGrid::parse(CircleArrangement::Symmetric, numbers).map(Self::Circles)
            }
            ("asymmetric-circles", numbers) => {
                CircleGrid::parse(CircleArrangement::Asymmetric, numbers).map(Self::Circles)
            }
            _ => None,
        };
        parse().ok_or_else(|| TargetError { text: text.to_owned() })
    }
}

impl fmt::Display for Target {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Checkerboard(board) => board.fmt(formatter),
            Self::Charuco(board) => board.fmt(formatter),
            Self::Circles(grid) => grid.fmt(formatter),
        }
    }
}

impl Target {
    /// Returns the unit of [`Corner::place`](super::Corner::place), metres: the side of a square, or the pitch of a grid of circles.
    #[must_use]
    pub const fn unit_m(&self) -> f64 {
        match self {
            Self::Checkerboard(board) => board.square_m,
            Self::Charuco(board) => board.square_m,
            Self::Circles(grid) => grid.pitch_m,
        }
    }

    /// Returns the number of points of the whole target.
    #[must_use]
    pub const fn num_points(&self) -> usize {
        match self {
            Self::Checkerboard(board) => board.num_corners(),
            Self::Charuco(board) => board.num_corners(),
            Self::Circles(grid) => grid.num_circles(),
        }
    }

    /// Returns the columns and rows, in [units](Self::unit_m), that the points of the whole target span.
    pub(super) const fn span(&self) -> [u32; 2] {
        match self {
            Self::Checkerboard(board) => [board.columns, board.rows],
            Self::Charuco(board) => [board.columns - 1, board.rows - 1],
            Self::Circles(grid) => grid.span(),
        }
    }

    /// Returns true if the points are numbered: a part of the target is enough to place it.
    pub(super) const fn is_numbered(&self) -> bool {
        matches!(self, Self::Charuco(_))
    }

    /// Returns true if the board is large enough to tell the target from one of another size: if all of its points were
    /// found, or if they are numbered.
    #[must_use]
    pub fn is_identified(&self, board: &Board) -> bool {
        match self {
            Self::Checkerboard(target) => board.is_whole(target),
            Self::Charuco(_) => true,
            Self::Circles(grid) => board.corners.len() == grid.num_circles(),
        }
    }
}

/// Reads `COLUMNSxROWS`, each at least `min`.
pub(super) fn sides(text: &str, min: u32) -> Option<[u32; 2]> {
    let (columns, rows) = text.split_once('x')?;
    let side = |text: &str| text.parse().ok().filter(|side| (min..=MAX_SIDE).contains(side));
    Some([side(columns)?, side(rows)?])
}

/// Reads a length such as `0.04` or `40mm`. Returns metres. A metre and more is refused: such a number is
/// in millimetres.
pub(super) fn metres(text: &str) -> Option<f64> {
    let (number, unit_m) = match text.strip_suffix("mm") {
        Some(number) => (number, 1e-3),
        None => (text, 1.0),
    };
    let number: f64 = number.parse().ok()?;
    Some(number * unit_m).filter(|metres| (1e-6..1.0).contains(metres))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_survives_a_round_trip_through_text() {
        for text in [
            "checkerboard:8x6:0.04",
            "charuco:7x5:0.04:0.03:4x4_50",
            "charuco:10x14:0.02:0.015:apriltag_36h11",
            "circles:8x6:0.03",
            "asymmetric-circles:4x11:0.02",
        ] {
            let target: Target = text.parse().unwrap();
            assert_eq!(target.to_string(), text);
        }
        for (text, metres) in [("checkerboard:8x6:40mm", 0.04), ("circles:8x6:0.5mm", 5e-4)] {
            assert!((text.parse::<Target>().unwrap().unit_m() - metres).abs() < 1e-12, "{text}");
        }
        let usual: Target = "charuco:7x5:0.04:0.03".parse().unwrap();
        assert_eq!(usual.to_string(), "charuco:7x5:0.04:0.03:4x4_50");
        assert_eq!((usual.num_points(), usual.unit_m()), (24, 0.04));
    }

    #[test]
    fn an_invalid_target_is_rejected_with_examples() {
        for text in [
            "",
            "chess:8x6:0.04",
            "checkerboard:8x6",
            "charuco:7x5:0.04",
            "circles:2x6:0.03",
            "circles:8x6:30",
            "checkerboard:8x6:40um",
            "asymmetric-circles:4x11",
            "charuco:7x5:0.03:0.04:4x4_50",
            "charuco:7x5:0.04:0.03:8x8_50",
            "charuco:7x5:0.04:0.03:4x4_50:1",
            "charuco:7x3:0.04:0.03:4x4_50",
            // 60 markers.
            "charuco:12x10:0.04:0.03:4x4_50",
        ] {
            let error = text.parse::<Target>().unwrap_err().to_string();
            assert!(
                error.contains("checkerboard:8x6:0.040") && error.contains("charuco:7x5:0.040"),
                "{text}: {error}"
            );
        }
    }
}
