//! Quality and uncertainty of a calibration.

use serde::{Deserialize, Serialize};

use super::{Bow, CalibratedVolume, CameraAndPlane};
use crate::scanner::camera::View;

/// Quality of a camera calibrated from views of a board.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraQuality {
    /// Root mean square of the distance between seen and projected corners, pixels.
    pub rms_px: f64,
    /// Views that took part.
    pub views_used: u32,
    /// Views that were left out.
    pub views_rejected: u32,
    /// Names of the estimated values, in the order of the covariance: fx, fy, cx, cy, k1 to k6, p1, p2, `tau_x`, `tau_y`.
    #[serde(default)]
    pub parameters: Vec<String>,
    /// Covariance of those values, row-major, in their units; as many rows as parameters, or empty if unknown.
    #[serde(default)]
    pub covariance: Vec<f64>,
    /// Part of the image with corners of the boards; `None` if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub volume: Option<CalibratedVolume>,
}

impl CameraQuality {
    /// Returns true if the covariance of all parameters is stated.
    pub(crate) fn has_covariance(&self) -> bool {
        let num = self.parameters.len();
        num > 0 && self.covariance.len() == num * num
    }

    /// Returns the pixels of an image that shows a part of the sensor for one unit of each parameter: a focal length and the
    /// principal point are in larger pixels.
    fn seen_per_unit(&self, view: &View) -> Vec<f64> {
        let [bx, by] = view.binning.map(f64::from);
        let seen = |name: &String| match name.as_str() {
            "fx" | "cx" => 1.0 / bx,
            "fy" | "cy" => 1.0 / by,
            _ => 1.0,
        };
        self.parameters.iter().map(seen).collect()
    }
}

impl CameraAndPlane {
    /// Returns the geometry with its uncertainty and its volumes in the pixels of an image that shows a part of the sensor.
    pub(super) fn with_quality_seen_through(mut self, view: &View) -> Self {
        if let Some(camera) = self.camera_quality.as_mut() {
            let seen = camera.seen_per_unit(view);
            for (at, value) in camera.covariance.iter_mut().enumerate() {
                let [row, column] = [at / seen.len().max(1), at % seen.len().max(1)];
                *value *= seen.get(row).unwrap_or(&1.0) * seen.get(column).unwrap_or(&1.0);
            }
            let of_plane = self.plane_quality.as_mut().and_then(|of| of.camera_response.as_mut());
            let of_axis = self.axis_quality.as_mut().and_then(|of| of.camera_response.as_mut());
            for response in [of_plane, of_axis].into_iter().flatten() {
                let columns = seen.iter().cycle();
                response.iter_mut().zip(columns).for_each(|(value, seen)| *value /= seen);
            }
        }
        let of_camera = self.camera_quality.as_mut().and_then(|quality| quality.volume.as_mut());
        let of_plane = self.plane_quality.as_mut().and_then(|quality| quality.volume.as_mut());
        for volume in [of_camera, of_plane].into_iter().flatten() {
            *volume = volume.seen_through(view);
        }
        self
    }
}

/// Quality of a laser plane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaneQuality {
    /// Root mean square of the distance of the points from the plane, metres.
    pub rms_m: f64,
    /// Views of the board with the line on it that took part.
    pub boards_used: u32,
    /// Covariance of two tilts of the normal, along
    /// [`LaserPlane::tangents`](crate::scanner::laser_plane::LaserPlane::tangents), radians, and of the distance,
    /// metres; 3 x 3. If `camera_response` is stated, that of a camera without error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<[f64; 9]>,
    /// How tilts and distance follow the camera with which they were measured: their change for one unit of each of the
    /// camera's parameters; row-major, 3 rows with as many columns as [`CameraQuality::parameters`]. `None` if unknown, and
    /// in files of older versions: errors of camera and plane then count as independent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_response: Option<Vec<f64>>,
    /// Part of the image, and depths, with the laser's lines on the boards; `None` if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub volume: Option<CalibratedVolume>,
}

/// Quality of an axis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxisQuality {
    /// Root mean square of the distance between seen and projected points, pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rms_px: Option<f64>,
    /// Root mean square of the distance between observed and modelled points, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rms_m: Option<f64>,
    /// Positions that took part.
    pub positions_used: u32,
    /// One standard deviation of the direction, radians.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction_sigma_rad: Option<f64>,
    /// One standard deviation of the axis's distance from its place, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point_sigma_m: Option<f64>,
    /// One standard deviation of the scale, in its unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale_sigma: Option<f64>,
    /// How the axis follows the camera with which it was measured: the change of two tilts of its direction, along the
    /// `perpendicular_basis` of it, radians, of its place along the same, metres, and of its scale, for one unit of each of
    /// the camera's parameters; row-major, 5 rows with as many columns as [`CameraQuality::parameters`]. `None` if unknown:
    /// errors of axis and camera then count as independent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera_response: Option<Vec<f64>>,
}

/// Quality of a homography or of formula 6, from known heights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepsQuality {
    /// Root mean square of the distance between known and measured heights, metres.
    pub rms_m: f64,
    /// Known heights that took part.
    pub heights_used: u32,
    /// Covariance of the nine entries of the homography, row-major 9 x 9, or of
    /// [`VerticalIncidence::VALUES`](super::VerticalIncidence::VALUES), 4 x 4; or empty if unknown.
    #[serde(default)]
    pub covariance: Vec<f64>,
    /// Part of the image, and heights, of the gauge; `None` if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub volume: Option<CalibratedVolume>,
    /// Contribution of the lens to the uncertainty; `None` if the gauge shows nothing of it, and in files of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bow: Option<Box<Bow>>,
}
