//! The part's frame, laid on a flat.

use nalgebra::{Isometry3, Vector3};

/// Another frame of the part: `without = pose · with`, in which `without` is the frame that axis and laser plane give
/// ([`Placement`](crate::scanner::motion::placement::Placement)). Scans come out in the other one. Poses that were
/// measured (`motion.source: tf`) have a frame of their own, which stays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartPose {
    /// Its origin, metres.
    pub origin_m: [f64; 3],
    /// Its turn: along the axis of the turn, as long as the angle, radians.
    pub rotation_rad: [f64; 3],
}

impl PartPose {
    /// Of a pose.
    #[must_use]
    pub fn new(pose: &Isometry3<f64>) -> Self {
        Self {
            origin_m: pose.translation.vector.into(),
            rotation_rad: pose.rotation.scaled_axis().into(),
        }
    }

    /// The pose, metres.
    #[must_use]
    pub fn pose(&self) -> Isometry3<f64> {
        Isometry3::new(Vector3::from(self.origin_m), Vector3::from(self.rotation_rad))
    }
}
