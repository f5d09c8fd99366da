//! The part's frame, defined by a flat.

use nalgebra::{Isometry3, Vector3};

/// Another frame of the part: `without = pose · with`, in which `without` is the frame that axis and laser plane define
/// ([`Placement`](crate::scanner::motion::placement::Placement)) and `with` is the frame of the scans. Measured poses
/// (`motion.source: tf`) keep their own frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartPose {
    /// Its origin, metres.
    pub origin_m: [f64; 3],
    /// Its rotation vector: direction of the axis of rotation, length equal to the angle, radians.
    pub rotation_rad: [f64; 3],
}

impl PartPose {
    /// Creates the part's frame from a pose.
    #[must_use]
    pub(crate) fn new(pose: &Isometry3<f64>) -> Self {
        Self {
            origin_m: pose.translation.vector.into(),
            rotation_rad: pose.rotation.scaled_axis().into(),
        }
    }

    /// Returns the pose, metres.
    #[must_use]
    pub(crate) fn pose(&self) -> Isometry3<f64> {
        Isometry3::new(Vector3::from(self.origin_m), Vector3::from(self.rotation_rad))
    }
}
