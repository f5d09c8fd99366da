//! The laser's line on a board, which is straight after removing the lens's distortion.

use nalgebra::{Isometry3, Matrix2, Point2, Point3, Vector2, Vector3};
use thiserror::Error;

use super::{board::Board, board_shape::BoardShape, pose::BoardPose};
use crate::scanner::{
    camera::{Camera, DistortedPixel},
    stripe::Centerline,
};

/// Largest distance of an inlier from the line, pixels.
const INLIER_PX: f64 = 1.2;
/// Number of points whose pairs are tried as lines.
const MAX_TRIED: usize = 80;
/// Fewest points of a line.
const MIN_POINTS: usize = 25;
/// Shortest line, pixels.
const MIN_LENGTH_PX: f64 = 40.0;
/// Smallest share of its length on which a line must have points.
const MIN_FILLED: f64 = 0.5;
/// Largest root mean square distance from the line, pixels.
const MAX_RMS_PX: f64 = 0.6;

/// Steps towards the point of a bent board that a ray meets.
const SURFACE_STEPS: usize = 6;

/// A board in front of the camera.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed<'a> {
    /// Its corners.
    pub(crate) board: &'a Board,
    /// Pose of the board, from the corners alone.
    pub(crate) pose: &'a BoardPose,
    /// Its bend.
    pub(crate) shape: &'a BoardShape,
    /// Side of a square, metres.
    pub(crate) square_m: f64,
}

/// The line on one board.
#[derive(Clone, Debug)]
pub struct StripeLine {
    /// Points of the line on the board, in the camera's frame, metres.
    pub points: Vec<Point3<f64>>,
    /// Their positions in the picture, pixels.
    pub(super) seen: Vec<Point2<f64>>,
    /// Root mean square distance of its points from a straight line, undistorted pixels.
    pub rms_px: f64,
    /// Length from end to end, pixels.
    pub length_px: f64,
}

/// The reason why a board shows no line.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum LineRejected {
    /// The board has no stripe.
    #[error(
        "no laser line on the board's squares and its rim, as far as --border says that it is flat"
    )]
    None,
    /// The line is too short to determine a direction.
    #[error(
        "the laser line on the board is {length_px:.0} px long with {points} points, at least {MIN_LENGTH_PX} px and \
         {MIN_POINTS} points are needed"
    )]
    Short {
        /// Length from end to end, pixels.
        length_px: f64,
        /// Points on it.
        points: usize,
    },
    /// The points form no straight line.
    #[error(
        "the bright pixels on the board form no straight line: {rms_px:.2} px RMS, allowed is {MAX_RMS_PX}"
    )]
    Crooked {
        /// Root mean square distance from the line, pixels.
        rms_px: f64,
    },
    /// The points fill too little of their line.
    #[error(
        "no line of laser light on the board: the bright pixels fill {filled:.0} % of a line's length, at least {} % are needed",
        100.0 * MIN_FILLED
    )]
    Sparse {
        /// Share of the length with points on it, percent.
        filled: f64,
    },
}

/// A point of the stripe on the board.
#[derive(Clone, Copy)]
struct OnBoard {
    seen: Point2<f64>,
    /// Its undistorted position, pixels from the principal point.
    straight: Point2<f64>,
    point: Point3<f64>,
}

/// Finds the line among a centreline's points on the board's squares. `border` is the width of the flat rim beyond the
/// inner corners, in squares: 1 for the outermost squares.
///
/// # Errors
/// No line, a line that is too short, or points that form no line.
pub(super) fn find(
    camera: &Camera,
    placed: &Placed<'_>,
    border: f64,
    stripe: &Centerline,
) -> Result<StripeLine, LineRejected> {
    let on_board = on_board(camera, placed, border, stripe);
    let line = best_line(&on_board).ok_or(LineRejected::None)?;
    let close: Vec<_> = on_board
        .into_iter()
        .filter(|point| line.distance(point.straight).abs() <= INLIER_PX)
        .collect();
    // Repeat with all inliers.
    let line = Line::through(&close).ok_or(LineRejected::None)?;
    let along = |point: &OnBoard| line.direction.dot(&point.straight.coords);
    let (first, last) = close
        .iter()
        .map(along)
        .fold((f64::MAX, f64::MIN), |(low, high), at| (low.min(at), high.max(at)));
    let (length_px, points) = (last - first, close.len());
    if length_px < MIN_LENGTH_PX || points < MIN_POINTS {
        return Err(LineRejected::Short { length_px, points });
    }
    let squares = close.iter().map(|point| line.distance(point.straight).powi(2));
    let rms_px = (squares.sum::<f64>() / points as f64).sqrt();
    // One point per row or column: a line at 45 degrees has 0.7 points per pixel.
    let steps = line.direction.amax() * length_px;
    let filled = points as f64 / steps;
    if rms_px > MAX_RMS_PX {
        return Err(LineRejected::Crooked { rms_px });
    }
    if filled < MIN_FILLED {
        return Err(LineRejected::Sparse { filled: 100.0 * filled });
    }
    let seen = close.iter().map(|point| point.seen).collect();
    let points = close.iter().map(|point| point.point).collect();
    Ok(StripeLine { points, seen, rms_px, length_px })
}

/// Returns the points of a board at these positions of the picture, in the camera's frame, metres.
pub(super) fn points(
    camera: &Camera,
    placed: &Placed<'_>,
    seen: &[Point2<f64>],
) -> Option<Vec<Point3<f64>>> {
    let board_from_camera = placed.pose.camera_from_board.inverse();
    let point = |&seen: &Point2<f64>| {
        let on = placed.meet(&board_from_camera, camera.ray(DistortedPixel(seen))?);
        Some(placed.pose.camera_from_board * on)
    };
    seen.iter().map(point).collect()
}

/// Returns the points whose rays meet the board within the squares around its corners.
fn on_board(
    camera: &Camera,
    placed: &Placed<'_>,
    border: f64,
    stripe: &Centerline,
) -> Vec<OnBoard> {
    let &Placed { board, pose, square_m, .. } = placed;
    let board_from_camera = pose.camera_from_board.inverse();
    let inside = |at: f64, corners: u32| {
        (-border..=f64::from(corners) - 1.0 + border).contains(&(at / square_m))
    };
    let points = stripe.u_px.iter().zip(&stripe.v_px).filter_map(|(&u, &v)| {
        let seen = Point2::new(u.into(), v.into());
        let ray = camera.ray(DistortedPixel(seen))?;
        let on = placed.meet(&board_from_camera, ray);
        let point = pose.camera_from_board * on;
        let straight = Point2::new(ray.x * camera.fx_px, ray.y * camera.fy_px);
        (inside(on.x, board.columns) && inside(on.y, board.rows)).then_some(OnBoard {
            seen,
            straight,
            point,
        })
    });
    points.collect()
}

impl Placed<'_> {
    /// Returns where a ray from the lens meets the board, in the board's frame.
    fn meet(&self, board_from_camera: &Isometry3<f64>, ray: Vector3<f64>) -> Point3<f64> {
        let (lens, ray) = (board_from_camera * Point3::origin(), board_from_camera * ray);
        let mut on = Point3::origin();
        for _ in 0..SURFACE_STEPS {
            let at = self.board.in_target(on.xy(), self.square_m);
            on = lens + ray * ((self.shape.height_m(at.x, at.y) - lens.z) / ray.z);
        }
        on
    }
}

#[derive(Clone, Copy)]
struct Line {
    through: Point2<f64>,
    direction: Vector2<f64>,
}

impl Line {
    fn distance(&self, point: Point2<f64>) -> f64 {
        self.direction.perp(&(point - self.through))
    }

    /// Fits a line by least squares of the distances.
    fn through(points: &[OnBoard]) -> Option<Self> {
        let count = points.len() as f64;
        let sum: Vector2<f64> = points.iter().map(|point| point.straight.coords).sum();
        let middle = sum / count;
        let spread: Matrix2<f64> = points
            .iter()
            .map(|point| {
                let off = point.straight.coords - middle;
                off * off.transpose()
            })
            .sum();
        let eigen = spread.symmetric_eigen();
        let long = usize::from(eigen.eigenvalues[1] > eigen.eigenvalues[0]);
        let direction = eigen.eigenvectors.column(long).into_owned();
        (points.len() > 1).then_some(Self { through: middle.into(), direction })
    }
}

/// Returns the line through two of the points that has most points close to it.
fn best_line(points: &[OnBoard]) -> Option<Line> {
    let every = points.len().div_ceil(MAX_TRIED).max(1);
    let tried: Vec<_> = points.iter().step_by(every).map(|point| point.straight).collect();
    let mut best: Option<(usize, Line)> = None;
    for (i, &through) in tried.iter().enumerate() {
        for other in &tried[i + 1..] {
            let Some(direction) = (other - through).try_normalize(1e-9) else { continue };
            let line = Line { through, direction };
            let close = points
                .iter()
                .filter(|point| line.distance(point.straight).abs() <= INLIER_PX)
                .count();
            if best.is_none_or(|(most, _)| close > most) {
                best = Some((close, line));
            }
        }
    }
    best.map(|(_, line)| line)
}
