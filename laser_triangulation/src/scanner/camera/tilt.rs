//! A sensor tilted against the lens, after Scheimpflug: OpenCV's tilted model (calib3d documentation, "Detailed
//! Description"; Louhichi et al. 2007, doi 10.1088/0957-0233/18/8/037).
//!
//! With R the rotation about x by τx and then about y by τy, a point p = (x, y, 1) before the sensor is seen at
//! `s (x', y', 1) = [[R33, 0, -R13], [0, R33, -R23], [0, 0, 1]] R p`.

use nalgebra::{Matrix3, Point2, Vector3};

use super::DistortedPoint;

/// Maps a point of the plane z = 1 to the tilted sensor.
pub(super) fn tilt(
    tilt_rad: [f64; 2],
    DistortedPoint(point): DistortedPoint,
) -> Option<Point2<f64>> {
    if is_straight(tilt_rad) {
        return Some(point);
    }
    map(&matrix(tilt_rad), point)
}

/// Maps a point of the tilted sensor to the plane z = 1.
pub(super) fn untilt(tilt_rad: [f64; 2], on_sensor: Point2<f64>) -> Option<DistortedPoint> {
    if is_straight(tilt_rad) {
        return Some(DistortedPoint(on_sensor));
    }
    map(&matrix(tilt_rad).try_inverse()?, on_sensor).map(DistortedPoint)
}

/// Returns the homography from the plane z = 1 to the sensor.
pub(super) fn matrix([tau_x, tau_y]: [f64; 2]) -> Matrix3<f64> {
    let ((sin_x, cos_x), (sin_y, cos_y)) = (tau_x.sin_cos(), tau_y.sin_cos());
    let about_x = Matrix3::new(1.0, 0.0, 0.0, 0.0, cos_x, sin_x, 0.0, -sin_x, cos_x);
    let about_y = Matrix3::new(cos_y, 0.0, -sin_y, 0.0, 1.0, 0.0, sin_y, 0.0, cos_y);
    let rotation = about_y * about_x;
    let (r13, r23, r33) = (rotation[(0, 2)], rotation[(1, 2)], rotation[(2, 2)]);
    Matrix3::new(r33, 0.0, -r13, 0.0, r33, -r23, 0.0, 0.0, 1.0) * rotation
}

fn is_straight(tilt_rad: [f64; 2]) -> bool {
    tilt_rad.iter().all(|angle| *angle == 0.0)
}

/// Applies the homography; `None` if the ray never meets the sensor.
fn map(matrix: &Matrix3<f64>, point: Point2<f64>) -> Option<Point2<f64>> {
    let mapped = matrix * Vector3::new(point.x, point.y, 1.0);
    (mapped.z > 0.0).then(|| Point2::new(mapped.x / mapped.z, mapped.y / mapped.z))
}
