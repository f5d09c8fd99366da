//! How an axis follows the camera, and the laser plane with it.

use nalgebra::SVector;

use super::camera_response::CameraResponse;
use crate::scanner::{axis::Axis, calibration::CameraAndPlane, pose::perpendicular_basis};

/// Returns the change of two tilts of the axis, radians, of its place along the same two directions, metres, and of its
/// scale, for one unit of each of the camera's parameters, row-major. `None` if the camera's covariance is unknown, or
/// a camera within it does not see the target. `calibrated` is the axis that another camera and plane see.
pub(super) fn find(
    geometry: &CameraAndPlane,
    axis: &Axis,
    calibrated: impl Fn(&CameraAndPlane) -> Option<Axis>,
) -> Option<Vec<f64>> {
    let quality = geometry.camera_quality.as_ref().filter(|of| of.has_covariance())?;
    let change = |camera: &_, by: &[f64]| {
        let other = CameraAndPlane {
            camera: *camera,
            plane: geometry.plane_seen_by(by),
            ..geometry.clone()
        };
        Some(offset(axis, &calibrated(&other)?))
    };
    let response: CameraResponse<5> = CameraResponse::find(&geometry.camera, quality, change)?;
    Some(response.rows())
}

/// Returns what [`Axis::moved`] takes from one axis to another nearby.
fn offset(axis: &Axis, other: &Axis) -> SVector<f64, 5> {
    let across = perpendicular_basis(&axis.direction);
    let tilts = across.map(|to| to.dot(&other.direction));
    // Where the other axis passes this one's point.
    let along = other.direction.dot(&(axis.point_m - other.point_m));
    let off = other.point_m + other.direction.into_inner() * along - axis.point_m;
    let shifts = across.map(|to| to.dot(&off));
    SVector::from([tilts[0], tilts[1], shifts[0], shifts[1], other.scale - axis.scale])
}
