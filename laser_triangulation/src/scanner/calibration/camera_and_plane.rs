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
        self.check_responses()?;
        let [of_camera, of_plane] = self.volumes();
        CalibratedVolume::check(of_camera, "camera_quality.volume")?;
        CalibratedVolume::check(of_plane, "plane_quality.volume")
    }

    /// Checks that the responses refer to the camera's parameters.
    fn check_responses(&self) -> Result<(), CalibrationError> {
        let of_plane = self.plane_quality.as_ref().and_then(|of| of.camera_response.as_ref());
        let of_axis = self.axis_quality.as_ref().and_then(|of| of.camera_response.as_ref());
        let num = self.camera_quality.as_ref().map_or(0, |quality| quality.parameters.len());
        for (key, rows, response, allowed) in [
            (
                "plane_quality.camera_response",
                3,
                of_plane,
                "3 rows with one finite number for each of camera_quality.parameters, or no such key",
            ),
            (
                "axis_quality.camera_response",
                5,
                of_axis,
                "5 rows with one finite number for each of camera_quality.parameters, or no such key",
            ),
        ] {
            let Some(response) = response else { continue };
            if response.len() != rows * num || !response.iter().all(|value| value.is_finite()) {
                return Err(CalibrationError::value(key, format!("{response:?}"), allowed));
            }
        }
        Ok(())
    }

    /// Returns the laser plane that a camera would have measured whose parameters are off by the given amounts: the
    /// plane itself, if its response to the camera is unknown.
    pub(crate) fn plane_seen_by(&self, by: &[f64]) -> LaserPlane {
        let response = self.plane_quality.as_ref().and_then(|of| of.camera_response.as_deref());
        response.map_or(self.plane, |rows| self.plane.moved(product(rows, by)))
    }

    /// Returns the axis that such a camera would have measured.
    pub(crate) fn axis_seen_by(&self, by: &[f64]) -> Option<Axis> {
        let axis = self.axis?;
        let response = self.axis_quality.as_ref().and_then(|of| of.camera_response.as_deref());
        Some(response.map_or(axis, |rows| axis.moved(product(rows, by))))
    }
}

/// Returns the product of a matrix of `N` rows, row-major, with a vector.
fn product<const N: usize>(rows: &[f64], by: &[f64]) -> [f64; N] {
    let mut rows = rows.chunks_exact(by.len().max(1));
    std::array::from_fn(|_| {
        rows.next().map_or(0.0, |row| row.iter().zip(by).map(|(slope, by)| slope * by).sum())
    })
}
