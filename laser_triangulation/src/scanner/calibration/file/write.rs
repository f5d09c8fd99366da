//! Writes calibrations as text. `{:?}` writes the shortest text that reads back as the same number, and always as a
//! float.

use std::fmt::{Display, Write};

use serde::Serialize;

use crate::scanner::{
    axis::{Axis, AxisKind},
    calibration::{
        Calibration, CameraAndPlane, CameraCalibration, CameraQuality, PartPose, Projective,
        VerticalIncidence,
    },
    camera::Camera,
};

/// A file under construction.
struct Yaml(String);

impl Yaml {
    fn new(kind: &str) -> Self {
        Self(format!("type: {kind}\n"))
    }

    fn entry(mut self, key: &str, value: impl Display) -> Self {
        // Writing to a string does not fail.
        writeln!(self.0, "{key}: {value}").unwrap_or_default();
        self
    }

    fn number(self, key: &str, value: f64) -> Self {
        self.entry(key, format_args!("{value:?}"))
    }

    fn text(self, key: &str, value: &str) -> Self {
        // A JSON string is a YAML string.
        let quoted = serde_json::to_string(value).unwrap_or_default();
        self.entry(key, quoted)
    }

    fn matrix(self, key: &str, cols: usize, data: &[f64]) -> Self {
        let rows = data.len() / cols;
        self.entry(key, format_args!("{{rows: {rows}, cols: {cols}, data: {data:?}}}"))
    }

    /// A structure on one line: JSON is YAML.
    fn structure<T: Serialize>(self, key: &str, value: Option<&T>) -> Self {
        match value.and_then(|value| serde_json::to_string(value).ok()) {
            Some(value) => self.entry(key, value),
            None => self,
        }
    }

    fn end(self, calibrated_at: Option<&str>, id: &str) -> String {
        let dated = match calibrated_at {
            Some(time) => self.text("calibrated_at", time),
            None => self,
        };
        dated.text("id", id).0
    }
}

/// Writes a calibration that can measure.
pub(in crate::scanner::calibration) fn write(calibration: &Calibration) -> String {
    let id = calibration.id();
    match calibration {
        Calibration::VerticalIncidence(geometry) => vertical(geometry).end(None, &id),
        Calibration::Projective(geometry) => {
            projective(geometry).end(geometry.calibrated_at.as_deref(), &id)
        }
        Calibration::CameraAndPlane(geometry) => {
            camera_and_plane(geometry).end(geometry.calibrated_at.as_deref(), &id)
        }
    }
}

/// Writes a camera alone.
pub(in crate::scanner::calibration) fn write_camera(calibration: &CameraCalibration) -> String {
    let CameraCalibration { camera_name, camera, quality, calibrated_at } = calibration;
    camera_entries(Yaml::new("camera"), camera_name, camera, quality.as_ref())
        .end(calibrated_at.as_deref(), &calibration.id())
}

fn vertical(geometry: &VerticalIncidence) -> Yaml {
    Yaml::new("vertical_incidence")
        .text("frame_id", &geometry.frame_id)
        .number("image_distance_m", geometry.image_distance_m)
        .number("object_distance_m", geometry.object_distance_m)
        .number("beta_rad", geometry.beta_rad)
        .number("pixel_pitch_m", geometry.pixel_pitch_m)
        .number("base_row_px", geometry.base_row_px)
        .number("center_column_px", geometry.center_column_px)
        .entry("height_sign", geometry.height_sign)
        .structure("steps_quality", geometry.quality.as_ref())
}

fn projective(geometry: &Projective) -> Yaml {
    Yaml::new("projective")
        .text("frame_id", &geometry.frame_id)
        .entry("image_width", geometry.width_px)
        .entry("image_height", geometry.height_px)
        .entry("homography", format_args!("{:?}", geometry.homography))
        .structure("steps_quality", geometry.quality.as_ref())
}

fn camera_and_plane(geometry: &CameraAndPlane) -> Yaml {
    let CameraAndPlane { camera_name, camera, camera_quality, plane, .. } = geometry;
    let kind = Yaml::new("camera_and_plane");
    let mut yaml = camera_entries(kind, camera_name, camera, camera_quality.as_ref())
        .text("frame_id", &geometry.frame_id)
        .entry(
            "laser_plane",
            format_args!(
                "{{normal: {:?}, distance_m: {:?}}}",
                plane.normal.as_slice(),
                plane.distance_m
            ),
        )
        .structure("plane_quality", geometry.plane_quality.as_ref());
    if let Some(alignment) = &geometry.alignment {
        let (origin_m, angle_rad) = (alignment.origin_m, alignment.angle_rad);
        yaml = yaml.entry(
            "alignment",
            format_args!("{{origin_m: {origin_m:?}, angle_rad: {angle_rad:?}}}"),
        );
    }
    if let Some(PartPose { origin_m, rotation_rad }) = &geometry.part {
        let entry = format_args!("{{origin_m: {origin_m:?}, rotation_rad: {rotation_rad:?}}}");
        yaml = yaml.entry("part", entry);
    }
    if let Some(axis) = &geometry.axis {
        yaml = axis_entry(yaml, axis);
    }
    yaml.structure("axis_quality", geometry.axis_quality.as_ref())
}

fn axis_entry(yaml: Yaml, axis: &Axis) -> Yaml {
    let point = match axis.kind {
        AxisKind::Prismatic => String::new(),
        AxisKind::Revolute => format!("point_m: {:?}, ", axis.point_m.coords.as_slice()),
    };
    let (kind, direction) = (axis.kind.name(), axis.direction.as_slice());
    yaml.entry(
        "axis",
        format_args!("{{kind: {kind}, {point}direction: {direction:?}, scale: {:?}}}", axis.scale),
    )
}

/// Writes a camera in the format of ROS's `camera_calibration_parsers`, and the entries that format lacks.
fn camera_entries(
    yaml: Yaml,
    name: &str,
    camera: &Camera,
    quality: Option<&CameraQuality>,
) -> Yaml {
    let Camera { fx_px, fy_px, cx_px, cy_px, .. } = *camera;
    let coefficients = camera.distortion.coefficients();
    let yaml = yaml
        .text("camera_name", name)
        .entry("image_width", camera.width_px)
        .entry("image_height", camera.height_px)
        .matrix("camera_matrix", 3, &[fx_px, 0.0, cx_px, 0.0, fy_px, cy_px, 0.0, 0.0, 1.0])
        .entry("distortion_model", camera.distortion.name())
        .matrix("distortion_coefficients", coefficients.len(), &coefficients);
    let rectification = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let projection = [fx_px, 0.0, cx_px, 0.0, 0.0, fy_px, cy_px, 0.0, 0.0, 0.0, 1.0, 0.0];
    let yaml = yaml.matrix("rectification_matrix", 3, &rectification).matrix(
        "projection_matrix",
        4,
        &projection,
    );
    let is_tilted = camera.tilt_rad.iter().any(|angle| *angle != 0.0);
    let yaml = if is_tilted {
        yaml.entry("tilt_rad", format_args!("{:?}", camera.tilt_rad))
    } else {
        yaml
    };
    yaml.structure("camera_quality", quality)
}
