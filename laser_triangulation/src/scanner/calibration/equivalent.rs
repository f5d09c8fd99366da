//! Formula 6 as a camera and a plane.

use nalgebra::{Isometry3, Unit, Vector3};

use super::{CameraAndPlane, VerticalIncidence};
use crate::scanner::{
    camera::{Camera, Distortion},
    laser_plane::LaserPlane,
    params::StripeDirection,
};

impl VerticalIncidence {
    /// Returns the same geometry for images with that many columns and rows: a camera without distortion, and the
    /// plane.
    pub fn camera_and_plane(
        &self,
        direction: StripeDirection,
        (width_px, height_px): (u32, u32),
    ) -> CameraAndPlane {
        let focal_px = self.image_distance_m / self.pixel_pitch_m;
        let (cx_px, cy_px) = match direction {
            StripeDirection::Horizontal => (self.center_column_px, self.base_row_px),
            StripeDirection::Vertical => (self.base_row_px, self.center_column_px),
        };
        let camera_from_laser: Isometry3<f64> = self.camera_from_laser(direction);
        let y = camera_from_laser.rotation * Vector3::y();
        let away = if y.z < 0.0 { -y } else { y };
        CameraAndPlane {
            frame_id: self.frame_id.clone(),
            camera_name: "camera".to_owned(),
            camera: Camera {
                width_px,
                height_px,
                fx_px: focal_px,
                fy_px: focal_px,
                cx_px,
                cy_px,
                distortion: Distortion::None,
                tilt_rad: [0.0; 2],
            },
            camera_quality: None,
            plane: LaserPlane {
                normal: Unit::new_normalize(away),
                distance_m: camera_from_laser.translation.vector.dot(&away),
            },
            plane_quality: None,
            alignment: None,
            part: None,
            axis: None,
            axis_quality: None,
            calibrated_at: None,
        }
    }
}
