//! How the laser plane follows the camera and the board's bend: the plane is fitted again to the same corners and the same
//! pixels of the stripe, with a camera or a bend that is off by its standard deviation.
//!
//! All boards share an error of the camera, so leaving out boards does not show it.

use nalgebra::{Matrix3, Point3};

use super::{
    board::Board,
    board_shape::{BEND, BoardShape},
    camera_response::{CameraResponse, central},
    laser_lines::{BoardLine, LaserLines},
    laser_plane::{offset, plane_through},
    pose,
    stripe_line::{self, Placed},
};
use crate::scanner::{
    calibration::{CameraQuality, axes},
    camera::Camera,
    laser_plane::LaserPlane,
};

/// The plane of a set of lines, and where it comes from.
pub(super) struct Source<'a> {
    /// All lines, with their camera and boards.
    pub(super) found: &'a LaserLines,
    /// The lines on which the plane was fitted.
    pub(super) kept: &'a [&'a BoardLine],
    /// That plane.
    pub(super) plane: LaserPlane,
}

impl Source<'_> {
    /// Returns how the plane follows the camera: two tilts, radians, and the distance, metres. `None` if a camera within its
    /// uncertainty does not see all boards.
    pub(super) fn of_camera(&self, quality: &CameraQuality) -> Option<CameraResponse<3>> {
        CameraResponse::find(&self.found.camera, quality, |camera, _| {
            let other = self.refitted(camera, &self.bend_under(camera)?)?;
            Some(offset(&self.plane, &other))
        })
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
            let response = central(|part| {
                let mut shape = bend.shape;
                for (term, by) in BEND.into_iter().zip(&axis) {
                    *shape.value_mut(term) += part * by;
                }
                Some(offset(&self.plane, &self.refitted(camera, &shape)?))
            })?;
            covariance += response * response.transpose();
        }
        Some(covariance)
    }

    /// Returns the bend that the boards have under another camera.
    fn bend_under(&self, camera: &Camera) -> Option<BoardShape> {
        let Some(bend) = self.found.bend else { return Some(BoardShape::default()) };
        let boards: Vec<_> = self.found.boards.iter().map(|(_, board)| board).collect();
        bend.accounted_under(camera, &boards, self.found.square_m)
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
