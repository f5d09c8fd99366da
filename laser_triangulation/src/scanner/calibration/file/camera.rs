//! A camera and the other entries of its file.

use nalgebra::{Point3, Unit, Vector3};
use serde::Deserialize;

use super::raw::RawCamera;
use crate::scanner::{
    axis::{Axis, AxisKind},
    calibration::{
        Alignment, AxisQuality, CalibrationError, CameraAndPlane, CameraCalibration, CameraQuality,
        PartPose, PlaneQuality,
    },
    camera::Camera,
    laser_plane::LaserPlane,
};

const FINITE: &str = "finite numbers";
/// Lengths accepted for a hand-written unit vector, which is then normalised; a computed one is left as it is.
const HAND_WRITTEN: std::ops::RangeInclusive<f64> = 0.99..=1.01;
const COMPUTED: f64 = 1e-12;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraFile {
    #[serde(rename = "type")]
    _kind: Option<String>,
    #[serde(default = "camera_name")]
    camera_name: String,
    image_width: u32,
    image_height: u32,
    camera_matrix: Matrix,
    distortion_model: String,
    distortion_coefficients: Matrix,
    // For rectified images, which are not supported.
    #[serde(rename = "rectification_matrix")]
    _rectification_matrix: Option<Matrix>,
    #[serde(rename = "projection_matrix")]
    _projection_matrix: Option<Matrix>,
    #[serde(default)]
    tilt_rad: [f64; 2],
    camera_quality: Option<CameraQuality>,
    frame_id: Option<String>,
    laser_plane: Option<PlaneEntry>,
    plane_quality: Option<PlaneQuality>,
    alignment: Option<AlignmentEntry>,
    part: Option<PartEntry>,
    axis: Option<AxisEntry>,
    axis_quality: Option<AxisQuality>,
    calibrated_at: Option<String>,
    #[serde(rename = "id")]
    _id: Option<String>,
}

fn camera_name() -> String {
    "camera".to_owned()
}

/// A matrix in the format of `OpenCV`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Matrix {
    rows: u32,
    cols: u32,
    data: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlaneEntry {
    normal: [f64; 3],
    distance_m: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AlignmentEntry {
    origin_m: [f64; 2],
    angle_rad: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PartEntry {
    origin_m: [f64; 3],
    rotation_rad: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AxisEntry {
    kind: String,
    point_m: Option<[f64; 3]>,
    direction: [f64; 3],
    #[serde(default = "one")]
    scale: f64,
}

fn one() -> f64 {
    1.0
}

impl CameraFile {
    pub(super) fn camera_alone(self) -> Result<CameraCalibration, CalibrationError> {
        let camera = self.camera()?;
        Ok(CameraCalibration {
            camera_name: self.camera_name,
            camera,
            quality: self.camera_quality,
            calibrated_at: self.calibrated_at,
        })
    }

    pub(super) fn camera_and_plane(self) -> Result<CameraAndPlane, CalibrationError> {
        let camera = self.camera()?;
        let missing = |key| CalibrationError::value(key, "missing", "what calibrate plane writes");
        let geometry = CameraAndPlane {
            frame_id: self.frame_id.ok_or_else(|| missing("frame_id"))?,
            camera_name: self.camera_name,
            camera,
            camera_quality: self.camera_quality,
            plane: self.laser_plane.ok_or_else(|| missing("laser_plane"))?.plane()?,
            plane_quality: self.plane_quality,
            alignment: self.alignment.map(AlignmentEntry::alignment).transpose()?,
            part: self.part.map(PartEntry::part).transpose()?,
            axis: self.axis.map(AxisEntry::axis).transpose()?,
            axis_quality: self.axis_quality,
            calibrated_at: self.calibrated_at,
        };
        geometry.check()?;
        Ok(geometry)
    }

    fn camera(&self) -> Result<Camera, CalibrationError> {
        let k = &self.camera_matrix;
        if (k.rows, k.cols) != (3, 3) {
            let value = format!("{} x {}", k.rows, k.cols);
            return Err(CalibrationError::value("camera_matrix", value, "3 rows and 3 columns"));
        }
        let raw = RawCamera {
            camera_name: self.camera_name.clone(),
            width_px: self.image_width,
            height_px: self.image_height,
            matrix: k.data.clone(),
            model: self.distortion_model.clone(),
            coefficients: self.distortion_coefficients.data.clone(),
            tilt_rad: self.tilt_rad,
        };
        let camera = raw.camera()?;
        self.check_quality(camera)?;
        Ok(camera)
    }

    /// Checks that a covariance refers to values of this camera.
    fn check_quality(&self, camera: Camera) -> Result<(), CalibrationError> {
        let Some(quality) = &self.camera_quality else { return Ok(()) };
        let mut camera = camera;
        for name in &quality.parameters {
            if camera.value_mut(name).is_none() {
                return Err(CalibrationError::value(
                    "camera_quality.parameters",
                    name.clone(),
                    "fx, fy, cx, cy, tau_x, tau_y and the coefficients of the distortion model",
                ));
            }
        }
        let count = quality.parameters.len();
        let is_square = [0, count * count].contains(&quality.covariance.len());
        if !is_square || !quality.covariance.iter().all(|value| value.is_finite()) {
            return Err(CalibrationError::value(
                "camera_quality.covariance",
                format!("{:?}", quality.covariance),
                "as many finite numbers as parameters times parameters, or none",
            ));
        }
        Ok(())
    }
}

impl PlaneEntry {
    fn plane(&self) -> Result<LaserPlane, CalibrationError> {
        if !(self.distance_m.is_finite() && self.distance_m > 0.0) {
            return Err(CalibrationError::value(
                "laser_plane.distance_m",
                self.distance_m.to_string(),
                "a finite number above 0 (turn the normal around)",
            ));
        }
        let normal = unit("laser_plane.normal", self.normal)?;
        Ok(LaserPlane { normal, distance_m: self.distance_m })
    }
}

impl AlignmentEntry {
    fn alignment(self) -> Result<Alignment, CalibrationError> {
        let Self { origin_m, angle_rad } = self;
        if ![origin_m[0], origin_m[1], angle_rad].iter().all(|value| value.is_finite()) {
            let value = format!("{origin_m:?}, {angle_rad}");
            return Err(CalibrationError::value("alignment", value, FINITE));
        }
        Ok(Alignment { origin_m, angle_rad })
    }
}

impl PartEntry {
    fn part(self) -> Result<PartPose, CalibrationError> {
        let Self { origin_m, rotation_rad } = self;
        if !origin_m.iter().chain(&rotation_rad).all(|value| value.is_finite()) {
            let value = format!("{origin_m:?}, {rotation_rad:?}");
            return Err(CalibrationError::value("part", value, FINITE));
        }
        Ok(PartPose { origin_m, rotation_rad })
    }
}

impl AxisEntry {
    fn axis(self) -> Result<Axis, CalibrationError> {
        let kind = AxisKind::from_name(&self.kind).ok_or_else(|| {
            CalibrationError::value("axis.kind", self.kind.clone(), "prismatic or revolute")
        })?;
        let point_m = match (kind, self.point_m) {
            (AxisKind::Prismatic, _) => [0.0; 3],
            (AxisKind::Revolute, Some(point_m)) if point_m.iter().all(|m| m.is_finite()) => point_m,
            (AxisKind::Revolute, point_m) => {
                let value = format!("{point_m:?}");
                let allowed = "three finite numbers: a point on the axis";
                return Err(CalibrationError::value("axis.point_m", value, allowed));
            }
        };
        if !(self.scale.is_finite() && self.scale != 0.0) {
            return Err(CalibrationError::value(
                "axis.scale",
                self.scale.to_string(),
                "a finite number, not 0",
            ));
        }
        let direction = unit("axis.direction", self.direction)?;
        Ok(Axis { kind, point_m: Point3::from(point_m), direction, scale: self.scale })
    }
}

fn unit(key: &'static str, values: [f64; 3]) -> Result<Unit<Vector3<f64>>, CalibrationError> {
    let vector = Vector3::from(values);
    let length = vector.norm();
    if !HAND_WRITTEN.contains(&length) {
        return Err(CalibrationError::value(key, format!("{values:?}"), "a vector of length 1"));
    }
    let is_computed = (length - 1.0).abs() < COMPUTED;
    Ok(if is_computed { Unit::new_unchecked(vector) } else { Unit::new_normalize(vector) })
}
