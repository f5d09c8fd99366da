//! A grid of circles in a picture.

use calib_targets_chessboard::{
    ChessboardDetector, ChessboardParams, ChessboardParamsError, GrayImageView,
    default_chess_config, detect_corners,
};
use thiserror::Error;

use super::{
    board::{Board, BoardRejected, Corner},
    circle_grid::CircleGrid,
    circle_lattice::{self, Lattice},
    ellipses,
    picture::GrayPicture,
};

/// Fewest circles that are a grid.
const MIN_CIRCLES: usize = 9;
/// Fewest circles that are named where squares are wanted.
const MIN_INSTEAD: usize = 16;
/// Fewest corners that are a checkerboard.
const MIN_CORNERS: usize = 9;

/// The reason why a picture shows no usable grid of circles.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CirclesRejected {
    /// No grid was found.
    #[error("no grid of circles")]
    None,
    /// Too few circles are visible.
    #[error("only {found} circles of the grid, at least {needed} are needed")]
    Few {
        /// Circles found.
        found: usize,
        /// Circles required.
        needed: usize,
    },
    /// The grid does not match the target.
    #[error("{found}, the target is {target}")]
    Another {
        /// The number found.
        found: String,
        /// Expected grid.
        target: String,
    },
    /// The picture shows circles where squares are wanted.
    #[error("no board, but {found}: is the target right?")]
    Instead {
        /// The number found.
        found: String,
    },
    /// The picture shows squares.
    #[error("this looks like a checkerboard: {corners} corners of squares, no grid of circles")]
    Checkerboard {
        /// Corners found.
        corners: usize,
    },
}

/// Returns the reason for a picture without squares: nothing, or circles.
pub(super) fn instead_of_squares(picture: &GrayPicture) -> BoardRejected {
    let lattice = circle_lattice::grow(&ellipses::dark(picture));
    if lattice.len() < MIN_INSTEAD {
        return BoardRejected::None;
    }
    CirclesRejected::Instead { found: lattice.describe() }.into()
}

/// Finds one kind of grid.
pub(super) struct CircleDetector {
    target: CircleGrid,
    min_circles: usize,
    squares: ChessboardDetector,
}

impl CircleDetector {
    /// Creates a detector for this grid; `min_circles` suffice for a grid that is partly outside the picture.
    ///
    /// # Errors
    /// Never: the grid detector's own defaults are valid.
    pub(super) fn new(
        target: CircleGrid,
        min_circles: usize,
    ) -> Result<Self, ChessboardParamsError> {
        let squares = ChessboardDetector::new(ChessboardParams::default())?;
        Ok(Self { target, min_circles: min_circles.min(target.num_circles()), squares })
    }

    /// Finds the grid in a picture.
    ///
    /// # Errors
    /// No grid, too few circles, or another target.
    pub(super) fn detect(&self, picture: &GrayPicture) -> Result<Board, BoardRejected> {
        let mut lattice = circle_lattice::grow(&ellipses::dark(picture));
        if lattice.len() < self.target.num_circles() {
            let light = circle_lattice::grow(&ellipses::dark(&ellipses::negative(picture)));
            if light.len() > lattice.len() {
                lattice = light;
            }
        }
        Ok(self.board(&lattice).map_err(|reason| match (reason, self.num_corners(picture)) {
            (CirclesRejected::None | CirclesRejected::Another { .. }, corners)
                if corners >= MIN_CORNERS && corners > lattice.len() / 2 =>
            {
                CirclesRejected::Checkerboard { corners }
            }
            (reason, _) => reason,
        })?)
    }

    fn board(&self, lattice: &Lattice) -> Result<Board, CirclesRejected> {
        let found = lattice.len();
        if found < MIN_CIRCLES.min(self.min_circles) {
            return Err(CirclesRejected::None);
        }
        let Some(mut corners) = lattice.places(&self.target) else {
            let (found, target) = (lattice.describe(), self.target.to_string());
            return Err(CirclesRejected::Another { found, target });
        };
        if found < self.min_circles {
            return Err(CirclesRejected::Few { found, needed: self.min_circles });
        }
        let circle_radius = lattice.radius(self.target.arrangement);
        corners.sort_by_key(|corner| (corner.place.1, corner.place.0));
        let span = |along: &dyn Fn(&Corner) -> u32| {
            corners.iter().map(along).max().map_or(0, |last| last + 1)
        };
        let (columns, rows) = (span(&|corner| corner.place.0), span(&|corner| corner.place.1));
        Ok(Board { columns, rows, corners, circle_radius, ..Board::default() })
    }

    fn num_corners(&self, picture: &GrayPicture) -> usize {
        let view = GrayImageView {
            width: picture.width as usize,
            height: picture.height as usize,
            data: &picture.levels,
        };
        let corners = detect_corners(&view, &default_chess_config());
        self.squares.detect(&corners).map_or(0, |found| found.corners.len())
    }
}
