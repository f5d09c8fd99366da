//! Calibrations without a camera.

use serde::Deserialize;

use crate::scanner::calibration::{
    Calibration, CalibrationError, Projective, StepsQuality, VerticalIncidence,
};

/// Formula 6.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct VerticalFile {
    #[serde(rename = "type")]
    _kind: String,
    frame_id: String,
    image_distance_m: f64,
    object_distance_m: f64,
    beta_rad: f64,
    pixel_pitch_m: f64,
    base_row_px: f64,
    center_column_px: f64,
    height_sign: i8,
    steps_quality: Option<StepsQuality>,
    #[serde(rename = "id")]
    _id: Option<String>,
}

impl VerticalFile {
    pub(super) fn calibration(self) -> Result<Calibration, CalibrationError> {
        let geometry = VerticalIncidence {
            frame_id: self.frame_id,
            image_distance_m: self.image_distance_m,
            object_distance_m: self.object_distance_m,
            beta_rad: self.beta_rad,
            pixel_pitch_m: self.pixel_pitch_m,
            base_row_px: self.base_row_px,
            center_column_px: self.center_column_px,
            height_sign: self.height_sign,
            quality: self.steps_quality,
        };
        geometry.check()?;
        Ok(Calibration::VerticalIncidence(geometry))
    }
}

/// A homography.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ProjectiveFile {
    #[serde(rename = "type")]
    _kind: String,
    frame_id: String,
    image_width: u32,
    image_height: u32,
    homography: [f64; 9],
    steps_quality: Option<StepsQuality>,
    calibrated_at: Option<String>,
    #[serde(rename = "id")]
    _id: Option<String>,
}

impl ProjectiveFile {
    pub(super) fn calibration(self) -> Result<Calibration, CalibrationError> {
        let geometry = Projective {
            frame_id: self.frame_id,
            width_px: self.image_width,
            height_px: self.image_height,
            homography: self.homography,
            quality: self.steps_quality,
            calibrated_at: self.calibrated_at,
        };
        geometry.check()?;
        Ok(Calibration::Projective(Box::new(geometry)))
    }
}
