//! Finds a target of any kind in pictures.

use calib_targets_aruco::DictionaryError;
use calib_targets_charuco::CharucoBoardError;
use calib_targets_chessboard::ChessboardParamsError;
use thiserror::Error;

use super::{
    board::{Board, BoardDetector, BoardRejected},
    charuco_detector::CharucoDetector,
    circle_detector::{self, CircleDetector},
    picture::GrayPicture,
    target::Target,
};

/// A target for which no detector can be made.
#[derive(Debug, Error)]
pub enum TargetDetectorError {
    /// Settings of the grid detector.
    #[error(transparent)]
    Grid(#[from] ChessboardParamsError),
    /// The `ChArUco` board is none.
    #[error(transparent)]
    Charuco(#[from] CharucoBoardError),
    /// The markers are none.
    #[error(transparent)]
    Markers(#[from] DictionaryError),
    /// The dictionary is unknown.
    #[error("the dictionary of the markers is unknown")]
    Dictionary,
}

/// Finds one target.
#[expect(missing_debug_implementations, reason = "the grid detector has none")]
pub struct TargetDetector(Detector);

enum Detector {
    Checkerboard(BoardDetector),
    Charuco(CharucoDetector),
    Circles(CircleDetector),
}

impl TargetDetector {
    /// Creates a detector for this target; `min_points` suffice for a target that is partly outside the picture.
    ///
    /// # Errors
    /// Never for a target that was read from text.
    pub fn new(target: &Target, min_points: usize) -> Result<Self, TargetDetectorError> {
        Ok(Self(match target {
            Target::Checkerboard(board) => {
                Detector::Checkerboard(BoardDetector::new(*board, min_points)?)
            }
            Target::Charuco(board) => Detector::Charuco(CharucoDetector::new(*board, min_points)?),
            Target::Circles(grid) => Detector::Circles(CircleDetector::new(*grid, min_points)?),
        }))
    }

    /// Finds the target in a picture.
    ///
    /// # Errors
    /// No target, too few points of it, another one, or a blurred one.
    pub fn detect(&self, picture: &GrayPicture) -> Result<Board, BoardRejected> {
        match &self.0 {
            Detector::Checkerboard(detector) => match detector.detect(picture) {
                Err(BoardRejected::None) => Err(circle_detector::instead_of_squares(picture)),
                found => found,
            },
            Detector::Charuco(detector) => detector.detect(picture),
            Detector::Circles(detector) => detector.detect(picture),
        }
    }
}
