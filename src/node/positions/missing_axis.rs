//! Scans without a calibrated axis: the direction and the unit of the motion are then assumptions.

use crate::scanner::{
    calibration::Calibration,
    params::{MotionParams, MotionSource},
};

/// Warns of positions that only an assumption turns into places: a camera and a plane in any pose, and no axis.
pub(in crate::node) fn warn(motion: &MotionParams, calibration: Option<&Calibration>) {
    let is_moved = match motion.source {
        MotionSource::Constant | MotionSource::JointState | MotionSource::Encoder => true,
        MotionSource::None | MotionSource::Tf => false,
    };
    let Some(Calibration::CameraAndPlane(geometry)) = calibration else { return };
    if is_moved && geometry.axis.is_none() {
        tracing::warn!(
            "the calibration has no axis: positions are taken as metres along the normal of the laser plane. If the part turns, or \
             moves in another direction, lengths and heights are wrong: find the axis with laser_profiler calibrate axis, and the \
             part's base with laser_profiler calibrate level"
        );
    }
}
