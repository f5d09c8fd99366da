//! A calibration that also states how uncertain it makes the heights.

use super::{Calibration, Lines, height_sigma::HeightSigma, lines::Source};
use crate::scanner::{params::StripeDirection, profile::Profile, stripe::Centerline};

/// Triangulates as its calibration does, and states for each point the calibration's share in the uncertainty of its height:
/// [`Profile::calibration_sigma_z_m`].
#[derive(Clone, Debug)]
pub struct Triangulator {
    calibration: Calibration,
    sigma: Option<HeightSigma>,
}

impl Triangulator {
    /// Takes a calibration. Nothing is stated if its file has no uncertainty.
    #[must_use]
    pub fn new(calibration: Calibration) -> Self {
        let sigma = HeightSigma::new(&calibration);
        Self { calibration, sigma }
    }

    /// The calibration.
    #[must_use]
    pub const fn calibration(&self) -> &Calibration {
        &self.calibration
    }

    /// Makes the table of uncertainties for images of that many columns and rows, unless it exists. This takes some
    /// milliseconds. Without it [`triangulate`](Self::triangulate) repeats each point with every calibration that is off
    /// by a standard deviation, which takes some ten times as long as the point itself.
    pub fn prepare(&mut self, direction: StripeDirection, image_px: (u32, u32)) {
        if let Some(sigma) = &mut self.sigma {
            sigma.prepare(direction, image_px);
        }
    }

    /// Step 9, as [`Calibration::triangulate`], with the calibration's uncertainty.
    pub fn triangulate(
        &self,
        centerline: &Centerline,
        lines: &Lines,
        full_scale: u32,
        profile: &mut Profile,
    ) {
        let sigma = self.sigma.as_ref();
        self.calibration.fill(&Source { centerline, lines: *lines, full_scale, sigma }, profile);
    }
}
