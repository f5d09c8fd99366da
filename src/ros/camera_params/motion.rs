//! How a camera's part moves, as types.

use crate::{
    ros::parameters::{ParameterError, Section},
    scanner::params::{AxisChoice, MotionParams, MotionSource, ScanDirection},
};

use super::CameraParams;

/// What moves, by the names that messages have for it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Moved {
    /// The joint; empty: the only one.
    pub joint: String,
    /// The part's frame; empty: chosen by what the calibration knows.
    pub part_frame: String,
    /// The frame whose pose is looked up; empty: that of the images.
    pub sensor_frame: String,
}

pub(super) fn moved(values: Section<'_>) -> Result<Moved, ParameterError> {
    Ok(Moved {
        joint: values.text("motion.joint")?.to_owned(),
        part_frame: values.text("motion.part_frame")?.to_owned(),
        sensor_frame: values.text("motion.sensor_frame")?.to_owned(),
    })
}

pub(super) fn params(values: Section<'_>) -> Result<MotionParams, ParameterError> {
    let float = |name: &str| values.float(&format!("motion.{name}"));
    let number = |name: &str| values.unsigned(&format!("motion.{name}")).map(|value| value as u32);
    Ok(MotionParams {
        source: values.choice("motion.source", MotionSource::from_name)?,
        step_m: float("step")?,
        velocity_m_s: float("velocity")?,
        axis: values.choice("motion.axis", AxisChoice::from_name)?,
        scale: float("scale")?,
        encoder_bits: number("encoder_bits")?,
        direction: values.choice("motion.direction", ScanDirection::from_name)?,
        backlash: float("backlash")?,
        max_step: float("max_step")?,
        max_gap_s: float("max_gap")?,
        max_wait_frames: number("max_wait")?,
        exposure_offset_s: float("exposure_offset")?,
    })
}

/// What no single value can show.
pub(super) fn check(camera: &CameraParams) -> Result<(), ParameterError> {
    let MotionParams { source, step_m, velocity_m_s, .. } = camera.scanner.motion;
    let name = |name| camera.full_name(name);
    let conflict = |text: String| Err(ParameterError::Conflict(text));
    if source == MotionSource::Constant && step_m == 0.0 && velocity_m_s == 0.0 {
        return conflict(format!(
            "{} is constant, but {} and {} are both 0.0: set one of them",
            name("motion.source"),
            name("motion.step"),
            name("motion.velocity")
        ));
    }
    if step_m != 0.0 && velocity_m_s != 0.0 {
        return conflict(format!(
            "{} is {step_m} m/frame and {} is {velocity_m_s} m/s: set only one of them",
            name("motion.step"),
            name("motion.velocity")
        ));
    }
    if source == MotionSource::Tf && camera.moved.part_frame.is_empty() {
        return conflict(format!(
            "{} is tf, but {} is empty: name the frame that is scanned in, as in base_link",
            name("motion.source"),
            name("motion.part_frame")
        ));
    }
    Ok(())
}
