//! The calibration of a camera alone.

use super::{CalibrationError, CameraQuality, file};
use crate::scanner::camera::Camera;

/// A calibrated camera, as `calibrate camera` writes it.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraCalibration {
    /// Name of the camera.
    pub camera_name: String,
    /// The camera.
    pub camera: Camera,
    /// Its uncertainty.
    pub quality: Option<CameraQuality>,
    /// Time of the calibration, as in the file.
    pub calibrated_at: Option<String>,
}

impl CameraCalibration {
    /// Reads and checks the camera of a calibration file: one of type `camera` or `camera_and_plane`, or one without a
    /// type, as written by ROS's calibrators; or a camera file of OpenCV, Kalibr, ROS's `camera_calibration` (`ost.txt`), or
    /// a printed `camera_info`.
    ///
    /// # Errors
    /// Unknown or missing keys, wrong types, values outside their range, or an `id` that does not match the values. The
    /// error names the key.
    pub fn from_yaml(text: &str) -> Result<Self, CalibrationError> {
        file::read_camera(text)
    }

    /// Returns the calibration file's text; [`from_yaml`](Self::from_yaml) returns an equal calibration.
    pub fn to_yaml(&self) -> String {
        file::write_camera(self)
    }

    /// Returns sixteen hexadecimal digits that are equal for equal cameras, independent of their names.
    pub(crate) fn id(&self) -> String {
        file::Id::new("camera").camera(&self.camera).finish()
    }
}
