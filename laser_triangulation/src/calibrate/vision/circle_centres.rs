//! The centres of circles seen in perspective.
//!
//! The picture of a circle is an ellipse whose centroid is not the picture of the circle's centre (Heikkilä and Silvén 1997,
//! section 2.2). With the camera and the board's pose known, both are computed, and their difference is removed.

use nalgebra::{Point2, Point3, Vector2};

use super::{
    board::Board,
    board_shape::BoardShape,
    pose::{self, BoardPose},
};
use crate::{
    scanner::camera::{Camera, DistortedPixel},
    statistics::median,
};

/// Corners of the polygon that stands for a circle.
const CORNERS: u32 = 48;
/// Times the pose is fitted again.
const ROUNDS: usize = 2;

/// Returns the radius of the circles, pitches: the median of all views. `None` for boards without circles.
fn radius(boards: &[Board]) -> Option<f64> {
    let mut all: Vec<_> = boards.iter().filter_map(|board| board.circle_radius).collect();
    median(&mut all)
}

/// Returns boards whose corners are the pictures of the circles' centres under a known camera. Boards without circles, and
/// those that the camera cannot see, are returned unchanged.
#[must_use]
pub fn with_true_centres(camera: &Camera, boards: &[Board], unit_m: f64) -> Vec<Board> {
    let Some(radius) = radius(boards) else { return boards.to_vec() };
    let corrected = |board: &Board| {
        let mut found = board.clone();
        for _ in 0..ROUNDS {
            let pose = pose::fit(camera, &found.points(unit_m, &BoardShape::default()))?;
            found = recentred(board, camera, &pose, [unit_m, radius * unit_m]);
        }
        Some(found)
    };
    boards.iter().map(|board| corrected(board).unwrap_or_else(|| board.clone())).collect()
}

/// Returns a board of centroids with the centres instead, under a camera and pose. `lengths_m`: the pitch and the radius.
fn recentred(
    centroids: &Board,
    camera: &Camera,
    pose: &BoardPose,
    [unit_m, radius_m]: [f64; 2],
) -> Board {
    let mut board = centroids.clone();
    let on_board = centroids.pairs(unit_m);
    for (corner, (centre, _)) in board.corners.iter_mut().zip(on_board) {
        corner.seen -= shift(camera, pose, centre, radius_m).unwrap_or_default();
    }
    board
}

/// Returns the centroid of a circle's picture minus the picture of its centre, pixels.
fn shift(
    camera: &Camera,
    pose: &BoardPose,
    centre: Point2<f64>,
    radius_m: f64,
) -> Option<Vector2<f64>> {
    let seen = |at: Point2<f64>| {
        let DistortedPixel(seen) =
            camera.project(pose.camera_from_board * Point3::new(at.x, at.y, 0.0))?;
        Some(seen)
    };
    let middle = seen(centre)?;
    let corner = |index: u32| {
        let angle = std::f64::consts::TAU * f64::from(index) / f64::from(CORNERS);
        Some(seen(centre + Vector2::new(angle.cos(), angle.sin()) * radius_m)? - middle)
    };
    let outline: Option<Vec<Vector2<f64>>> = (0..=CORNERS).map(corner).collect();
    // The centroid of a polygon, relative to the middle.
    let (mut area, mut sum) = (0.0, Vector2::zeros());
    for ends in outline?.windows(2) {
        let part = ends[0].perp(&ends[1]);
        area += part;
        sum += (ends[0] + ends[1]) * (part / 3.0);
    }
    Some(sum / area)
}
