//! Converts the points of a centreline to the entries of a profile.

use super::{PlacedPoint, height_sigma::HeightSigma};
use crate::scanner::{
    channel::SearchedRegion, params::StripeDirection, profile::Profile, stripe::Centerline,
};

/// The searched cross-sections: columns of the image for a horizontal stripe, rows for a vertical one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lines {
    /// Direction of the stripe.
    pub direction: StripeDirection,
    /// First searched column (row) of the image.
    pub first: usize,
    /// Searched columns (rows).
    pub count: usize,
}

impl Lines {
    /// Returns the lines of a searched part of the image.
    pub const fn new(direction: StripeDirection, searched: &SearchedRegion) -> Self {
        let (first, count) = match direction {
            StripeDirection::Horizontal => (searched.x, searched.width),
            StripeDirection::Vertical => (searched.y, searched.height),
        };
        Self { direction, first, count }
    }
}

/// A centreline on its way to a profile.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub(super) centerline: &'a Centerline,
    pub(super) lines: Lines,
    /// Level of a saturated sample.
    pub(super) full_scale: u32,
    /// The calibration's uncertainty; `None` if it is not to be stated.
    pub(super) sigma: Option<&'a HeightSigma>,
}

impl Source<'_> {
    /// Replaces `profile` by the points of the centreline for which `place` returns a point. `place` takes the positions
    /// along and across the stripe in pixels. Points outside the searched lines are left out.
    pub(super) fn fill(
        &self,
        profile: &mut Profile,
        mut place: impl FnMut(f64, f64) -> Option<PlacedPoint>,
    ) {
        let Self { centerline, lines, full_scale, sigma } = *self;
        profile.reset(lines.count);
        if sigma.is_some() {
            profile.calibration_sigma_z_m.resize(lines.count, f32::NAN);
        }
        let (along, across) = centerline.along_and_across(lines.direction);
        for i in 0..centerline.len() {
            let Some(point) = place(f64::from(along[i]), f64::from(across[i])) else { continue };
            let (x_m, z_m) = (point.x_m as f32, point.z_m as f32);
            // Outside the range of 32-bit floats.
            if !(x_m.is_finite() && z_m.is_finite()) {
                continue;
            }
            let entry = (along[i] as usize).checked_sub(lines.first);
            let Some(entry) = entry.filter(|entry| *entry < lines.count) else { continue };
            // One point per line: that of the first surface, which is the strongest.
            if profile.z_m[entry].is_finite() {
                continue;
            }
            let sigma_px = f64::from(centerline.sigma_px[i]);
            profile.x_m[entry] = x_m;
            profile.z_m[entry] = z_m;
            profile.intensity[entry] = (centerline.intensity[i] / full_scale as f32).min(1.0);
            profile.flags[entry] = centerline.flags[i] | point.flags;
            profile.sigma_x_m[entry] = (point.x_m_per_px.abs() * sigma_px) as f32;
            profile.sigma_z_m[entry] = (point.z_m_per_px.abs() * sigma_px) as f32;
            if let Some(value) = profile.calibration_sigma_z_m.get_mut(entry) {
                *value = across[i];
            }
            profile.valid_count += 1;
        }
        if let Some(sigma) = sigma {
            sigma.replace(&lines, &mut profile.calibration_sigma_z_m);
        }
    }
}
