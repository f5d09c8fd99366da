//! The laser's lines on boards whose poses are known from their corners.

use thiserror::Error;

use super::{
    board::{Board, MAX_SCATTER_PX},
    board_bend::{self, BoardBend},
    board_shape::BoardShape,
    laser_finder::{Light, LitCenterline},
    pose::{self, BoardPose},
    stripe_line::{self, LineRejected, Placed, StripeLine},
    target::Target,
};
use crate::{scanner::camera::Camera, statistics::median};

/// A board whose reprojection error is larger than this multiple of the median is rejected.
const OUTLIER_FACTOR: f64 = 4.0;

/// A view of a board with the laser's line on it.
#[derive(Clone, Copy, Debug)]
pub struct BoardView<'a> {
    /// Corners of the board.
    pub board: &'a Board,
    /// Stripe of the picture, in each light that was tried.
    pub stripes: &'a [LitCenterline],
}

/// The laser's line on one board.
#[derive(Clone, Debug)]
pub struct BoardLine {
    /// Index of the view.
    pub index: usize,
    /// The line.
    pub line: StripeLine,
}

/// The laser's lines on all boards that have one.
#[derive(Clone, Debug)]
pub struct LaserLines {
    /// The lines, in the order of the views.
    pub lines: Vec<BoardLine>,
    /// Grey level in which they were found.
    pub light: Light,
    /// Root mean square reprojection error of the boards' corners, pixels.
    pub board_rms_px: f64,
    /// The board's bend under the given camera; `None` if it is flat within the uncertainty. The points take it into
    /// account if the views agree on it.
    pub bend: Option<BoardBend>,
    /// Views without a usable line.
    pub rejected: Vec<RejectedBoard>,
    /// The camera.
    pub(super) camera: Camera,
    /// Side of a square, metres.
    pub(super) square_m: f64,
    /// Boards from which the bend was estimated, by the index of their view: those of all lines, and more.
    pub(super) boards: Vec<(usize, Board)>,
}

/// A view that is not used.
#[derive(Clone, Debug, PartialEq)]
pub struct RejectedBoard {
    /// Index of the view.
    pub index: usize,
    /// Reason for the rejection.
    pub reason: BoardRejection,
}

/// The reason why a board gives no laser line.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum BoardRejection {
    /// No pose explains the corners.
    #[error("no pose of the board in front of this camera explains its corners")]
    NoPose,
    /// The corners do not fit a flat board.
    #[error(
        "corners lie {rms_px:.2} px from a flat board, median of the views {median_px:.2} px: blurred, bent or moving"
    )]
    NotFlat {
        /// Root mean square reprojection error, pixels.
        rms_px: f64,
        /// Median over all views, pixels.
        median_px: f64,
    },
    /// The corners are not those of the target under this camera.
    #[error(
        "corners lie {rms_px:.2} px from where this camera sees the board, allowed is {MAX_SCATTER_PX}: covered by the line, blurred or \
         bent, or of another camera or target"
    )]
    Elsewhere {
        /// Root mean square reprojection error, pixels.
        rms_px: f64,
    },
    /// The stripe on the board is not a line.
    #[error(transparent)]
    Line(#[from] LineRejected),
}

impl LaserLines {
    /// Finds the lines. The laser has the same colour in all pictures: the light that gives most lines is used.
    ///
    /// `border_squares` is the width of the flat rim beyond the inner corners, in squares: the search for the line
    /// extends that far.
    #[must_use]
    pub fn find(
        camera: &Camera,
        views: &[BoardView<'_>],
        target: &Target,
        border_squares: f64,
    ) -> Self {
        let square_m = target.unit_m();
        let (poses, mut rejected) = poses(camera, views, square_m);
        let (poses, bend) = with_bend(camera, views, square_m, poses);
        let boards = poses.iter().map(|(index, _)| (*index, views[*index].board.clone()));
        let boards = boards.collect();
        let (poses, elsewhere): (Vec<_>, Vec<_>) =
            poses.into_iter().partition(|(_, pose)| pose.rms_px() <= MAX_SCATTER_PX);
        rejected.extend(elsewhere.into_iter().map(|(index, pose)| RejectedBoard {
            index,
            reason: BoardRejection::Elsewhere { rms_px: pose.rms_px() },
        }));
        let shape = bend.map_or_else(BoardShape::default, BoardBend::accounted);
        let find = |wanted: Light| {
            let lines = poses.iter().map(|(index, pose)| {
                let BoardView { board, stripes } = views[*index];
                let stripe = stripes.iter().find(|stripe| stripe.light == wanted);
                let placed = Placed { board, pose, shape: &shape, square_m };
                let line = stripe.ok_or(LineRejected::None).and_then(|found| {
                    stripe_line::find(camera, &placed, border_squares, &found.centerline)
                });
                (*index, line)
            });
            (wanted, lines.collect::<Vec<_>>())
        };
        let count = |found: &[(usize, Result<StripeLine, LineRejected>)]| {
            found.iter().filter(|(_, line)| line.is_ok()).count()
        };
        let (light, found) = lights(views)
            .into_iter()
            .map(find)
            .reduce(|best, next| if count(&next.1) > count(&best.1) { next } else { best })
            .unwrap_or((Light::Channel(crate::scanner::params::Channel::Auto), Vec::new()));
        let squares = poses.iter().map(|(_, pose)| pose.rms_px().powi(2)).sum::<f64>();
        let board_rms_px = (squares / poses.len() as f64).sqrt();
        let mut lines = Vec::new();
        for (index, line) in found {
            match line {
                Ok(line) => lines.push(BoardLine { index, line }),
                Err(reason) => rejected.push(RejectedBoard { index, reason: reason.into() }),
            }
        }
        let camera = *camera;
        Self { lines, light, board_rms_px, bend, rejected, camera, square_m, boards }
    }
}

/// Estimates the board's bend from all poses, and repeats them with it. A flat board changes nothing.
fn with_bend(
    camera: &Camera,
    views: &[BoardView<'_>],
    square_m: f64,
    poses: Vec<(usize, BoardPose)>,
) -> (Vec<(usize, BoardPose)>, Option<BoardBend>) {
    let boards: Vec<_> = poses.iter().map(|(index, _)| views[*index].board).collect();
    let Some((bend, _)) = board_bend::find(&boards, square_m, camera, &[]) else {
        return (poses, None);
    };
    if !bend.is_shared {
        return (poses, Some(bend));
    }
    let again = poses.into_iter().map(|(index, flat)| {
        let points = views[index].board.points(square_m, &bend.shape);
        (index, pose::fit(camera, &points).unwrap_or(flat))
    });
    (again.collect(), Some(bend))
}

/// Returns every light that was tried, in order of appearance.
fn lights(views: &[BoardView<'_>]) -> Vec<Light> {
    let mut lights = Vec::new();
    for stripe in views.iter().flat_map(|view| view.stripes) {
        if !lights.contains(&stripe.light) {
            lights.push(stripe.light);
        }
    }
    lights
}

/// Estimates the boards' poses from their corners alone. Returns the views by index, and those that do not fit the
/// camera.
fn poses(
    camera: &Camera,
    views: &[BoardView<'_>],
    square_m: f64,
) -> (Vec<(usize, BoardPose)>, Vec<RejectedBoard>) {
    let flat = BoardShape::default();
    let found: Vec<_> =
        views.iter().map(|view| pose::fit(camera, &view.board.points(square_m, &flat))).collect();
    let mut all_px: Vec<_> = found.iter().flatten().map(BoardPose::rms_px).collect();
    let median_px = median(&mut all_px).unwrap_or(f64::NAN);
    let (mut poses, mut rejected) = (Vec::new(), Vec::new());
    for (index, pose) in found.into_iter().enumerate() {
        let reason = match pose {
            None => BoardRejection::NoPose,
            Some(pose) if pose.rms_px() > OUTLIER_FACTOR * median_px => {
                BoardRejection::NotFlat { rms_px: pose.rms_px(), median_px }
            }
            Some(pose) => {
                poses.push((index, pose));
                continue;
            }
        };
        rejected.push(RejectedBoard { index, reason });
    }
    (poses, rejected)
}
