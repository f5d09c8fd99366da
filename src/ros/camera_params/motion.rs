//! Typed parameters of the motion of a camera's part.

use laser_triangulation::parameter_group;

use crate::{
    ros::parameters::ParameterError,
    scanner::params::{MotionParams, MotionSource},
};

use super::CameraParams;

parameter_group! {
    /// Names in the messages of the motion.
    #[derive(Clone, Debug, PartialEq, Eq)]
    pub struct Moved {
        /// For joint_state: name of the joint. Empty: the only joint in the messages.
        joint: String = String::new() => ["motion.joint"],
        /// Frame of the point clouds and height maps. For tf: the frame of the scan, such as base_link, required.
        /// Otherwise its name; empty: part if the calibration has an axis or a level, else the laser plane's frame.
        part_frame: String = String::new() => ["motion.part_frame"],
        /// For tf: frame whose pose is looked up. Empty: the frame of the images, the camera's optical frame;
        /// alternatively the laser plane's frame, if it is published.
        sensor_frame: String = String::new() => ["motion.sensor_frame"],
    }
}

/// Checks for contradictions between several values.
pub(super) fn check(camera: &CameraParams) -> Result<(), ParameterError> {
    let MotionParams { source, step, velocity, .. } = camera.scanner.motion;
    let name = |name| camera.full_name(name);
    let conflict = |text: String| Err(ParameterError::Conflict(text));
    if source == MotionSource::Constant && step.is_none() && velocity.is_none() {
        return conflict(format!(
            "{} is constant, but {} and {} are both 0.0: set one of them",
            name("motion.source"),
            name("motion.step"),
            name("motion.velocity")
        ));
    }
    if let (Some(step), Some(velocity)) = (step, velocity) {
        return conflict(format!(
            "{} is {step} and {} is {velocity}: set only one of them",
            name("motion.step"),
            name("motion.velocity")
        ));
    }
    if source == MotionSource::Tf && camera.moved.part_frame.is_empty() {
        return conflict(format!(
            "{} is tf, but {} is empty: set it to the frame of the scan, such as base_link",
            name("motion.source"),
            name("motion.part_frame")
        ));
    }
    Ok(())
}
