//! A checkerboard's inner corners in a picture.

use calib_targets_chessboard::{
    ChessboardDetector, ChessboardParams, ChessboardParamsError, DetectorConfig, GrayImageView,
    default_chess_config, detect_corners,
};
use chess_corners::ImageRefiner;
use nalgebra::{Point2, Point3, Vector2};
use thiserror::Error;

use super::{
    board_parts::{self, Labelled},
    board_shape::BoardShape,
    charuco_diagnosis::CharucoRejected,
    checkerboard::Checkerboard,
    circle_detector::CirclesRejected,
    corner_deviations,
    picture::GrayPicture,
};

/// Root mean square distance of corners from where perspective and a lens put them, beyond which a picture is not used,
/// pixels.
pub(super) const MAX_SCATTER_PX: f64 = 0.6;
/// A corner that lies farther from there is left out: this many standard deviations of the picture's corners,
const MAX_SIGMAS: f64 = 6.0;
/// and this many pixels.
const MIN_OFF_PX: f64 = 0.4;
/// Largest share of corners that may be left out: a line along a column of a board with four.
const MAX_LEFT_OUT: f64 = 0.25;

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
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Board {
    /// Columns that the corners span.
    pub columns: u32,
    /// Rows that the corners span.
    pub rows: u32,
    /// The corners, row by row.
    pub corners: Vec<Corner>,
    /// Corners that were found, but not where perspective and a lens put them: under the laser's line, for instance.
    pub left_out: usize,
    /// True if the board's rows are the target's columns: it was found turned by a quarter.
    pub is_turned: bool,
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
    /// Corners that no view of a board explains.
    #[error(
        "blurred, or not the corners of a board: they lie {scatter_px:.2} px from where perspective and a lens put them, \
         allowed is {MAX_SCATTER_PX}"
    )]
    Scattered {
        /// Root mean square distance, pixels.
        scatter_px: f64,
    },
    /// Many single corners that are wrong.
    #[error(
        "{wrong} of {found} corners are not where perspective and a lens put them: covered, or not corners"
    )]
    Wrong {
        /// Corners in wrong places.
        wrong: usize,
        /// Corners found.
        found: usize,
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
        let mut board = Board::new(&board_parts::joined(&self.grid.detect_all(&corners)));
        let Board { columns, rows, .. } = board;
        if !self.target.holds(columns, rows) {
            return Err(BoardRejected::Larger { columns, rows, target: self.target });
        }
        board.is_turned = columns > self.target.columns || rows > self.target.rows;
        match (board.corners.len(), self.min_corners) {
            (0, _) => return Err(BoardRejected::None),
            (found, needed) if found < needed => return Err(BoardRejected::Few { found, needed }),
            _ => {}
        }
        board.without_wrong_corners([picture.width, picture.height])
    }
}

impl Board {
    fn new(found: &[Labelled]) -> Self {
        let places = || found.iter().map(|corner| corner.0);
        let first_column = places().map(|place| place.0).min().unwrap_or(0);
        let first_row = places().map(|place| place.1).min().unwrap_or(0);
        let corner = |&((u, v), seen): &Labelled| Corner {
            place: ((u - first_column) as u32, (v - first_row) as u32),
            seen,
        };
        let mut corners: Vec<_> = found.iter().map(corner).collect();
        corners.sort_by_key(|corner| (corner.place.1, corner.place.0));
        let span = |last: Option<u32>| last.map_or(0, |last| last + 1);
        Self {
            columns: span(corners.iter().map(|corner| corner.place.0).max()),
            rows: span(corners.iter().map(|corner| corner.place.1).max()),
            corners,
            ..Self::default()
        }
    }

    /// Returns true if the corners span the whole target.
    pub fn is_whole(&self, target: &Checkerboard) -> bool {
        let sides = |columns, rows| columns == target.columns && rows == target.rows;
        sides(self.columns, self.rows) || sides(self.rows, self.columns)
    }

    /// Returns each corner on a flat board, metres, and in the picture, pixels.
    pub fn pairs(&self, square_m: f64) -> Vec<(Point2<f64>, Point2<f64>)> {
        let on_board =
            |(column, row)| Point2::new(f64::from(column) * square_m, f64::from(row) * square_m);
        self.corners.iter().map(|corner| (on_board(corner.place), corner.seen)).collect()
    }

    /// Returns each corner on a board of this shape, in the frame of [`pairs`](Self::pairs), and in the picture, pixels.
    pub(super) fn points(
        &self,
        square_m: f64,
        shape: &BoardShape,
    ) -> Vec<(Point3<f64>, Point2<f64>)> {
        let middle = self.middle_m(square_m);
        let points = self.flat(square_m).into_iter().map(|(flat, seen)| {
            let Point3 { coords } = shape.point(flat);
            let off = if self.is_turned { Vector2::new(-coords.y, coords.x) } else { coords.xy() };
            (Point3::from((off + middle).push(coords.z)), seen)
        });
        points.collect()
    }

    /// Returns each corner in the target's frame, about the middle of the corners seen, metres, and in the picture,
    /// pixels.
    pub(super) fn flat(&self, square_m: f64) -> Vec<(Point2<f64>, Point2<f64>)> {
        let pairs = self.pairs(square_m).into_iter();
        pairs.map(|(at, seen)| (self.in_target(at, square_m), seen)).collect()
    }

    /// Returns a place on the board in the target's frame, about the middle of the corners seen, metres.
    pub(super) fn in_target(&self, at: Point2<f64>, square_m: f64) -> Point2<f64> {
        let off = at.coords - self.middle_m(square_m);
        if self.is_turned { Point2::new(off.y, -off.x) } else { off.into() }
    }

    fn middle_m(&self, square_m: f64) -> Vector2<f64> {
        Vector2::new(f64::from(self.columns) - 1.0, f64::from(self.rows) - 1.0) * (square_m / 2.0)
    }

    /// Leaves out single corners that lie elsewhere than all others suggest.
    fn without_wrong_corners(mut self, size_px: [u32; 2]) -> Result<Self, BoardRejected> {
        let off_px =
            corner_deviations::find(&self.pairs(1.0), size_px).ok_or(BoardRejected::None)?;
        let limit_px = MIN_OFF_PX.max(MAX_SIGMAS * corner_deviations::spread_px(&off_px));
        let good_px: Vec<_> = off_px.iter().copied().filter(|off| *off <= limit_px).collect();
        let (found, wrong) = (off_px.len(), off_px.len() - good_px.len());
        let scatter_px =
            (good_px.iter().map(|off| off * off).sum::<f64>() / good_px.len() as f64).sqrt();
        if scatter_px > MAX_SCATTER_PX {
            return Err(BoardRejected::Scattered { scatter_px });
        }
        if wrong as f64 > MAX_LEFT_OUT * found as f64 {
            return Err(BoardRejected::Wrong { wrong, found });
        }
        let mut off_px = off_px.into_iter();
        self.corners.retain(|_| off_px.next().is_some_and(|off| off <= limit_px));
        Ok(Self { left_out: wrong, ..self })
    }
}
