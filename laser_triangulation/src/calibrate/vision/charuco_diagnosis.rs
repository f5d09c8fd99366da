//! Why a picture with squares shows no usable `ChArUco` board: markers of another dictionary, another size, or none.

use std::cmp::Reverse;

use calib_targets_aruco::{
    Dictionary, GrayImageView, MarkerCell, Matcher, ScanDecodeConfig, builtins,
    decode_marker_in_cell,
};
use calib_targets_chessboard::{
    ChessboardDetection, ChessboardDetector, ChessboardParams, ChessboardParamsError,
    default_chess_config, detect_corners,
};
use thiserror::Error;

use super::{
    board::BoardRejected,
    charuco::{self, Charuco},
    target::MAX_SIDE,
};

/// Fewest markers that are no chance.
const MIN_MARKERS: usize = 4;
/// Side of the square to which a cell is rectified, pixels.
const SIDE_PX: f32 = 60.0;
/// Sides of markers that are tried, squares.
const SHARES: [f64; 5] = [0.5, 0.6, 0.7, 0.8, 0.9];
/// Share of the markers that must lie where a board of another size has them.
const MIN_AGREEING: f64 = 0.8;

/// The reason why squares are not those of the `ChArUco` board.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CharucoRejected {
    /// The markers are those of another dictionary.
    #[error("the markers are of dictionary {found}, the target's of {wanted}")]
    Dictionary {
        /// Dictionary of most markers.
        found: String,
        /// Dictionary of the target.
        wanted: String,
    },
    /// The board has another number of columns or rows.
    #[error(
        "the markers lie as on a board of {columns} columns and {rows} rows of squares or more, the target has {target}"
    )]
    Size {
        /// Columns of squares.
        columns: u32,
        /// Rows of squares at least.
        rows: u32,
        /// Columns and rows of the target.
        target: String,
    },
    /// The markers fill another share of their squares.
    #[error(
        "the side of a marker is about {share:.1} of a square's, in the target {wanted:.2}: a marker's side is that of its \
         black square"
    )]
    MarkerSide {
        /// Side of a marker, squares.
        share: f64,
        /// Side of the target's markers, squares.
        wanted: f64,
    },
    /// The picture is mirrored.
    #[error("the markers are mirrored: flip the pictures")]
    Mirrored,
    /// Black and white are exchanged.
    #[error("black and white are exchanged: invert the pictures")]
    Negative,
    /// The target's markers, but not in its order.
    #[error(
        "{read} markers of {dictionary} are in no order of a ChArUco board: is it one board, printed by OpenCV or in its layout?"
    )]
    Order {
        /// Markers read.
        read: usize,
        /// Dictionary of the target.
        dictionary: String,
    },
    /// The board, but not surely enough.
    #[error(
        "{read} markers of the board can be read, which leave it open where it lies: too few, or blurred"
    )]
    Unsure {
        /// Markers read.
        read: usize,
    },
    /// Squares without markers.
    #[error(
        "{corners} corners of squares, but too few markers that can be read: a plain checkerboard, or markers too small or \
         blurred"
    )]
    NoMarkers {
        /// Corners found.
        corners: usize,
    },
}

/// A marker that was read in a cell of the grid.
struct Reading {
    cell: [i32; 2],
    id: usize,
    /// Quarter turns of the marker, clockwise.
    rotation: u8,
    is_negative: bool,
}

/// Finds the reason for pictures without a usable board.
pub(super) struct Diagnosis {
    target: Charuco,
    grid: ChessboardDetector,
}

impl Diagnosis {
    /// Creates the diagnosis of one target.
    ///
    /// # Errors
    /// Never: the grid detector's own defaults are valid.
    pub(super) fn new(target: Charuco) -> Result<Self, ChessboardParamsError> {
        Ok(Self { target, grid: ChessboardDetector::new(ChessboardParams::default())? })
    }

    /// Returns the reason for a picture.
    pub(super) fn of(&self, view: &GrayImageView<'_>) -> BoardRejected {
        let corners = detect_corners(view, &default_chess_config());
        let Some(found) = self.grid.detect(&corners) else { return BoardRejected::None };
        let reason = self.named(view, &cells(&found));
        reason.unwrap_or(CharucoRejected::NoMarkers { corners: found.corners.len() }).into()
    }

    fn named(&self, view: &GrayImageView<'_>, cells: &[MarkerCell]) -> Option<CharucoRejected> {
        let target = &self.target;
        let share = target.marker_m / target.square_m;
        let read = |dictionary: Dictionary, share: f64| read(view, cells, dictionary, share);
        let own = read(target.dictionary, share);
        // Half of the squares have markers.
        let is_enough = |found: usize| found >= MIN_MARKERS.max(cells.len() / 4);
        if is_enough(own.len()) {
            return Some(self.of_own_markers(&own));
        }
        let mirrored: Vec<_> = cells.iter().map(mirrored).collect();
        if is_enough(self::read(view, &mirrored, target.dictionary, share).len()) {
            return Some(CharucoRejected::Mirrored);
        }
        let all = builtins::BUILTIN_DICTIONARY_NAMES.iter();
        let all = all.filter_map(|name| builtins::builtin_dictionary(name));
        // Of dictionaries that share codes, as 4x4_50 and 4x4_100, the smallest.
        let counted =
            all.map(|one| (read(one, share).len(), Reverse(one.codes().len()), one.name()));
        if let Some((most, _, name)) = counted.max()
            && is_enough(most)
        {
            let (found, wanted) = (charuco::short(name), charuco::short(target.dictionary.name()));
            return Some(CharucoRejected::Dictionary { found, wanted });
        }
        let other = SHARES.map(|share| (read(target.dictionary, share).len(), share));
        let (most, best) = other.into_iter().max_by_key(|(count, _)| *count)?;
        is_enough(most).then_some(CharucoRejected::MarkerSide { share: best, wanted: share })
    }

    /// Returns what is wrong with markers of the right dictionary.
    fn of_own_markers(&self, own: &[Reading]) -> CharucoRejected {
        let target = &self.target;
        if own.iter().filter(|marker| marker.is_negative).count() > own.len() / 2 {
            return CharucoRejected::Negative;
        }
        let sizes = (2..=MAX_SIDE).flat_map(|columns| [(columns, 0), (columns, 1)]);
        let fits = sizes.filter_map(|(columns, first)| Some((columns, rows(own, columns, first)?)));
        if let Some((columns, rows)) = fits.max_by_key(|(columns, _)| *columns == target.columns) {
            if columns == target.columns && rows <= target.rows {
                return CharucoRejected::Unsure { read: own.len() };
            }
            let target = format!("{} x {}", target.columns, target.rows);
            return CharucoRejected::Size { columns, rows, target };
        }
        let dictionary = charuco::short(target.dictionary.name());
        CharucoRejected::Order { read: own.len(), dictionary }
    }
}

/// Returns the squares whose four corners were found.
fn cells(found: &ChessboardDetection) -> Vec<MarkerCell> {
    let at = |u: i32, v: i32| {
        found.corners.iter().find(|c| (c.grid.u, c.grid.v) == (u, v)).map(|c| c.position)
    };
    let cell =
        |(u, v): (i32, i32)| Some([at(u, v)?, at(u + 1, v)?, at(u + 1, v + 1)?, at(u, v + 1)?]);
    let corners = found.corners.iter();
    corners.filter_map(|c| Some(MarkerCell::new(c.grid, cell((c.grid.u, c.grid.v))?))).collect()
}

fn mirrored(cell: &MarkerCell) -> MarkerCell {
    let [a, b, c, d] = cell.corners_img;
    MarkerCell::new(cell.gc, [b, a, d, c])
}

/// Reads the markers of a dictionary without a wrong bit.
fn read(
    view: &GrayImageView<'_>,
    cells: &[MarkerCell],
    dictionary: Dictionary,
    share: f64,
) -> Vec<Reading> {
    let config =
        ScanDecodeConfig::default().with_inset_frac(0.0).with_marker_size_rel(share as f32);
    let matcher = Matcher::new(dictionary, 0);
    let reading = |cell: &MarkerCell| {
        let found = decode_marker_in_cell(view, cell, SIDE_PX, &config, &matcher)?;
        Some(Reading {
            cell: [cell.gc.u, cell.gc.v],
            id: found.id as usize,
            rotation: found.rotation,
            is_negative: found.inverted,
        })
    };
    cells.iter().filter_map(reading).collect()
}

/// Returns the least number of rows if the markers lie as on a board with these columns whose first marker is in
/// the first (0) or second (1) square.
fn rows(own: &[Reading], columns: u32, first: u32) -> Option<u32> {
    let squares = (0..MAX_SIDE).flat_map(|y| (0..columns).map(move |x| [x as i32, y as i32]));
    let squares: Vec<_> = squares.filter(|[x, y]| (x + y) % 2 == first as i32).collect();
    // Where the board's first square lies in the grid, by each marker.
    let votes = own.iter().filter_map(|marker| {
        let [u, v] = marker.cell;
        let turned = match marker.rotation {
            0 => [u, v],
            1 => [v, -u],
            2 => [-u, -v],
            _ => [-v, u],
        };
        let [x, y] = *squares.get(marker.id)?;
        Some((marker.rotation, x - turned[0], y - turned[1], y))
    });
    let votes: Vec<_> = votes.collect();
    let agreeing = |one: &(u8, i32, i32, i32)| {
        votes.iter().filter(|vote| (vote.0, vote.1, vote.2) == (one.0, one.1, one.2)).count()
    };
    let most = votes.iter().map(agreeing).max()?;
    let last = votes.iter().filter(|vote| agreeing(vote) == most).map(|vote| vote.3).max()?;
    // Below a square whose four corners were found lies one more row.
    (most as f64 >= MIN_AGREEING * own.len() as f64).then_some(last as u32 + 2)
}
