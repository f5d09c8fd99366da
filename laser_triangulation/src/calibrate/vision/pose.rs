//! The pose of a board in front of a known camera.

use nalgebra::{
    DVector, Isometry3, Matrix3, Point2, Point3, Rotation3, Translation3, UnitQuaternion, Vector3,
};

use super::{homography, least_squares};
use crate::scanner::camera::{Camera, DistortedPixel};

/// A board's pose and its residuals.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardPose {
    /// `point_in_camera = camera_from_board * point_on_board`, the board's points in its plane z = 0, but for its bend.
    pub camera_from_board: Isometry3<f64>,
    /// Projected minus observed position of each corner, pixels.
    pub residuals_px: Vec<(f64, f64)>,
}

impl BoardPose {
    /// Returns the root mean square distance between observed and projected corners, pixels.
    pub fn rms_px(&self) -> f64 {
        let sum: f64 = self.residuals_px.iter().map(|(u, v)| u * u + v * v).sum();
        (sum / self.residuals_px.len() as f64).sqrt()
    }

    /// Returns the board's normal in the camera's frame, towards the camera.
    pub fn normal(&self) -> Vector3<f64> {
        let normal = self.camera_from_board.rotation * Vector3::z();
        if normal.z > 0.0 { -normal } else { normal }
    }
}

/// Returns the pose with the least squared reprojection error. `pairs`: points on the board, metres, and in the image,
/// pixels. `None` for fewer than four pairs, for collinear points, or outside the camera's view.
pub(super) fn fit(camera: &Camera, pairs: &[(Point3<f64>, Point2<f64>)]) -> Option<BoardPose> {
    let straight: Option<Vec<_>> = pairs
        .iter()
        .map(|&(on_board, seen)| {
            Some((on_board.xy(), camera.ray(DistortedPixel(seen))?.xy().into()))
        })
        .collect();
    let start = from_homography(&homography::fit(&straight?)?)?;
    let camera_from_board = refine(camera, pairs, start)?;
    let residuals_px = residuals(camera, pairs, &camera_from_board)?;
    Some(BoardPose { camera_from_board, residuals_px })
}

/// Returns the pose of a plane z = 0 from its homography to the plane z = 1 (Zhang 2000, section 3.1).
pub(super) fn from_homography(map: &Matrix3<f64>) -> Option<Isometry3<f64>> {
    let (first, second) = (map.column(0), map.column(1));
    let scale = 2.0 / (first.norm() + second.norm());
    // In front of the lens.
    let scale = if map[(2, 2)] < 0.0 { -scale } else { scale };
    let (x, y) = (first * scale, second * scale);
    let parts = Matrix3::from_columns(&[x, y, x.cross(&y)]).svd(true, true);
    let rotation = Rotation3::from_matrix_unchecked(parts.u? * parts.v_t?);
    let translation = map.column(2) * scale;
    let pose = Isometry3::from_parts(
        Translation3::from(translation),
        UnitQuaternion::from_rotation_matrix(&rotation),
    );
    (scale.is_finite() && translation.z > 0.0).then_some(pose)
}

fn refine(
    camera: &Camera,
    pairs: &[(Point3<f64>, Point2<f64>)],
    start: Isometry3<f64>,
) -> Option<Isometry3<f64>> {
    let at = |step: &DVector<f64>| moved(&start, step);
    let found = least_squares::minimise(DVector::zeros(6), |step| {
        let residuals = residuals(camera, pairs, &at(step))?;
        let both = residuals.into_iter().flat_map(|(u, v)| [u, v]);
        Some(DVector::from_iterator(2 * pairs.len(), both))
    })?;
    Some(at(&found.unknowns))
}

/// Returns a pose shifted and rotated in the camera's frame about the board's origin.
fn moved(pose: &Isometry3<f64>, step: &DVector<f64>) -> Isometry3<f64> {
    let shift = Vector3::new(step[0], step[1], step[2]);
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[3], step[4], step[5]));
    Isometry3::from_parts(Translation3::from(pose.translation.vector + shift), turn * pose.rotation)
}

/// Returns projected minus observed positions, pixels.
fn residuals(
    camera: &Camera,
    pairs: &[(Point3<f64>, Point2<f64>)],
    pose: &Isometry3<f64>,
) -> Option<Vec<(f64, f64)>> {
    let residual = |(on_board, seen): &(Point3<f64>, Point2<f64>)| {
        let DistortedPixel(projected) = camera.project(pose * on_board)?;
        Some((projected.x - seen.x, projected.y - seen.y))
    };
    pairs.iter().map(residual).collect()
}
