//! Pixel locking: the error as a function of the stripe's position between two pixels.

use serde::Serialize;

use super::{
    scene::{Course, Scene},
    trial::{self, Plan},
};
use crate::simulate::stripe::StripeScene;

/// Standard deviations of the tested stripes, pixels.
pub const SIGMAS_PX: [f64; 2] = [0.95, 2.3];
/// Number of phases within a pixel.
const NUM_PHASES: u32 = 40;
/// Row of phase 0.
const ROW_PX: f64 = 24.0;

/// Locking of all methods, for one stripe.
#[derive(Clone, Debug, Serialize)]
pub struct Locking {
    /// Standard deviation of the stripe, pixels.
    pub sigma_px: f64,
    /// Amplitude of the stripe, grey levels.
    pub amplitude: f64,
    /// Read noise, grey levels; each error is a mean over many columns.
    pub read_noise: f64,
    /// Phases, pixels from a pixel's centre.
    pub phases_px: Vec<f64>,
    /// The methods, in the plan's order.
    pub methods: Vec<LockingCurve>,
}

/// Locking of one method.
#[derive(Clone, Debug, Serialize)]
pub struct LockingCurve {
    /// Name of the method.
    pub method: &'static str,
    /// Half the difference between the largest and the smallest mean error, pixels.
    pub half_amplitude_px: f64,
    /// Mean error at each phase, pixels; null where no point was found.
    pub mean_error_px: Vec<f64>,
}

/// Measures one stripe of standard deviation `sigma_px` at every phase.
pub fn run(plan: &Plan, sigma_px: f64) -> Locking {
    let phases_px: Vec<f64> =
        (0..NUM_PHASES).map(|step| f64::from(step) / f64::from(NUM_PHASES)).collect();
    let stripe = StripeScene {
        width: 1024,
        height: 64,
        sigma_px,
        read_noise: 2.0,
        ..StripeScene::default()
    };
    let mut curves = vec![Vec::new(); plan.methods.len()];
    for (&phase, number) in phases_px.iter().zip(0..) {
        // Independent noise at each phase.
        let stripe = StripeScene { seed: plan.seed.wrapping_add(number), ..stripe };
        let course = Course::Level { center_px: ROW_PX + phase };
        let scene = Scene { stripe, course, speckle: None };
        trial::centerlines(plan, &scene, 1, |_, method, points| {
            let found =
                points.iter().flatten().map(|(position_px, _)| position_px - ROW_PX - phase);
            let (sum, count) = found.fold((0.0, 0.0), |(sum, count), e| (sum + e, count + 1.0));
            curves[method].push(sum / count);
        });
    }
    let methods = plan.methods.iter().zip(curves).map(|(method, mean_error_px)| LockingCurve {
        method: method.name(),
        half_amplitude_px: half_amplitude(&mean_error_px),
        mean_error_px,
    });
    let StripeScene { amplitude, read_noise, .. } = stripe;
    Locking { sigma_px, amplitude, read_noise, phases_px, methods: methods.collect() }
}

/// Returns half the range of the entries; NaN if one is missing.
fn half_amplitude(errors: &[f64]) -> f64 {
    if errors.iter().any(|error| error.is_nan()) {
        return f64::NAN;
    }
    let ends = |(low, high): (f64, f64), &error: &f64| (low.min(error), high.max(error));
    let (low, high) = errors.iter().fold((f64::INFINITY, f64::NEG_INFINITY), ends);
    0.5 * (high - low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        evaluate::trial::tests::plan,
        scanner::params::{ExtractionParams, GravityWindow, Method},
    };

    #[test]
    fn half_amplitudes_by_hand() {
        assert!((half_amplitude(&[0.1, -0.3, 0.2]) - 0.25).abs() < 1e-12);
        assert!(half_amplitude(&[0.1, f64::NAN]).is_nan());
    }

    #[test]
    fn the_locking_curve_shows_that_the_rounded_window_locks() {
        let fractional = plan(&[Method::ImprovedGravity], 1);
        let rounded = Plan {
            params: ExtractionParams { window: GravityWindow::Rounded, ..fractional.params },
            ..fractional.clone()
        };
        let [fractional, rounded] = [fractional, rounded].map(|plan| run(&plan, 2.3));
        assert_eq!(fractional.phases_px.len(), fractional.methods[0].mean_error_px.len());
        let (small, large) =
            (fractional.methods[0].half_amplitude_px, rounded.methods[0].half_amplitude_px);
        assert!(small < 0.012 && large > 0.05, "{small} {large}");
    }
}
