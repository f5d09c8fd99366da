//! Converts the points of a centreline to the entries of a profile.

use super::PlacedPoint;
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

    /// Replaces `profile` by the points of a centreline for which `place` returns a point. `place` takes the positions
    /// along and across the stripe in pixels. Points outside these lines are left out.
    pub(super) fn fill(
        &self,
        centerline: &Centerline,
        full_scale: u32,
        profile: &mut Profile,
        mut place: impl FnMut(f64, f64) -> Option<PlacedPoint>,
    ) {
        profile.reset(self.count);
        let (along, across) = centerline.along_and_across(self.direction);
        for i in 0..centerline.len() {
            let Some(point) = place(f64::from(along[i]), f64::from(across[i])) else { continue };
            let (x_m, z_m) = (point.x_m as f32, point.z_m as f32);
            // Outside the range of 32-bit floats.
            if !(x_m.is_finite() && z_m.is_finite()) {
                continue;
            }
            let entry = (along[i] as usize).checked_sub(self.first);
            let Some(entry) = entry.filter(|entry| *entry < self.count) else { continue };
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
            profile.valid_count += 1;
        }
    }
}
