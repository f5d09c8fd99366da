//! How the laser plane follows the camera and the board's bend: the plane is fitted again to the same corners and the same
//! pixels of the stripe, with a camera or a bend that is off by its standard deviation.
//!
//! All boards share an error of the camera, so leaving out boards does not show it.

use nalgebra::{Matrix3, Matrix3xX, Point3, Vector3};

use super::{
    board::Board,
    board_bend,
    board_shape::{BEND, BoardShape},
    joint_fit::Shared,
    laser_lines::{BoardLine, LaserLines},
    laser_plane::{offset, plane_through},
    pose,
    stripe_line::{self, Placed},
};
use crate::{
    metrology::principal_axes::axes,
    scanner::{calibration::CameraQuality, camera::Camera, laser_plane::LaserPlane},
};

/// Parts of a standard deviation that are tried until the shifted camera sees all boards.
const PARTS: [f64; 3] = [1.0, 0.1, 0.01];

/// The plane of a set of lines, and where it comes from.
pub(super) struct Source<'a> {
    /// All lines, with their camera and boards.
    pub(super) found: &'a LaserLines,
    /// The lines on which the plane was fitted.
    pub(super) kept: &'a [&'a BoardLine],
    /// That plane.
    pub(super) plane: LaserPlane,
}

/// How the plane follows the camera.
#[derive(Clone, Debug)]
pub(super) struct CameraResponse {
    /// Change of the two tilts, radians, and of the distance, metres, for one unit of each of the camera's parameters.
    pub(super) per_parameter: Matrix3xX<f64>,
    /// The covariance that the camera's gives the plane.
    pub(super) covariance: Matrix3<f64>,
}

impl Source<'_> {
    /// Returns how the plane follows the camera; `None` if a camera within its uncertainty does not see all boards.
    ///
    /// The camera is shifted along the principal axes of its covariance: single parameters shifted by their own standard
    /// deviation, without those that are correlated with them, would be no camera that the views allow.
    pub(super) fn of_camera(&self, quality: &CameraQuality) -> Option<CameraResponse> {
        let num = quality.parameters.len();
        let variances: Vec<_> = (0..num).map(|i| quality.covariance[i * num + i]).collect();
        let mut per_parameter = Matrix3xX::zeros(num);
        let mut covariance = Matrix3::zeros();
        for axis in axes(num, &quality.covariance) {
            let response = self.central(|part| {
                let mut camera = self.found.camera;
                for (name, by) in quality.parameters.iter().zip(&axis) {
                    *camera.value_mut(name)? += part * by;
                }
                self.refitted(&camera, &self.bend_under(&camera)?)
            })?;
            covariance += response * response.transpose();
            // The axes are orthogonal once each parameter is scaled to its standard deviation.
            let scaled = || axis.iter().zip(&variances).filter(|(_, variance)| **variance > 0.0);
            let square: f64 = scaled().map(|(by, variance)| by * by / variance).sum();
            for (at, (by, variance)) in axis.iter().zip(&variances).enumerate() {
                if *variance > 0.0 {
                    let share = response * (by / (variance * square));
                    per_parameter.column_mut(at).iter_mut().zip(&share).for_each(|(a, b)| *a += b);
                }
            }
        }
        Some(CameraResponse { per_parameter, covariance })
    }

    /// Returns the covariance that the bend gives the plane: its own if the plane accounts for it; otherwise the
    /// difference that the bend would make. `None` if the boards cannot be placed with such a bend.
    pub(super) fn of_bend(&self) -> Option<Matrix3<f64>> {
        let Some(bend) = self.found.bend else { return Some(Matrix3::zeros()) };
        let camera = &self.found.camera;
        if !bend.is_shared {
            let off = offset(&self.plane, &self.refitted(camera, &bend.shape)?);
            return Some(off * off.transpose());
        }
        let mut covariance = Matrix3::zeros();
        for axis in axes(BEND.len(), bend.covariance.as_slice()) {
            let response = self.central(|part| {
                let mut shape = bend.shape;
                for (term, by) in BEND.into_iter().zip(&axis) {
                    *shape.value_mut(term) += part * by;
                }
                self.refitted(camera, &shape)
            })?;
            covariance += response * response.transpose();
        }
        Some(covariance)
    }

    /// Returns the change of the plane for one standard deviation, from shifts by the same part of it both ways.
    fn central(&self, shifted: impl Fn(f64) -> Option<LaserPlane>) -> Option<Vector3<f64>> {
        let found = PARTS.into_iter().find_map(|part| {
            let (ahead, behind) = (shifted(part)?, shifted(-part)?);
            let change = offset(&self.plane, &ahead) - offset(&self.plane, &behind);
            Some(change / (2.0 * part))
        });
        found.filter(|change| change.iter().all(|value| value.is_finite()))
    }

    /// Returns the bend that the boards have under another camera.
    fn bend_under(&self, camera: &Camera) -> Option<BoardShape> {
        let Some(bend) = self.found.bend.filter(|bend| bend.is_shared) else {
            return Some(BoardShape::default());
        };
        let boards: Vec<_> = self.found.boards.iter().map(|(_, board)| board).collect();
        let shared = Shared { camera: Vec::new(), shape: BEND.to_vec() };
        let fit = board_bend::joint(&boards, self.found.square_m, camera, bend.shape, &shared)?;
        Some(fit.state.shape)
    }

    /// Returns the plane through the same lines, under another camera and with another bend.
    fn refitted(&self, camera: &Camera, shape: &BoardShape) -> Option<LaserPlane> {
        let lines: Option<Vec<_>> =
            self.kept.iter().map(|line| self.line(line, camera, shape)).collect();
        plane_through(lines?.iter().flatten()).ok()
    }

    fn line(
        &self,
        line: &BoardLine,
        camera: &Camera,
        shape: &BoardShape,
    ) -> Option<Vec<Point3<f64>>> {
        let board = self.board(line.index)?;
        let square_m = self.found.square_m;
        let pose = pose::fit(camera, &board.points(square_m, shape))?;
        let placed = Placed { board, pose: &pose, shape, square_m };
        stripe_line::points(camera, &placed, &line.line.seen)
    }

    fn board(&self, index: usize) -> Option<&Board> {
        self.found.boards.iter().find(|(of, _)| *of == index).map(|(_, board)| board)
    }
}
