//! One metric cross-section of the part: the heights along the stripe of a frame.

use super::stripe::flag;

/// The stripe of one frame cut by the laser plane, one entry for every searched column (or row, for a vertical stripe).
///
/// All arrays have the same length, the number of searched columns (rows); `calibration_sigma_z_m` may be empty. Frame: the
/// laser plane's, x along the stripe, z up, y = 0 normal to the plane.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Profile {
    /// Position along the stripe, metres; NaN where nothing was measured.
    pub x_m: Vec<f32>,
    /// Height, metres; NaN where nothing was measured.
    pub z_m: Vec<f32>,
    /// Grey level at the centreline as a share of full scale, 0 to 1; 0 where nothing was measured.
    pub intensity: Vec<f32>,
    /// Bits of [`flag`]; 0 where nothing was measured.
    pub flags: Vec<u8>,
    /// One standard deviation of `x_m` from that of the centre, metres; NaN where nothing was measured.
    pub sigma_x_m: Vec<f32>,
    /// One standard deviation of `z_m` from that of the centre, metres; NaN where nothing was measured.
    pub sigma_z_m: Vec<f32>,
    /// One standard deviation of `z_m` from the uncertainty of the calibration, metres; NaN where nothing was measured,
    /// infinite where a calibration that is off by a standard deviation measures nothing. Neighbouring points, and all
    /// profiles, are off in the same direction: it does not average out, and `sigma_z_m` does not contain it. Empty if the
    /// calibration states no uncertainty.
    pub calibration_sigma_z_m: Vec<f32>,
    /// Number of entries with finite `x_m` and `z_m`.
    pub valid_count: u32,
}

impl Profile {
    /// Returns the number of points outside the volume from which the calibration has data.
    #[must_use]
    pub fn num_outside_calibration(&self) -> u64 {
        self.flags.iter().filter(|flags| **flags & flag::OUTSIDE_CALIBRATION != 0).count() as u64
    }

    /// `length` entries, none of them measured, and no uncertainty of the calibration; keeps the memory.
    pub(crate) fn reset(&mut self, length: usize) {
        for values in [&mut self.x_m, &mut self.z_m, &mut self.sigma_x_m, &mut self.sigma_z_m] {
            values.clear();
            values.resize(length, f32::NAN);
        }
        self.calibration_sigma_z_m.clear();
        self.intensity.clear();
        self.intensity.resize(length, 0.0);
        self.flags.clear();
        self.flags.resize(length, 0);
        self.valid_count = 0;
    }
}
