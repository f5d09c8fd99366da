//! Levels the part's frame on a scanned flat.

use nalgebra::Isometry3;

use crate::{
    metrology::plane::{self, PlaneFit},
    scanner::calibration::PartPose,
};

/// Returns the part's frame in which `flat` is level at height 0, with x and y unchanged. `part` is the frame in which
/// the flat was measured; `None` if the calibration had none.
#[must_use]
pub fn level_part(flat: &PlaneFit, part: Option<PartPose>) -> PartPose {
    let measured_from_part = part.map_or(Isometry3::identity(), |part| part.pose());
    PartPose::new(&(measured_from_part * plane::leveling(flat).inverse()))
}
