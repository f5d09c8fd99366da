//! The frame of the profiles: origin where the optical axis meets the laser plane, x along the stripe, z towards the camera.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::{Alignment, CameraAndPlane};
use crate::scanner::params::StripeDirection;

impl CameraAndPlane {
    /// Returns the pose of the laser plane's frame in the camera's: `point_in_camera = camera_from_laser *
    /// point_in_laser`, metres.
    ///
    /// x is the direction of growing columns (rows, for a vertical stripe) in the plane; z is perpendicular to it in
    /// the plane and points towards the camera; y completes a right-handed frame, along the normal or against it.
    pub fn camera_from_laser(&self, direction: StripeDirection) -> Isometry3<f64> {
        let normal = self.plane.normal.into_inner();
        let along = match direction {
            StripeDirection::Horizontal => Vector3::x(),
            StripeDirection::Vertical => Vector3::y(),
        };
        let x = (along - normal * normal.dot(&along)).normalize();
        // Towards the camera means against its optical axis.
        let side = if x.cross(&normal).z > 0.0 { -1.0 } else { 1.0 };
        let y = normal * side;
        let axes = Matrix3::from_columns(&[x, y, x.cross(&y)]);
        let rotation =
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        let origin = Translation3::new(0.0, 0.0, self.plane.distance_m / normal.z);
        let unaligned = Isometry3::from_parts(origin, rotation);
        self.alignment.map_or(unaligned, |alignment| unaligned * alignment.pose())
    }
}

impl Alignment {
    /// `unaligned = pose * aligned`. A turn from x to z is one about -y.
    fn pose(&self) -> Isometry3<f64> {
        let [x_m, z_m] = self.origin_m;
        Isometry3::from_parts(
            Translation3::new(x_m, 0.0, z_m),
            UnitQuaternion::from_axis_angle(&-Vector3::y_axis(), self.angle_rad),
        )
    }
}
