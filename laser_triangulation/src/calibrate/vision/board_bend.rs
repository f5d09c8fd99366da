//! Detects a bent board and measures its bend.

use std::fmt;

use nalgebra::{DVector, Matrix3};

use super::{
    board::Board,
    board_shape::{BEND, BoardShape, ShapeTerm},
    joint_fit::{self, JointFit, Shared, State},
    pose,
};
use crate::scanner::camera::Camera;

/// Square of the bend over its uncertainty from which a board counts as bent: a flat one exceeds it once in a million.
const SIGNIFICANT: f64 = 30.0;

/// A bend that explains this share of the squared residuals is that of the board in all views,
const MIN_EXPLAINED: f64 = 0.5;
/// and so is one after which the views agree: largest ratio of their scatter to that of the corners.
const MAX_SCATTER: f64 = 2.0;

/// A bent board, estimated from all its views.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardBend {
    /// Its surface.
    pub(super) shape: BoardShape,
    /// Covariance of the coefficients of [`BEND`].
    pub(super) covariance: Matrix3<f64>,
    /// Difference between the highest and the lowest point of its squares, the outermost included, metres.
    pub bow_m: f64,
    /// One standard deviation of that, metres.
    pub sigma_m: f64,
    /// True if all views show this bend, and results account for it. Otherwise a lens or a board that changes its
    /// shape may look like it: results are those of a flat board.
    pub is_shared: bool,
}

impl BoardBend {
    /// Returns the shape that results account for.
    pub(super) fn accounted(self) -> BoardShape {
        if self.is_shared { self.shape } else { BoardShape::default() }
    }

    /// Returns the shape that results account for under another camera. `None` if that camera does not see the boards.
    pub(super) fn accounted_under(
        self,
        camera: &Camera,
        boards: &[&Board],
        square_m: f64,
    ) -> Option<BoardShape> {
        if !self.is_shared {
            return Some(BoardShape::default());
        }
        let shared = Shared { camera: Vec::new(), shape: BEND.to_vec() };
        Some(joint(boards, square_m, camera, self.shape, &shared)?.state.shape)
    }
}

impl fmt::Display for BoardBend {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (bow_mm, sigma_mm) = (1e3 * self.bow_m, 1e3 * self.sigma_m);
        if self.is_shared {
            write!(formatter, "the board is bent by {bow_mm:.2} ± {sigma_mm:.2} mm")
        } else {
            write!(
                formatter,
                "the board seems bent by {bow_mm:.2} ± {sigma_mm:.2} mm, but not alike in all views"
            )
        }
    }
}

/// Estimates the bend of a board together with the camera's values of these names; no names: with a known camera.
/// `None` for a flat board, within the uncertainty, and for views that leave the bend open.
pub(super) fn find(
    boards: &[&Board],
    square_m: f64,
    camera: &Camera,
    names: &[String],
) -> Option<(BoardBend, JointFit)> {
    let shared = Shared { camera: names.to_vec(), shape: BEND.to_vec() };
    let fit = joint(boards, square_m, camera, BoardShape::default(), &shared)?;
    let first = names.len();
    let covariance = fit.covariance.view((first, first), (BEND.len(), BEND.len())).into_owned();
    let bend = DVector::from_row_slice(&fit.state.shape.bend_per_m);
    let size = bend.dot(&covariance.clone().cholesky()?.solve(&bend));
    let shape = fit.state.shape;
    let size_m = pattern_m(boards, square_m);
    let bow_m = shape.bow_m(size_m);
    let slope = |at: usize| {
        let mut other = shape;
        let step = 1e-6;
        *other.value_mut(ShapeTerm::Bend(at)) += step;
        (other.bow_m(size_m) - bow_m) / step
    };
    let slopes = DVector::from_fn(BEND.len(), |at, _| slope(at));
    let sigma_m = slopes.dot(&(&covariance * &slopes)).sqrt();
    let covariance = Matrix3::from_fn(|i, j| covariance[(i, j)]);
    let is_shared = fit.rms_px.powi(2) < (1.0 - MIN_EXPLAINED) * fit.start_rms_px.powi(2)
        || fit.view_scatter < MAX_SCATTER;
    let bend = BoardBend { shape, covariance, bow_m, sigma_m, is_shared };
    (size > SIGNIFICANT).then_some((bend, fit))
}

/// Fits what is shared, from poses under the given camera. `None` without boards, or if the camera does not see one of them.
pub(super) fn joint(
    boards: &[&Board],
    square_m: f64,
    camera: &Camera,
    shape: BoardShape,
    shared: &Shared,
) -> Option<JointFit> {
    if boards.is_empty() {
        return None;
    }
    let views: Vec<_> = boards.iter().map(|board| board.flat(square_m)).collect();
    let poses = views.iter().map(|view| {
        let pairs: Vec<_> = view.iter().map(|(flat, seen)| (shape.point(*flat), *seen)).collect();
        Some(pose::fit(camera, &pairs)?.camera_from_board)
    });
    let start = State { camera: *camera, shape, poses: poses.collect::<Option<_>>()? };
    joint_fit::minimise(&views, shared, start)
}

/// Returns the size of the board's squares together, metres.
fn pattern_m(boards: &[&Board], square_m: f64) -> [f64; 2] {
    corners(boards.iter().copied()).map(|corners| f64::from(corners + 1) * square_m)
}

/// Returns the largest number of corners seen along the target's columns and rows.
pub(super) fn corners<'a>(boards: impl Iterator<Item = &'a Board>) -> [u32; 2] {
    boards.fold([0; 2], |most, board| {
        let (columns, rows) = (board.columns, board.rows);
        let sides = if board.is_turned { [rows, columns] } else { [columns, rows] };
        [most[0].max(sides[0]), most[1].max(sides[1])]
    })
}
