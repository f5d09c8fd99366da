//! The motion of pictures: positions that are stated beside them, and stamps that nothing states.

use crate::{
    bag::BagReader,
    msg::{schema::Message, sensor_msgs::JointState},
    ros::{
        camera_params::CameraParams,
        parameters::{ParameterError, Parameters},
        value::Value,
    },
    scanner::params::MotionSource,
};

/// Makes stated positions of pictures the source of the motion, unless the parameters name another source.
///
/// # Errors
/// None for declared parameters.
pub(super) fn apply(
    bags: &[BagReader],
    cameras: &[CameraParams],
    values: &mut Parameters,
) -> Result<(), ParameterError> {
    let states_positions = |bag: &BagReader| {
        bag.is_of_pictures()
            && bag.topics().iter().any(|topic| topic.type_name == JointState::TYPE.name)
    };
    if !bags.iter().any(states_positions) {
        return Ok(());
    }
    for camera in cameras {
        let name = camera.full_name("motion.source");
        if !values.is_set(&name) {
            let source = Value::Text(MotionSource::JointState.name().to_owned());
            values.set(&name, source, "--positions")?;
        }
    }
    Ok(())
}

/// True if the motion of this camera's part follows from the stamps of its images.
pub(super) const fn needs_stamps(camera: &CameraParams) -> bool {
    let motion = &camera.scanner.motion;
    matches!(motion.source, MotionSource::Constant) && motion.velocity.is_some()
}
