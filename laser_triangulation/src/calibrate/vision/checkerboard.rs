//! The checkerboard that is shown to the camera.

use std::{fmt, str::FromStr};

use thiserror::Error;

use super::target::{self, MAX_SIDE};

/// Fewest inner corners a side of a board may have.
const MIN_SIDE: u32 = 3;

/// A checkerboard, defined by its inner corners, where four squares meet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Checkerboard {
    /// Inner corners along one side.
    pub columns: u32,
    /// Inner corners along the other side.
    pub rows: u32,
    /// Side of a square, metres.
    pub square_m: f64,
}

/// A target that cannot be read.
#[derive(Debug, Error, PartialEq)]
#[error(
    "{text:?} is not a valid target: write checkerboard:COLUMNSxROWS:SQUARE with inner corners ({MIN_SIDE} to {MAX_SIDE}) and \
     metres, as checkerboard:8x6:0.040 for 9 x 7 squares of 40 mm"
)]
pub struct CheckerboardError {
    /// Text that cannot be parsed.
    text: String,
}

impl FromStr for Checkerboard {
    type Err = CheckerboardError;

    fn from_str(text: &str) -> Result<Self, CheckerboardError> {
        parse(text).ok_or_else(|| CheckerboardError { text: text.to_owned() })
    }
}

fn parse(text: &str) -> Option<Checkerboard> {
    let (sides, square) = text.strip_prefix("checkerboard:")?.split_once(':')?;
    let [columns, rows] = target::sides(sides, MIN_SIDE)?;
    Some(Checkerboard { columns, rows, square_m: target::metres(square)? })
}

impl Checkerboard {
    /// Returns the number of inner corners of the whole board.
    pub const fn num_corners(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// Returns true if a grid of corners fits onto the board, either way round.
    pub(crate) fn holds(&self, columns: u32, rows: u32) -> bool {
        let fits = |columns, rows| columns <= self.columns && rows <= self.rows;
        fits(columns, rows) || fits(rows, columns)
    }
}

impl fmt::Display for Checkerboard {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "checkerboard:{}x{}:{}", self.columns, self.rows, self.square_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_survives_a_round_trip_through_text() {
        let board: Checkerboard = "checkerboard:8x6:0.04".parse().unwrap();
        assert_eq!(board, Checkerboard { columns: 8, rows: 6, square_m: 0.04 });
        assert_eq!(board.to_string().parse(), Ok(board));
        assert!(board.holds(8, 6) && board.holds(6, 8) && board.holds(3, 2));
        assert!(!board.holds(8, 7) && !board.holds(9, 6));
    }

    #[test]
    fn an_invalid_target_is_rejected_with_an_example() {
        for text in [
            "",
            "chess:8x6:0.04",
            "checkerboard:8x6",
            "checkerboard:8x6:40",
            "checkerboard:2x6:0.04",
            "checkerboard:8x6:nan",
            "checkerboard:-8x6:0.04",
            "checkerboard:8x6:0",
        ] {
            let error = text.parse::<Checkerboard>().unwrap_err().to_string();
            assert!(error.contains("checkerboard:8x6:0.040"), "{text}: {error}");
        }
    }
}
