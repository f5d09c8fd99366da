//! The part's frame, laid on a plane that was scanned.

use nalgebra::Isometry3;

use crate::{
    metrology::plane::{self, PlaneFit},
    scanner::calibration::PartPose,
};

/// Returns the part's frame that lays `flat` level at height 0, with x and y where they were. `part` is the frame in which
/// the flat was measured; `None` if the calibration had none.
#[must_use]
pub fn level_part(flat: &PlaneFit, part: Option<PartPose>) -> PartPose {
    let measured_from_part = part.map_or(Isometry3::identity(), |part| part.pose());
    PartPose::new(&(measured_from_part * plane::leveling(flat).inverse()))
}
