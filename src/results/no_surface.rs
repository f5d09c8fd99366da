//! The condition of every tool for areas: the profiles of the scan lie at different places.

use thiserror::Error;

use super::{Provenance, Results};
use crate::{
    metrology::{NoSurface, check_positions},
    scanner::{
        motion::standstill,
        params::{MotionParams, MotionSource},
    },
};

/// A scan that is no surface, and the remedy.
#[derive(Clone, Copy, Debug, Error)]
#[error("{reason}{}", remedy.map(|remedy| format!(": {remedy}; then replay again")).unwrap_or_default())]
pub(crate) struct ScanIsNoSurface {
    reason: NoSurface,
    /// The parameter that moves the profiles apart; `None` if the recording states no parameters.
    remedy: Option<&'static str>,
}

impl Results {
    /// Checks that the profiles lie at different places, according to the accounts of the slices. Logs a warning if some
    /// slices are degraded.
    ///
    /// # Errors
    /// There is one profile, or all lie at one place.
    pub(crate) fn check_surface(&self) -> Result<(), ScanIsNoSurface> {
        let num = self.accounts().count();
        let num_degraded = self.accounts().filter(|account| account.is_degraded).count();
        // A pose may turn about the origin, whose position stays.
        let may_stand = num_degraded == num || !self.provenance().is_posed();
        let profiles: u64 = self.accounts().map(|account| u64::from(account.profiles)).sum();
        let stands = match self.accounts().flat_map(|account| account.positions) {
            _ if profiles == 1 => Err(NoSurface::OneProfile),
            ends if may_stand => check_positions(ends),
            _ => Ok(()),
        };
        // The axis may return to its first position within a slice. Where the recording has no positions, the points decide.
        let all = |reason| match reason {
            NoSurface::OneProfile => Err(reason),
            NoSurface::OnePlace { .. } => self.positions().map_or(Ok(()), check_positions),
        };
        stands.or_else(all).map_err(|reason| self.no_surface(reason))?;
        if num_degraded > 0 {
            tracing::warn!(
                "{num_degraded} of {num} slices are DEGRADED: positions are in doubt, or the part stood still"
            );
        }
        Ok(())
    }

    /// Returns the error for a reason, with the remedy for the recorded parameters.
    pub(crate) fn no_surface(&self, reason: NoSurface) -> ScanIsNoSurface {
        let motion = match reason {
            NoSurface::OneProfile => None,
            NoSurface::OnePlace { .. } => motion(self.provenance()),
        };
        ScanIsNoSurface { reason, remedy: motion.as_ref().map(standstill::remedy) }
    }
}

/// Returns source and step of the recorded motion; `None` if no parameters are recorded.
fn motion(provenance: &Provenance) -> Option<MotionParams> {
    let parameters = provenance.parameters();
    let value = |name: &str| {
        parameters.iter().find(|(key, _)| key.ends_with(name)).map(|(_, value)| value.as_str())
    };
    let source = MotionSource::from_name(value("motion.source")?)?;
    let step = value("motion.step").and_then(|step| step.parse().ok()).filter(|step| *step != 0.0);
    Some(MotionParams { source, step, ..MotionParams::default() })
}
