//! An axis from a board that moves with the part: prismatic or revolute.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use thiserror::Error;

use super::{board::Board, pose::BoardPose, target::Target};
use crate::scanner::axis::AxisKind;

/// Fewest pictures.
const MIN_FRAMES: usize = 4;
/// Rotation of the board below which the axis counts as prismatic, radians.
const MIN_TURN: f64 = 0.1;
/// Shortest shift, relative to the board's distance from the camera.
const MIN_SHIFT: f64 = 0.01;
/// Largest deviation of the board from its path, relative to the length of that path.
const MAX_OFF: f64 = 0.05;

/// An axis in the camera's frame.
#[derive(Clone, Debug)]
pub(super) struct BoardAxisFit {
    /// Kind of the axis.
    pub(crate) kind: AxisKind,
    /// Direction of motion or of rotation, with arbitrary sign.
    pub(crate) direction: Unit<Vector3<f64>>,
    /// A point of the axis, metres; for a prismatic axis, the middle of the first board.
    pub(crate) point_m: Point3<f64>,
    /// Position of every picture relative to the first, metres or radians.
    pub(crate) shown: Vec<f64>,
    /// Root mean square distance of the board's middle from its path, metres.
    pub(crate) rms_m: f64,
    /// One standard deviation of the direction, radians.
    pub(crate) direction_sigma_rad: f64,
}

/// The reason why a board determines no axis.
#[derive(Debug, Error, PartialEq)]
pub enum BoardAxisError {
    /// Too few pictures.
    #[error(
        "pictures with a usable board at a known position: {frames}, at least {MIN_FRAMES} are needed"
    )]
    Few {
        /// Pictures with the whole board.
        frames: usize,
    },
    /// The board does not move.
    #[error(
        "the board moves by only {moved_mm:.1} mm and turns by {turned_deg:.1} degrees: move the axis farther between the \
         pictures"
    )]
    Still {
        /// Distance from first to last position, millimetres.
        moved_mm: f64,
        /// Largest angle, degrees.
        turned_deg: f64,
    },
    /// The path is neither a straight line nor a circle.
    #[error(
        "the board's middle leaves its way by {off_mm:.2} mm: it does not move with one axis, the board slips on it, \
         or it turns by a quarter or more between two usable pictures (only a ChArUco board may)"
    )]
    Crooked {
        /// Root mean square deviation, millimetres.
        off_mm: f64,
    },
}

/// Fits the axis that moves the boards, given their poses.
///
/// # Errors
/// Too few boards, boards that do not move, or boards that do not move about one axis.
pub(super) fn fit(
    target: &Target,
    boards: &[(&Board, &BoardPose)],
) -> Result<BoardAxisFit, BoardAxisError> {
    let frames = boards.len();
    if frames < MIN_FRAMES {
        return Err(BoardAxisError::Few { frames });
    }
    let poses = followed(target, boards);
    let turns: Vec<_> =
        poses.iter().map(|pose| pose.rotation * poses[0].rotation.inverse()).collect();
    let turned = turns.iter().map(UnitQuaternion::angle).fold(0.0, f64::max);
    let fit = if turned > MIN_TURN { turning(&poses, &turns) } else { shifting(&poses) };
    let ends = fit
        .shown
        .iter()
        .fold((0.0, 0.0), |(low, high): (f64, f64), &at| (low.min(at), high.max(at)));
    let way_m = match fit.kind {
        AxisKind::Prismatic => ends.1 - ends.0,
        AxisKind::Revolute => {
            let arm = poses[0].translation.vector - fit.point_m.coords;
            (ends.1 - ends.0) * arm.norm().max(0.1 * board_size_m(target))
        }
    };
    let is_still =
        fit.kind == AxisKind::Prismatic && way_m < MIN_SHIFT * poses[0].translation.vector.norm();
    if is_still {
        let (moved_mm, turned_deg) = (1e3 * way_m, turned.to_degrees());
        return Err(BoardAxisError::Still { moved_mm, turned_deg });
    }
    if fit.rms_m > MAX_OFF * way_m {
        return Err(BoardAxisError::Crooked { off_mm: 1e3 * fit.rms_m });
    }
    Ok(fit)
}

fn board_size_m(target: &Target) -> f64 {
    let [columns, rows] = target.span();
    target.unit_m() * f64::from(columns.max(rows))
}

/// Returns the poses of the board's middle. Checkerboards and circles look the same after half a turn, or may be found
/// turned: of their possible poses, each picture gets the one with the smallest rotation from the previous picture.
fn followed(target: &Target, boards: &[(&Board, &BoardPose)]) -> Vec<Isometry3<f64>> {
    let mut poses: Vec<Isometry3<f64>> = Vec::with_capacity(boards.len());
    let first = boards[0].0;
    let [columns, rows] = target.span();
    for (board, pose) in boards {
        let half = |corners: u32| f64::from(corners - 1) * target.unit_m() / 2.0;
        let middle = Translation3::new(half(board.columns), half(board.rows), 0.0);
        let middle = pose.camera_from_board * middle;
        let quarters = (0..4).filter(|quarter| {
            let is_swapped = board.columns != first.columns;
            if target.is_numbered() {
                *quarter == 0
            } else {
                columns == rows || (quarter % 2 == 1) == is_swapped
            }
        });
        let turned = quarters.map(|quarter| {
            let turn =
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), FRAC_PI_2 * f64::from(quarter));
            middle * turn
        });
        let last = poses.last().copied().unwrap_or(middle);
        let angle = |pose: &Isometry3<f64>| pose.rotation.angle_to(&last.rotation);
        poses.extend(turned.min_by(|a, b| angle(a).total_cmp(&angle(b))));
    }
    poses
}

/// Fits the straight line through the middles of the boards.
fn shifting(poses: &[Isometry3<f64>]) -> BoardAxisFit {
    let middles: Vec<_> = poses.iter().map(|pose| pose.translation.vector).collect();
    let count = middles.len() as f64;
    let mean = middles.iter().sum::<Vector3<f64>>() / count;
    let direction = longest(middles.iter().map(|middle| middle - mean));
    let along = |middle: &Vector3<f64>| direction.dot(&(middle - middles[0]));
    let shown: Vec<_> = middles.iter().map(along).collect();
    let off = middles.iter().map(|middle| {
        let off = middle - mean;
        (off - direction.into_inner() * direction.dot(&off)).norm_squared()
    });
    let rms_m = (off.sum::<f64>() / count).sqrt();
    let spread = middles.iter().map(|m| direction.dot(&(m - mean)).powi(2)).sum::<f64>().sqrt();
    BoardAxisFit {
        kind: AxisKind::Prismatic,
        direction,
        point_m: middles[0].into(),
        shown,
        rms_m,
        direction_sigma_rad: rms_m / spread,
    }
}

/// Fits the line whose points do not move.
fn turning(poses: &[Isometry3<f64>], turns: &[UnitQuaternion<f64>]) -> BoardAxisFit {
    let direction = longest(turns.iter().map(UnitQuaternion::scaled_axis));
    let mut shown: Vec<f64> = Vec::with_capacity(turns.len());
    for turn in turns {
        // The part of a rotation that is about the axis.
        let about = 2.0 * turn.imag().dot(&direction).atan2(turn.w);
        let last = shown.last().copied().unwrap_or(0.0);
        shown.push(about - TAU * ((about - last) / TAU).round());
    }
    let first = poses[0].translation.vector;
    // c = R (c - m₀) + m for every picture. Along the axis any point would do: that of the first middle is used.
    let along = direction.into_inner();
    let mut normal = along * along.transpose();
    let mut right = along * along.dot(&first);
    for (pose, turn) in poses.iter().zip(turns) {
        let turn = turn.to_rotation_matrix().into_inner();
        let still = Matrix3::identity() - turn;
        normal += still.transpose() * still;
        right += still.transpose() * (pose.translation.vector - turn * first);
    }
    let point_m: Point3<f64> =
        normal.cholesky().map_or(first, |solved| solved.solve(&right)).into();
    let squares = poses.iter().zip(&shown).map(|(pose, &angle)| {
        let turn = UnitQuaternion::from_axis_angle(&direction, angle);
        let expected = point_m.coords + turn * (first - point_m.coords);
        (pose.translation.vector - expected).norm_squared()
    });
    let rms_m = (squares.sum::<f64>() / poses.len() as f64).sqrt();
    let tilts: Vec<_> = turns
        .iter()
        .map(UnitQuaternion::scaled_axis)
        .filter(|axis| axis.norm() > MIN_TURN)
        .map(|axis| axis.cross(&along).norm() / axis.norm())
        .collect();
    let squares = tilts.iter().map(|tilt| tilt * tilt).sum::<f64>();
    BoardAxisFit {
        kind: AxisKind::Revolute,
        direction,
        point_m,
        shown,
        rms_m,
        direction_sigma_rad: squares.sqrt() / tilts.len().max(1) as f64,
    }
}

/// Returns the direction in which vectors are longest.
fn longest(vectors: impl Iterator<Item = Vector3<f64>>) -> Unit<Vector3<f64>> {
    let spread: Matrix3<f64> = vectors.map(|vector| vector * vector.transpose()).sum();
    let eigen = spread.symmetric_eigen();
    Unit::new_normalize(eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::Checkerboard;

    const TARGET: Target =
        Target::Checkerboard(Checkerboard { columns: 8, rows: 6, square_m: 0.02 });

    fn board() -> Board {
        Board { columns: 8, rows: 6, ..Board::default() }
    }

    fn fitted(poses: &[Isometry3<f64>]) -> Result<BoardAxisFit, BoardAxisError> {
        let board = board();
        let half_turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
        let across = Translation3::new(0.14, 0.10, 0.0) * half_turn;
        // Every third picture starts at the other end of the board.
        let poses: Vec<_> = poses
            .iter()
            .enumerate()
            .map(|(i, pose)| if i % 3 == 2 { pose * across } else { *pose })
            .map(|pose| BoardPose { camera_from_board: pose, residuals_px: Vec::new() })
            .collect();
        let all: Vec<_> = poses.iter().map(|pose| (&board, pose)).collect();
        fit(&TARGET, &all)
    }

    fn start() -> Isometry3<f64> {
        Isometry3::new(Vector3::new(-0.05, 0.02, 0.5), Vector3::new(0.4, -0.2, 0.1))
    }

    #[test]
    fn a_shift_is_found_from_either_end_of_the_board() {
        let along = Unit::new_normalize(Vector3::new(0.9, 0.1, -0.3));
        let at = |i: i32| Translation3::from(along.into_inner() * 0.01 * f64::from(i)) * start();
        let found = fitted(&(0..9).map(at).collect::<Vec<_>>()).unwrap();
        assert_eq!(found.kind, AxisKind::Prismatic);
        assert!(found.direction.cross(&along).norm() < 1e-9 && found.rms_m < 1e-9, "{found:?}");
        assert!((found.shown[8].abs() - 0.08).abs() < 1e-9);
    }

    #[test]
    fn a_turn_is_found_from_either_end_of_the_board() {
        let about = Unit::new_normalize(Vector3::new(0.1, -0.9, -0.4));
        let point = Point3::new(0.02, 0.05, 0.45);
        let at = |i: i32| {
            let turn = UnitQuaternion::from_axis_angle(&about, 0.3 * f64::from(i));
            Isometry3::rotation_wrt_point(turn, point) * start()
        };
        let found = fitted(&(0..15).map(at).collect::<Vec<_>>()).unwrap();
        assert_eq!(found.kind, AxisKind::Revolute);
        assert!(found.direction.cross(&about).norm() < 1e-9 && found.rms_m < 1e-9, "{found:?}");
        let off = found.point_m - point;
        assert!(off.cross(&about).norm() < 1e-9, "{off}");
        assert!((found.shown[14].abs() - 4.2).abs() < 1e-9, "{:?}", found.shown);
    }

    #[test]
    fn a_board_that_stands_still_or_staggers_gives_no_axis() {
        assert!(matches!(fitted(&[start(); 6]), Err(BoardAxisError::Still { .. })));
        let staggering = |i: i32| {
            let aside = if i % 2 == 0 { 0.02 } else { -0.02 };
            Translation3::new(0.01 * f64::from(i), aside, 0.0) * start()
        };
        let found = fitted(&(0..8).map(staggering).collect::<Vec<_>>());
        assert!(matches!(found, Err(BoardAxisError::Crooked { .. })), "{found:?}");
        assert_eq!(fitted(&[start(); 3]).unwrap_err(), BoardAxisError::Few { frames: 3 });
    }
}
