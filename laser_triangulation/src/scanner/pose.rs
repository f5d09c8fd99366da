//! The pose of the laser plane's frame in the camera's optical frame, here for formula 6.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::{
    calibration::{Calibration, VerticalIncidence},
    params::StripeDirection,
};

/// Returns two unit vectors perpendicular to a unit vector and to each other: `first × second = normal`. The first lies
/// as near to x as possible, or to y if the normal is almost x.
pub(crate) fn perpendicular_basis(normal: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let near = if normal.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let first = (near - normal * normal.dot(&near)).normalize();
    [first, normal.cross(&first)]
}

impl Calibration {
    /// Returns the pose of the laser plane's frame in the camera's: `point_in_camera = camera_from_laser * point_in_laser`, metres.
    /// `None` if the calibration has no camera.
    ///
    /// The laser plane's frame: x along the stripe, towards larger columns (rows, for a vertical stripe), z up, towards the
    /// camera, y normal to the plane. The camera's, as ROS has optical frames: x right, y down, z forward. By formula 6
    /// the optical axis meets the image where the base line and the centre line cross.
    pub fn camera_from_laser(&self, direction: StripeDirection) -> Option<Isometry3<f64>> {
        match self {
            Self::VerticalIncidence(geometry) => Some(geometry.camera_from_laser(direction)),
            Self::CameraAndPlane(geometry) => Some(geometry.camera_from_laser(direction)),
            Self::Projective(_) => None,
        }
    }
}

impl VerticalIncidence {
    /// The lens stands on the side of the plane that gives no mirror image: both frames are right-handed.
    pub(super) fn camera_from_laser(&self, direction: StripeDirection) -> Isometry3<f64> {
        let (sin, cos) = self.beta_rad.sin_cos();
        let height_sign = f64::from(self.height_sign);
        let side = match direction {
            StripeDirection::Horizontal => height_sign,
            StripeDirection::Vertical => -height_sign,
        };
        // In the laser plane's frame: the lens stands at (0, side · sin β, cos β) · b and looks at the base point.
        let forward = Vector3::new(0.0, -side * sin, -cos);
        // Across the stripe: where a rising surface moves to in the image, and its opposite for a negative sign.
        let across = Vector3::new(0.0, -side * cos, sin) * height_sign;
        let (right, down) = match direction {
            StripeDirection::Horizontal => (Vector3::x(), across),
            StripeDirection::Vertical => (across, Vector3::x()),
        };
        let axes = Matrix3::from_rows(&[right.transpose(), down.transpose(), forward.transpose()]);
        let rotation =
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        // The base point lies on the optical axis.
        let translation = Translation3::new(0.0, 0.0, self.object_distance_m);
        Isometry3::from_parts(translation, rotation)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use proptest::prelude::*;

    use super::*;

    fn rig(height_sign: i8, beta_rad: f64) -> VerticalIncidence {
        VerticalIncidence {
            frame_id: "laser_plane".into(),
            image_distance_m: 0.026,
            object_distance_m: 0.3,
            beta_rad,
            pixel_pitch_m: 4.8e-6,
            base_row_px: 1024.0,
            center_column_px: 1295.5,
            height_sign,
            quality: None,
        }
    }

    /// Returns (column, row) of a point for the pinhole camera of a ROS `CameraInfo`.
    fn pinhole(
        rig: &VerticalIncidence,
        direction: StripeDirection,
        seen: Point3<f64>,
    ) -> (f64, f64) {
        let f_px = rig.image_distance_m / rig.pixel_pitch_m;
        let (cx, cy) = match direction {
            StripeDirection::Horizontal => (rig.center_column_px, rig.base_row_px),
            StripeDirection::Vertical => (rig.base_row_px, rig.center_column_px),
        };
        (cx + f_px * seen.x / seen.z, cy + f_px * seen.y / seen.z)
    }

    fn directions() -> impl Strategy<Value = StripeDirection> {
        prop::sample::select(vec![StripeDirection::Horizontal, StripeDirection::Vertical])
    }

    proptest! {
        #[test]
        fn a_pinhole_camera_in_that_pose_sees_what_formula_6_takes_back(
            x_m in -0.05..0.05_f64, z_m in -0.05..0.05_f64, beta_rad in 0.1..1.4_f64,
            sign in prop::sample::select(vec![-1_i8, 1]), direction in directions(),
        ) {
            let rig = rig(sign, beta_rad);
            let camera_from_laser = rig.camera_from_laser(direction);
            let seen = camera_from_laser * Point3::new(x_m, 0.0, z_m);
            prop_assert!(seen.z > 0.0, "before the lens");
            let (column, row) = pinhole(&rig, direction, seen);
            let (along_px, across_px) = match direction {
                StripeDirection::Horizontal => (column, row),
                StripeDirection::Vertical => (row, column),
            };
            let height = rig.height(across_px).unwrap();
            prop_assert!((height.z_m - z_m).abs() < 1e-12, "{} for {z_m}", height.z_m);
            prop_assert!((rig.lateral(along_px, height.z_m) - x_m).abs() < 1e-12);
        }

        #[test]
        fn lens_and_angle_are_those_of_the_calibration(
            beta_rad in 0.1..1.4_f64, sign in prop::sample::select(vec![-1_i8, 1]), direction in directions(),
        ) {
            let laser_from_camera = rig(sign, beta_rad).camera_from_laser(direction).inverse();
            let lens = laser_from_camera * Point3::origin();
            prop_assert!(lens.x.abs() < 1e-12);
            prop_assert!((lens.z - 0.3 * beta_rad.cos()).abs() < 1e-12);
            prop_assert!((lens.y.abs() - 0.3 * beta_rad.sin()).abs() < 1e-12);
            // No mirror image: x × y = z in both frames, which a unit quaternion alone would not show.
            let axes = laser_from_camera.rotation.to_rotation_matrix();
            prop_assert!((axes.matrix().determinant() - 1.0).abs() < 1e-12);
        }
    }

    /// The usual rig: the stripe runs from left to right, and a rising surface moves up. Seen through the camera, x
    /// points right and y, the far side, points ahead.
    #[test]
    fn the_usual_camera_stands_on_the_negative_side() {
        let usual = rig(-1, 0.5).camera_from_laser(StripeDirection::Horizontal);
        let lens = usual.inverse() * Point3::origin();
        assert!(lens.y < 0.0, "{lens}");
        let farther = usual * Vector3::y();
        assert!(farther.z > 0.0 && farther.y < 0.0, "{farther}");
    }
}
