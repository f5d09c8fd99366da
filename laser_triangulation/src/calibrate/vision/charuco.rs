//! The `ChArUco` board: a checkerboard whose white squares carry numbered markers (Garrido-Jurado et al. 2014, and OpenCV's
//! `CharucoBoard`).

use std::fmt;

use calib_targets_aruco::{Dictionary, builtins};

use super::target;

/// Fewest squares a side of a board may have.
const MIN_SIDE: u32 = 4;
/// Markers if none are named.
const USUAL: &str = "4x4_50";

/// A `ChArUco` board in either of OpenCV's layouts.
///
/// Boards of OpenCV 4.6 and later start with a black square in the top left corner; older ones with an even number of rows
/// (`setLegacyPattern`) start with a white one. The pictures show which layout it is.
#[derive(Clone, Copy, Debug)]
pub struct Charuco {
    /// Squares along the top side.
    pub columns: u32,
    /// Squares along the left side.
    pub rows: u32,
    /// Side of a square, metres.
    pub square_m: f64,
    /// Side of a marker's black square, metres.
    pub marker_m: f64,
    /// Markers, numbered from 0 row by row.
    pub(super) dictionary: Dictionary,
}

impl Charuco {
    /// Reads `COLUMNSxROWS:SQUARE:MARKER[:DICTIONARY]`.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let mut parts = text.split(':');
        let [columns, rows] = target::sides(parts.next()?, MIN_SIDE)?;
        let (square_m, marker_m) = (target::metres(parts.next()?)?, target::metres(parts.next()?)?);
        let dictionary = dictionary(parts.next().unwrap_or(USUAL))?;
        let num_markers = (columns * rows / 2) as usize;
        let is_sound = marker_m < square_m && dictionary.codes().len() >= num_markers;
        (is_sound && parts.next().is_none()).then_some(Self {
            columns,
            rows,
            square_m,
            marker_m,
            dictionary,
        })
    }

    /// Returns the number of inner corners of the whole board.
    pub const fn num_corners(&self) -> usize {
        (self.columns - 1) as usize * (self.rows - 1) as usize
    }
}

/// Returns the markers of a name such as `4x4_50` or `apriltag_36h11`.
fn dictionary(name: &str) -> Option<Dictionary> {
    let is_same = |builtin: &&&str| short(builtin).eq_ignore_ascii_case(name);
    builtins::builtin_dictionary(builtins::BUILTIN_DICTIONARY_NAMES.iter().find(is_same)?)
}

/// Returns the name of a dictionary without OpenCV's prefix.
pub(super) fn short(name: &str) -> String {
    name.trim_start_matches("DICT_").to_ascii_lowercase()
}

impl fmt::Display for Charuco {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { columns, rows, square_m, marker_m, dictionary } = self;
        let name = short(dictionary.name());
        write!(formatter, "charuco:{columns}x{rows}:{square_m}:{marker_m}:{name}")
    }
}
