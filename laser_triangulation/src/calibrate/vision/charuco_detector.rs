//! A `ChArUco` board's inner corners in a picture.

use std::sync::OnceLock;

use calib_targets_aruco::{Dictionary, builtins};
use calib_targets_charuco::{
    CharucoBoardSpec, CharucoDetection, CharucoDetector as Detector, CharucoParams, GrayImageView,
};
use calib_targets_chessboard::default_chess_config;
use chess_corners::ImageRefiner;
use nalgebra::Point2;

use super::{
    board::{Board, BoardRejected, Corner},
    charuco::Charuco,
    charuco_diagnosis::Diagnosis,
    picture::GrayPicture,
    target::MAX_SIDE,
    target_detector::TargetDetectorError,
};

/// Fewest markers that must be read on a board.
const MIN_MARKERS: usize = 3;
/// Largest number of wrong bits of a marker that counts.
const MAX_WRONG_BITS: u8 = 1;

/// Finds one kind of `ChArUco` board.
pub(super) struct CharucoDetector {
    target: Charuco,
    min_corners: usize,
    /// A detector of each layout, and the rows of its board above the real one.
    layouts: Vec<(Detector, u32)>,
    diagnosis: Diagnosis,
}

impl CharucoDetector {
    /// Creates a detector for this board; `min_corners` suffice for a board that is partly hidden.
    ///
    /// # Errors
    /// A board that the detector refuses.
    pub(super) fn new(target: Charuco, min_corners: usize) -> Result<Self, TargetDetectorError> {
        let mut layouts = vec![(detector(&target, target.rows, target.dictionary)?, 0)];
        if target.rows.is_multiple_of(2) {
            layouts.push((detector(&target, target.rows + 1, after_a_row(&target)?)?, 1));
        }
        let min_corners = min_corners.min(target.num_corners());
        Ok(Self { target, min_corners, layouts, diagnosis: Diagnosis::new(target)? })
    }

    /// Finds the board in a picture. Places count from the board's first inner corner.
    ///
    /// # Errors
    /// No board, too few corners, or another board. Of a blurred one, no markers can be read.
    pub(super) fn detect(&self, picture: &GrayPicture) -> Result<Board, BoardRejected> {
        let view = GrayImageView {
            width: picture.width as usize,
            height: picture.height as usize,
            data: &picture.levels,
        };
        let read = |(detector, rows_above): &(Detector, u32)| {
            let found = detector.detect(&view).ok()?;
            let is_read = |wrong_bits: u8| wrong_bits <= MAX_WRONG_BITS;
            let num_read = found.markers.iter().filter(|marker| is_read(marker.hamming)).count();
            // Most markers must be those of the board: chance reads one or two.
            (num_read >= MIN_MARKERS.max(found.markers.len() / 2)).then_some((found, *rows_above))
        };
        let Some((found, rows_above)) = self.layouts.iter().find_map(read) else {
            return Err(self.diagnosis.of(&view));
        };
        let board = self.board(&found, rows_above);
        let (found_corners, needed) = (board.corners.len(), self.min_corners);
        if found_corners < needed {
            return Err(BoardRejected::Few { found: found_corners, needed });
        }
        Ok(board)
    }

    fn board(&self, found: &CharucoDetection, rows_above: u32) -> Board {
        let (columns, rows) = (self.target.columns - 1, self.target.rows - 1);
        let corner = |corner: &calib_targets_charuco::CharucoCorner| {
            // The row above the board has no corners of its own.
            let row = (corner.id / columns).checked_sub(rows_above)?;
            let seen = Point2::new(corner.position.x.into(), corner.position.y.into());
            (row < rows).then_some(Corner { place: (corner.id % columns, row), seen })
        };
        let mut corners: Vec<_> = found.corners.iter().filter_map(corner).collect();
        corners.sort_by_key(|corner| (corner.place.1, corner.place.0));
        Board { columns, rows, corners }
    }
}

fn detector(
    target: &Charuco,
    rows: u32,
    dictionary: Dictionary,
) -> Result<Detector, TargetDetectorError> {
    let share = (target.marker_m / target.square_m) as f32;
    // The crate's lengths are not used: places are counted in squares.
    let spec = CharucoBoardSpec::new(rows, target.columns, 1.0, share, dictionary);
    let mut params = CharucoParams::for_board(spec);
    // As for checkerboards: a third more accurate than the default.
    params.chess = default_chess_config().with_refiner(ImageRefiner::saddle_point());
    Ok(Detector::new(params)?)
}

/// Codes of each dictionary, after a number of codes that no marker has.
static AFTER: [[OnceLock<Vec<u64>>; MAX_SIDE as usize / 2 + 1]; 22] =
    [const { [const { OnceLock::new() }; MAX_SIDE as usize / 2 + 1] }; 22];

/// Returns the markers for the old layout. With an even number of rows, it is the new layout of a board with one more row
/// on top, whose markers have the numbers before 0.
fn after_a_row(target: &Charuco) -> Result<Dictionary, TargetDetectorError> {
    let in_row = target.columns as usize / 2;
    let dictionary = target.dictionary;
    let index = builtins::BUILTIN_DICTIONARY_NAMES.iter().position(|&n| n == dictionary.name());
    let kept = index.and_then(|index| AFTER.get(index)?.get(in_row));
    let kept = kept.ok_or(TargetDetectorError::Dictionary)?;
    let codes = kept.get_or_init(|| [vec![0; in_row].as_slice(), dictionary.codes()].concat());
    let (size, wrong) = (dictionary.marker_size(), dictionary.max_correction_bits());
    Dictionary::from_static_codes(dictionary.name(), size, wrong, codes)
        .map_err(|_| TargetDetectorError::Dictionary)
}
