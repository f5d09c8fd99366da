//! A scenario file: the complete description of a simulated scan, imperfections included.

use serde::Deserialize;

use super::{
    camera::SimulatedCamera,
    clutter::Clutter,
    part::Part,
    scenario_error::{ScenarioError, check_entries, check_range, check_times, parsed},
};

/// An example: a film with a bubble, a pit and a fold on a cell, 40 frames of 160 x 96 pixels.
pub const EXAMPLE: &str = include_str!("example.scenario.yaml");

/// Largest number of frames in a scenario.
const MAX_FRAMES: u32 = 1_000_000;

/// A simulated scan.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Frames that the camera takes, dropped ones included.
    pub frames: u32,
    /// Frame rate, hertz.
    pub frame_rate_hz: f64,
    /// Stamp of frame 0, nanoseconds since the epoch.
    pub start_time_ns: i64,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Numbers of the frames that are taken but dropped.
    #[serde(default)]
    pub dropped_frames: Vec<u32>,
    /// Exposure times in turn, relative to the one for which all grey levels are stated: frame n uses entry n modulo
    /// the number of entries. Empty: 1.
    #[serde(default)]
    pub exposure_factors: Vec<f64>,
    /// Motion of the part through the laser plane.
    pub motion: Motion,
    /// The laser plane.
    pub laser: Laser,
    /// The camera that sees the stripe.
    pub camera: SimulatedCamera,
    /// The scanned part.
    pub part: Part,
    /// Light other than the stripe.
    #[serde(default)]
    pub clutter: Clutter,
}

/// A steady motion: the laser plane meets the part at y = `start_m + frame · step_m`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Position of frame 0, metres.
    pub start_m: f64,
    /// Motion per frame, metres.
    pub step_m: f64,
}

/// The stripe's light. Grey levels are those of the camera's bit depth.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Laser {
    /// Peak grey level on a surface of reflectance 1, for infinitely small pixels.
    pub(crate) amplitude: f64,
    /// Standard deviation across the stripe, pixels.
    pub(crate) sigma_px: f64,
    /// Standard deviation of the brightness along the stripe as a share of its mean.
    #[serde(default)]
    pub(crate) speckle_contrast: f64,
    /// Standard deviation of the Gaussian that smooths the speckle along the stripe, pixels; 0: white speckle.
    #[serde(default)]
    pub(crate) speckle_sigma_px: f64,
}

impl Scenario {
    /// Reads a scenario and checks every value.
    ///
    /// # Errors
    /// The text is not a scenario, or a value is out of range; both errors name the key.
    pub fn from_yaml(text: &str) -> Result<Self, ScenarioError> {
        let scenario: Self = parsed(text)?;
        scenario.check()?;
        Ok(scenario)
    }

    /// Returns the stamp of a frame, nanoseconds since the epoch: the middle of its exposure.
    pub fn stamp_ns(&self, frame: u32) -> i64 {
        self.start_time_ns + i64::from(frame) * (1e9 / self.frame_rate_hz).round() as i64
    }

    /// Returns the position at which the laser plane meets the part in a frame, metres along the motion.
    pub fn position_m(&self, frame: u32) -> f64 {
        self.motion.start_m + f64::from(frame) * self.motion.step_m
    }

    /// Returns the light of a frame as a share of the stated levels.
    pub(crate) fn exposure_factor(&self, frame: u32) -> f64 {
        let factors = &self.exposure_factors;
        if factors.is_empty() { 1.0 } else { factors[frame as usize % factors.len()] }
    }

    fn check(&self) -> Result<(), ScenarioError> {
        check_range("frames", f64::from(self.frames), 1.0, f64::from(MAX_FRAMES))?;
        check_times(self.frame_rate_hz, self.start_time_ns)?;
        self.motion.check()?;
        self.laser.check()?;
        for (index, &frame) in self.dropped_frames.iter().enumerate() {
            let last = f64::from(self.frames - 1);
            check_range(&format!("dropped_frames[{index}]"), f64::from(frame), 0.0, last)?;
        }
        check_entries("exposure_factors", &self.exposure_factors)?;
        for (index, &factor) in self.exposure_factors.iter().enumerate() {
            check_range(&format!("exposure_factors[{index}]"), factor, 0.0, 1000.0)?;
        }
        self.camera.check()?;
        self.part.check()?;
        self.camera.check_above(&self.part)?;
        self.clutter.check()
    }
}

impl Motion {
    pub(super) fn check(&self) -> Result<(), ScenarioError> {
        check_range("motion.start_m", self.start_m, -100.0, 100.0)?;
        check_range("motion.step_m", self.step_m, -1.0, 1.0)
    }
}

impl Laser {
    pub(super) fn check(&self) -> Result<(), ScenarioError> {
        check_range("laser.amplitude", self.amplitude, 0.0, 1e6)?;
        check_range("laser.sigma_px", self.sigma_px, 0.1, 100.0)?;
        check_range("laser.speckle_contrast", self.speckle_contrast, 0.0, 1.0)?;
        check_range("laser.speckle_sigma_px", self.speckle_sigma_px, 0.0, 100.0)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    fn refusal(from: &str, to: &str) -> String {
        assert!(EXAMPLE.contains(from), "{from}");
        Scenario::from_yaml(&EXAMPLE.replacen(from, to, 1)).unwrap_err().to_string()
    }

    #[test]
    fn stamps_and_positions_are_even() {
        let scenario = Scenario::from_yaml(EXAMPLE).unwrap();
        assert_eq!(scenario.stamp_ns(0), 1_767_225_600_000_000_000);
        assert_eq!(scenario.stamp_ns(22), 1_767_225_600_999_999_990, "22 periods of 45454545 ns");
        assert!((scenario.position_m(30) - 0.010).abs() < 1e-15);
    }

    #[test]
    fn an_invalid_value_is_rejected_with_key_value_and_range() {
        for (from, to, message) in [
            ("frames: 40", "frames: 0", "frames is 0: allowed is 1 to 1000000"),
            ("width_px: 160", "width_px: 9000", "camera.width_px is 9000: allowed is 8 to 8192"),
            ("sigma_px: 2.3", "sigma_px: .nan", "laser.sigma_px is NaN: allowed is 0.1 to 100"),
            ("[7, 8]", "[7, 40]", "dropped_frames[1] is 40: allowed is 0 to 39"),
            ("height_sign: -1", "height_sign: 2", "camera.height_sign is 2: allowed is -1 or 1"),
            (
                "height_m: 0.0004",
                "height_m: 0.1",
                "part.film.bubbles[0].height_m is 0.1: allowed is 0 to 0.001",
            ),
            (
                "margin_m: 0.001",
                "margin_m: 0.006",
                "part.film.margin_m is 0.006: allowed is 0 to 0.005",
            ),
        ] {
            assert_eq!(refusal(from, to), message);
        }
    }

    #[test]
    fn a_key_that_is_unknown_missing_or_of_the_wrong_type_is_named() {
        for (from, to, word) in [
            ("seed: 1", "sead: 1", "sead"),
            ("  height_px: 96\n", "", "height_px"),
            ("frames: 40", "frames: many", "frames: many"),
            ("height_px: 96", "height_px: 96\n  bit_depth: 10", "10"),
            ("height_px: 96", "height_px: 96\n  stripe_direction: diagonal", "diagonal"),
        ] {
            let message = refusal(from, to);
            assert!(message.contains(word), "{message}");
        }
    }
}
