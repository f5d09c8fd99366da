//! Square markers with a number, such as `ArUco` (Garrido-Jurado et al. 2014).

use calib_targets_aruco::{
    Dictionary, GrayImageView, Matcher, ScanDecodeConfig, builtins, scan_decode_markers,
};
use nalgebra::Point2;
use thiserror::Error;

use super::{
    homography,
    picture::GrayPicture,
    quads::{self, Quad},
    target,
};

/// Side of the square to which a marker is rectified, pixels.
const SIDE: usize = 60;
/// Largest number of wrong bits.
const MAX_WRONG_BITS: u8 = 1;

/// The kind of the markers.
#[derive(Clone, Copy, Debug)]
pub struct MarkerKind {
    dictionary: Dictionary,
    /// Side of their black squares, metres, if it is known.
    pub side_m: Option<f64>,
}

/// Markers that cannot be read.
#[derive(Debug, Error, PartialEq)]
#[error(
    "{text:?} are no markers: write aruco:DICTIONARY or aruco:DICTIONARY:SIDE with the side of the black square in metres or mm, \
     as aruco:4x4_50, aruco:4x4_50:0.030 or aruco:4x4_50:30mm; dictionaries are 4x4_50 to 7x7_1000"
)]
pub struct MarkerError {
    text: String,
}

impl std::str::FromStr for MarkerKind {
    type Err = MarkerError;

    fn from_str(text: &str) -> Result<Self, MarkerError> {
        let parse = || {
            let mut parts = text.strip_prefix("aruco:")?.split(':');
            let name = format!("DICT_{}", parts.next()?.to_ascii_uppercase());
            let dictionary = builtins::builtin_dictionary(&name)?;
            let side_m = match parts.next() {
                None => None,
                Some(side) => Some(target::metres(side)?),
            };
            parts.next().is_none().then_some(Self { dictionary, side_m })
        };
        parse().ok_or_else(|| MarkerError { text: text.to_owned() })
    }
}

/// A marker in a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Marker {
    /// Its number.
    pub id: u32,
    /// Its corners in order round it, pixels.
    pub corners: Quad,
}

/// Finds markers of one kind.
#[derive(Clone, Debug)]
pub struct MarkerDetector {
    matcher: Matcher,
    decoding: ScanDecodeConfig,
}

impl MarkerDetector {
    /// Creates a detector for these markers.
    pub fn new(kind: &MarkerKind) -> Self {
        // The quadrilateral is the marker's own edge: no margin is removed.
        let decoding = ScanDecodeConfig::default().with_inset_frac(0.0);
        Self { matcher: Matcher::new(kind.dictionary, MAX_WRONG_BITS), decoding }
    }

    /// Finds every marker in a picture, by number. Drops numbers that appear twice.
    pub fn detect(&self, picture: &GrayPicture) -> Vec<Marker> {
        let quads = quads::find(picture).into_iter();
        let read = |corners| Some(Marker { id: self.read(picture, &corners)?, corners });
        let mut found: Vec<_> = quads.filter_map(read).collect();
        found.sort_by_key(|marker| marker.id);
        let ids: Vec<_> = found.iter().map(|marker| marker.id).collect();
        found.retain(|marker| ids.iter().filter(|id| **id == marker.id).count() == 1);
        found
    }

    fn read(&self, picture: &GrayPicture, corners: &Quad) -> Option<u32> {
        let side = SIDE as f64;
        let square = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)];
        let pairs: Vec<_> =
            square.iter().zip(corners).map(|(&(x, y), &seen)| (Point2::new(x, y), seen)).collect();
        let map = homography::fit(&pairs)?;
        let mut levels = Vec::with_capacity(SIDE * SIDE);
        for row in 0..SIDE {
            for column in 0..SIDE {
                let at = Point2::new(column as f64 + 0.5, row as f64 + 0.5);
                levels.push(quads::level(picture, homography::apply(&map, at)?)? as u8);
            }
        }
        let unrolled = GrayImageView { width: SIDE, height: SIDE, data: &levels };
        let decoded =
            scan_decode_markers(&unrolled, 1, 1, SIDE as f32, &self.decoding, &self.matcher);
        decoded.first().filter(|marker| !marker.inverted).map(|marker| marker.id)
    }
}
