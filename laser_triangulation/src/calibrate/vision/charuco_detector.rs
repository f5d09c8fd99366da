//! A `ChArUco` board's inner corners in a picture.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::OnceLock,
};

use calib_targets_aruco::{Dictionary, builtins};
use calib_targets_charuco::{
    CharucoAdvancedTuning, CharucoBoardSpec, CharucoDetection, CharucoDetector as Detector,
    CharucoParams, GrayImageView,
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
/// Least share of the markers between the corners that must be read: at a wrong place, every other row may agree.
const MIN_READ: f64 = 0.6;
/// How much a row of three corners may bend, squares. A bit of a marker is found in place of a corner that cannot be seen,
/// at least a tenth of a square away.
const MAX_BEND: f64 = 0.15;
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
            let board = self.board(&found, *rows_above);
            let enough = MIN_READ * num_markers(&board, *rows_above) as f64;
            (num_read >= MIN_MARKERS && num_read as f64 >= enough).then_some((num_read, board))
        };
        let found = self
            .layouts
            .iter()
            .filter_map(read)
            .max_by_key(|(num_read, board)| (*num_read, board.corners.len()));
        let Some((_, board)) = found else { return Err(self.diagnosis.of(&view)) };
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
        let corners: Vec<_> = found.corners.iter().filter_map(corner).collect();
        let mut corners = without_strays(&corners);
        corners.sort_by_key(|corner| (corner.place.1, corner.place.0));
        Board { columns, rows, corners, ..Board::default() }
    }
}

/// Returns the number of markers between the corners of a board, which has `rows_above` more rows on top in the new layout.
fn num_markers(board: &Board, rows_above: u32) -> usize {
    let places: BTreeSet<_> = board.corners.iter().map(|corner| corner.place).collect();
    let has_marker = |&&(column, row): &&(u32, u32)| {
        let others = [(column + 1, row), (column, row + 1), (column + 1, row + 1)];
        (column + row + rows_above) % 2 == 1 && others.iter().all(|place| places.contains(place))
    };
    places.iter().filter(has_marker).count()
}

/// Leaves out corners that bend every row of three neighbours in which they lie, and those that lie in none.
fn without_strays(corners: &[Corner]) -> Vec<Corner> {
    let seen: BTreeMap<_, _> = corners.iter().map(|corner| (corner.place, corner.seen)).collect();
    let at = |(column, row): (u32, u32), [x, y]: [i32; 2], steps: i32| {
        let column = column.checked_add_signed(x * steps)?;
        seen.get(&(column, row.checked_add_signed(y * steps)?))
    };
    let bend = |place: (u32, u32), along: [i32; 2], first: i32| {
        let [a, b, c] = [0, 1, 2].map(|step| at(place, along, first + step));
        let (a, b, c) = (a?, b?, c?);
        Some(((a - b) - (b - c)).norm() / (0.5 * (a - c).norm()))
    };
    let rows =
        [[1, 0], [0, 1]].into_iter().flat_map(|along| [-2, -1, 0].map(|first| (along, first)));
    let rows: Vec<_> = rows.collect();
    let is_straight = |corner: &&Corner| {
        let bends = rows.iter().filter_map(|&(along, first)| bend(corner.place, along, first));
        bends.fold(f64::MAX, f64::min) < MAX_BEND
    };
    corners.iter().filter(is_straight).copied().collect()
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
    let mut tuning = CharucoAdvancedTuning::default();
    // A wide-angle lens bends the rows of a near board: corners must not be pulled to where a pinhole would see them.
    tuning.grid_smoothness_threshold_rel = MAX_BEND as f32;
    tuning.corner_validation_threshold_rel = f32::INFINITY;
    Ok(Detector::new(params.with_advanced(tuning))?)
}

/// Codes of each dictionary, after a number of codes that no marker has.
static AFTER: [[OnceLock<Vec<u64>>; MAX_SIDE as usize / 2 + 1]; NUM_DICTIONARIES] =
    [const { [const { OnceLock::new() }; MAX_SIDE as usize / 2 + 1] }; NUM_DICTIONARIES];
const NUM_DICTIONARIES: usize = builtins::BUILTIN_DICTIONARY_NAMES.len();

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
    Ok(Dictionary::from_static_codes(dictionary.name(), size, wrong, codes)?)
}
