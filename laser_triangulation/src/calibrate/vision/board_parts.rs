//! Joins the parts of a board that the grid detector separates where corners are missing, as under the laser's line.

use std::collections::HashSet;

use calib_targets_chessboard::ChessboardDetection;
use nalgebra::{Matrix3, Point2, Vector2};

use super::homography;

/// Largest distance of a part's corners from whole places of the first part's grid, squares: a lens bends the grid between
/// them.
const MAX_OFF: f64 = 0.35;

/// A corner: column and row, and its position in the picture, pixels.
pub(super) type Labelled = ((i32, i32), Point2<f64>);

/// Returns all corners on the grid of the first part, which is the largest. Parts that do not continue this grid are not
/// of this board and are left out.
pub(super) fn joined(parts: &[ChessboardDetection]) -> Vec<Labelled> {
    let mut parts = parts.iter().map(labelled);
    let mut all = parts.next().unwrap_or_default();
    for part in parts {
        let Some(shift) = shift(&all, &part) else { continue };
        let taken: HashSet<_> = all.iter().map(|corner| corner.0).collect();
        let moved: Vec<_> =
            part.into_iter().map(|((u, v), seen)| ((u + shift.0, v + shift.1), seen)).collect();
        if moved.iter().all(|corner| !taken.contains(&corner.0)) {
            all.extend(moved);
        }
    }
    all
}

fn labelled(part: &ChessboardDetection) -> Vec<Labelled> {
    let corner = |corner: &calib_targets_chessboard::ChessboardCorner| {
        let seen = Point2::new(corner.position.x.into(), corner.position.y.into());
        ((corner.grid.u, corner.grid.v), seen)
    };
    part.corners.iter().map(corner).collect()
}

/// Returns the whole number of columns and rows by which the part's labels are shifted; `None` if there is none.
fn shift(all: &[Labelled], part: &[Labelled]) -> Option<(i32, i32)> {
    let place = |(u, v): (i32, i32)| Point2::new(f64::from(u), f64::from(v));
    let pairs: Vec<_> = all.iter().map(|(label, seen)| (place(*label), *seen)).collect();
    let grid_from_picture: Matrix3<f64> = homography::fit(&pairs)?.try_inverse()?;
    let off = part
        .iter()
        .map(|(label, seen)| Some(homography::apply(&grid_from_picture, *seen)? - place(*label)));
    let off: Option<Vec<Vector2<f64>>> = off.collect();
    let off = off?;
    let mean = off.iter().sum::<Vector2<f64>>() / off.len() as f64;
    let whole = mean.map(f64::round);
    let is_close = off.iter().all(|off| (off - whole).amax() < MAX_OFF);
    is_close.then_some((whole.x as i32, whole.y as i32))
}
