//! A calibrated camera and a laser plane: every pixel defines a ray, which meets the plane.

mod cuts;
mod frame;
mod part;

pub use part::PartPose;

use super::{
    AxisQuality, CalibratedVolume, CalibrationError, CameraQuality, PlaneQuality, file::Id,
};
use crate::scanner::{axis::Axis, camera::Camera, laser_plane::LaserPlane};

/// Smallest slope of the optical axis against the plane; closer to parallel, the origin is far away and 32-bit floats
/// are too coarse.
const LEAST_SLOPE: f64 = 0.05;

/// Camera, laser plane and, where it is known, the axis that moves the part.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraAndPlane {
    /// Name of the laser plane's frame: x along the stripe, z towards the camera, y normal to the plane.
    pub frame_id: String,
    /// Name of the camera.
    pub camera_name: String,
    /// The camera.
    pub camera: Camera,
    /// Uncertainty of the camera.
    pub camera_quality: Option<CameraQuality>,
    /// The laser plane.
    pub plane: LaserPlane,
    /// Uncertainty of the plane.
    pub plane_quality: Option<PlaneQuality>,
    /// Origin of the profiles, if not where the optical axis meets the plane.
    pub alignment: Option<Alignment>,
    /// Frame of the part, if defined by a flat instead of by axis and laser plane.
    pub part: Option<PartPose>,
    /// The axis that moves the part.
    pub axis: Option<Axis>,
    /// Uncertainty of the axis.
    pub axis_quality: Option<AxisQuality>,
    /// Time of the calibration, as in the file.
    pub calibrated_at: Option<String>,
}

/// Another origin of the profiles, in the laser plane: `unaligned = origin + rotation(angle) · aligned`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// x and z of the new origin, metres.
    pub origin_m: [f64; 2],
    /// From the old to the new x axis, towards the old z axis, radians.
    pub angle_rad: f64,
}

impl CameraAndPlane {
    pub(super) fn id(&self) -> String {
        let mut id = Id::new("camera_and_plane").text(&self.frame_id).camera(&self.camera);
        id = id.numbers(self.plane.normal.iter().copied()).numbers([self.plane.distance_m]);
        if let Some(Alignment { origin_m, angle_rad }) = self.alignment {
            id = id.text("alignment").numbers(origin_m).numbers([angle_rad]);
        }
        if let Some(PartPose { origin_m, rotation_rad }) = self.part {
            id = id.text("part").numbers(origin_m).numbers(rotation_rad);
        }
        if let Some(axis) = &self.axis {
            id = id.axis(axis);
        }
        id.finish()
    }

    pub(super) fn check(&self) -> Result<(), CalibrationError> {
        if self.frame_id.is_empty() {
            return Err(CalibrationError::value(
                "frame_id",
                "\"\"",
                "a frame name, as in laser_plane",
            ));
        }
        if self.plane.normal.z.is_nan() || self.plane.normal.z < LEAST_SLOPE {
            return Err(CalibrationError::value(
                "laser_plane.normal",
                format!("{:?}", self.plane.normal.as_slice()),
                "a plane that the optical axis meets before the lens: normal with a third value of 0.05 or more",
            ));
        }
        self.check_response()?;
        let [of_camera, of_plane] = self.volumes();
        CalibratedVolume::check(of_camera, "camera_quality.volume")?;
        CalibratedVolume::check(of_plane, "plane_quality.volume")
    }

    /// Checks that the plane's response refers to the camera's parameters.
    fn check_response(&self) -> Result<(), CalibrationError> {
        let response = self.plane_quality.as_ref().and_then(|of| of.camera_response.as_ref());
        let Some(response) = response else { return Ok(()) };
        let num = self.camera_quality.as_ref().map_or(0, |quality| quality.parameters.len());
        if response.len() == 3 * num && response.iter().all(|value| value.is_finite()) {
            return Ok(());
        }
        Err(CalibrationError::value(
            "plane_quality.camera_response",
            format!("{response:?}"),
            "3 rows with one finite number for each of camera_quality.parameters, or no such line",
        ))
    }
}
