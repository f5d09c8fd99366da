//! Points of a measurement outside the volume from which the calibration has data.

use super::{Results, Scanned, calibration_share::positions};
use crate::{metrology::calibration_error::num_outside, scanner::calibration::Calibration};

/// Returns the number of points of all `scanned` outside the calibrated volume; `None` if the calibration in the
/// recording does not state it, or if the points cannot be traced back to the image.
pub(crate) fn num_outside_calibration(results: &Results, scanned: &[&Scanned]) -> Option<u64> {
    let provenance = results.provenance();
    let calibration = Calibration::from_yaml(provenance.calibration.as_ref()?).ok()?;
    // Poses may have moved the points; their way back is not recorded.
    if provenance.is_posed() || calibration.volumes().next().is_none() {
        return None;
    }
    let direction = results.stripe_direction().ok()?;
    let positions = positions(results, &calibration, scanned).ok()?;
    let both = scanned.iter().zip(&positions);
    both.map(|(scanned, at)| num_outside(&calibration, direction, &scanned.surface, at)).sum()
}
