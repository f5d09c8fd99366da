//! A checkerboard's inner corners in a picture.

use calib_targets_chessboard::{
    ChessboardDetection, ChessboardDetector, ChessboardParams, ChessboardParamsError,
    DetectorConfig, GrayImageView, default_chess_config, detect_corners,
};
use chess_corners::ImageRefiner;
use nalgebra::Point2;
use thiserror::Error;

use super::{
    charuco_diagnosis::CharucoRejected, checkerboard::Checkerboard,
    circle_detector::CirclesRejected, picture::GrayPicture,
};

/// Root mean square distance of corners from the positions that their neighbours predict, beyond which a picture counts
/// as blurred, pixels.
const MAX_SCATTER_PX: f32 = 0.6;

/// One inner corner, or a circle's centroid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    /// Its position on the board, squares (pitches of a grid of circles) from the first one found: columns run to the
    /// right, rows downwards.
    pub place: (u32, u32),
    /// Its position in the picture, pixels.
    pub seen: Point2<f64>,
}

/// The corners found in one picture.
///
/// A checkerboard has no distinct first corner: the orientation of the grid on the board and the visible part of it are
/// unknown. Results computed from a board's pose alone do not depend on them. The corners of a `ChArUco` board are numbered:
/// its columns and rows are the whole board's, and places count from the board's first corner.
#[derive(Clone, Debug, PartialEq)]
pub struct Board {
    /// Columns that the corners span.
    pub columns: u32,
    /// Rows that the corners span.
    pub rows: u32,
    /// The corners, row by row.
    pub corners: Vec<Corner>,
    /// Radius of the circles, units of the places; `None` for corners of squares, or if it was not measured.
    pub circle_radius: Option<f64>,
}

/// The reason why a picture shows no usable board.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum BoardRejected {
    /// No board was found.
    #[error("no board")]
    None,
    /// Too few corners are visible.
    #[error("only {found} corners of the board, at least {needed} are needed")]
    Few {
        /// Corners found.
        found: usize,
        /// Corners required.
        needed: usize,
    },
    /// The board does not match the target.
    #[error("the board has {columns} x {rows} inner corners or more, the target {target}")]
    Larger {
        /// Columns found.
        columns: u32,
        /// Rows found.
        rows: u32,
        /// Expected board.
        target: Checkerboard,
    },
    /// Corners that do not lie on a smooth grid.
    #[error(
        "blurred: corners lie {scatter_px:.2} px from where their neighbours put them, allowed is {MAX_SCATTER_PX}"
    )]
    Blurred {
        /// Root mean square distance, pixels.
        scatter_px: f32,
    },
    /// There is no usable grid of circles.
    #[error(transparent)]
    Circles(#[from] CirclesRejected),
    /// The squares are not those of the `ChArUco` board.
    #[error(transparent)]
    Charuco(#[from] CharucoRejected),
}

/// Finds one kind of board.
#[expect(missing_debug_implementations, reason = "the grid detector has none")]
pub struct BoardDetector {
    target: Checkerboard,
    min_corners: usize,
    front_end: DetectorConfig,
    grid: ChessboardDetector,
}

impl BoardDetector {
    /// Creates a detector for this board; `min_corners` suffice for a board that is partly outside the picture.
    ///
    /// # Errors
    /// Never: the grid detector's own defaults are valid.
    pub fn new(target: Checkerboard, min_corners: usize) -> Result<Self, ChessboardParamsError> {
        let grid = ChessboardDetector::new(ChessboardParams::default())?;
        // The saddle method is a third more accurate than the default, the centre of mass.
        let front_end = default_chess_config().with_refiner(ImageRefiner::saddle_point());
        Ok(Self { target, min_corners: min_corners.min(target.num_corners()), front_end, grid })
    }

    /// Finds the board in a picture.
    ///
    /// # Errors
    /// No board, too few corners, a different board, or a blurred one.
    pub fn detect(&self, picture: &GrayPicture) -> Result<Board, BoardRejected> {
        let view = GrayImageView {
            width: picture.width as usize,
            height: picture.height as usize,
            data: &picture.levels,
        };
        let corners = detect_corners(&view, &self.front_end);
        let found = self.grid.detect(&corners).ok_or(BoardRejected::None)?;
        let board = Board::from(&found);
        let Board { columns, rows, .. } = board;
        if !self.target.holds(columns, rows) {
            return Err(BoardRejected::Larger { columns, rows, target: self.target });
        }
        let (found_corners, needed) = (board.corners.len(), self.min_corners);
        if found_corners < needed {
            return Err(BoardRejected::Few { found: found_corners, needed });
        }
        match found.quality.local_residual_rms_px {
            Some(scatter_px) if scatter_px > MAX_SCATTER_PX => {
                Err(BoardRejected::Blurred { scatter_px })
            }
            _ => Ok(board),
        }
    }
}

impl From<&ChessboardDetection> for Board {
    fn from(found: &ChessboardDetection) -> Self {
        let places = || found.corners.iter().map(|corner| (corner.grid.u, corner.grid.v));
        let first_column = places().map(|place| place.0).min().unwrap_or(0);
        let first_row = places().map(|place| place.1).min().unwrap_or(0);
        let place = |(u, v)| ((u - first_column) as u32, (v - first_row) as u32);
        let mut corners: Vec<_> = found
            .corners
            .iter()
            .map(|corner| Corner {
                place: place((corner.grid.u, corner.grid.v)),
                seen: Point2::new(corner.position.x.into(), corner.position.y.into()),
            })
            .collect();
        corners.sort_by_key(|corner| (corner.place.1, corner.place.0));
        let span = |last: Option<u32>| last.map_or(0, |last| last + 1);
        Self {
            columns: span(corners.iter().map(|corner| corner.place.0).max()),
            rows: span(corners.iter().map(|corner| corner.place.1).max()),
            corners,
            circle_radius: None,
        }
    }
}

impl Board {
    /// Returns true if every inner corner of the target was found.
    pub fn is_whole(&self, target: &Checkerboard) -> bool {
        self.corners.len() == target.num_corners()
    }

    /// Returns each corner on the board, metres, and in the picture, pixels.
    pub fn pairs(&self, square_m: f64) -> Vec<(Point2<f64>, Point2<f64>)> {
        let on_board =
            |(column, row)| Point2::new(f64::from(column) * square_m, f64::from(row) * square_m);
        self.corners.iter().map(|corner| (on_board(corner.place), corner.seen)).collect()
    }
}
