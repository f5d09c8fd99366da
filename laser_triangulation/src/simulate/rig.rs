//! Gauges and boards in front of any camera and laser plane: ground truth for calibrations and measurements.
//!
//! The projection is written independently of the instrument's own camera model, so the ground truth does not depend on
//! the code under test.

mod boards;
mod gauge;
mod geometry;
mod lens;

use nalgebra::{Point3, Unit, Vector3};
use serde::Deserialize;

use super::{
    noise::{frame_rng, speckle},
    scenario::{Laser, Motion},
    scenario_error::{ScenarioError, check_range, check_times, parsed, range_error},
    scene::{Picture, Scene},
    sensor::{BitDepth, Sensor},
    world::RenderedFrame,
};
use crate::scanner::{
    axis::{Axis, AxisKind},
    calibration::{Calibration, CameraAndPlane},
    camera::{Camera, Distortion},
    laser_plane::LaserPlane,
    params::StripeDirection,
};

pub(crate) use boards::Boards;
pub(crate) use gauge::Gauge;
pub use lens::Lens;

/// A recording of a gauge that moves through the laser plane, or of boards held in front of the camera.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigScenario {
    /// Frames that the camera takes.
    pub frames: u32,
    /// Frame rate, hertz.
    pub frame_rate_hz: f64,
    /// Stamp of frame 0, nanoseconds since the epoch.
    pub start_time_ns: i64,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Motion of the gauge through the laser plane.
    #[serde(default = "still")]
    pub motion: Motion,
    /// Camera and plane.
    pub rig: Rig,
    /// The stripe's light.
    pub laser: Laser,
    /// The scanned gauge; alternative to `boards`.
    pub gauge: Option<Gauge>,
    /// Checkerboards, one view per frame; alternative to `gauge`.
    pub boards: Option<Boards>,
}

/// A camera and a laser plane.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rig {
    /// Width, pixels.
    pub width_px: u32,
    /// Height, pixels.
    pub height_px: u32,
    /// Bits per sample: 8, 12 or 16.
    #[serde(default)]
    pub(crate) bit_depth: BitDepth,
    /// Standard deviation of the read noise, grey levels.
    #[serde(default)]
    pub(crate) read_noise: f64,
    /// Variance of the shot noise per grey level, grey levels.
    #[serde(default)]
    pub(crate) shot_gain: f64,
    /// Lens and sensor.
    pub lens: Lens,
    /// Normal of the laser plane in the camera's frame; of any length.
    pub(crate) laser_normal: [f64; 3],
    /// Distance from the lens to the laser plane, metres.
    pub(crate) laser_distance_m: f64,
    /// `vertical` if the stripe runs from top to bottom.
    #[serde(default)]
    pub(crate) is_vertical: bool,
}

const fn still() -> Motion {
    Motion { start_m: 0.0, step_m: 0.0 }
}

impl Rig {
    /// Returns the direction of the stripe.
    pub(crate) const fn stripe_direction(&self) -> StripeDirection {
        if self.is_vertical { StripeDirection::Vertical } else { StripeDirection::Horizontal }
    }

    const fn sensor(&self) -> Sensor {
        Sensor { bit_depth: self.bit_depth, read_noise: self.read_noise, shot_gain: self.shot_gain }
    }

    /// Returns the number of pixels along the stripe.
    const fn length_px(&self) -> u32 {
        if self.is_vertical { self.height_px } else { self.width_px }
    }

    /// Returns the result of a perfect calibration, with the axis that moves the gauge.
    pub(crate) fn calibration(&self) -> CameraAndPlane {
        let Lens { focal_px, center_px, tilt_rad, .. } = self.lens;
        let geometry = geometry::World::new(self);
        CameraAndPlane {
            frame_id: "laser_plane".to_owned(),
            camera_name: "simulated".to_owned(),
            camera: Camera {
                width_px: self.width_px,
                height_px: self.height_px,
                fx_px: focal_px[0],
                fy_px: focal_px[1],
                cx_px: center_px[0],
                cy_px: center_px[1],
                distortion: self.distortion(),
                tilt_rad,
            },
            camera_quality: None,
            plane: LaserPlane {
                normal: Unit::new_normalize(self.laser_normal.into()),
                distance_m: self.laser_distance_m,
            },
            plane_quality: None,
            alignment: None,
            part: None,
            axis: Some(Axis {
                kind: AxisKind::Prismatic,
                point_m: Point3::origin(),
                direction: Unit::new_normalize(geometry.camera_from_world(-Vector3::y())),
                scale: 1.0,
            }),
            axis_quality: None,
            calibrated_at: None,
        }
    }

    fn distortion(&self) -> Distortion {
        if let Some([k1, k2, k3, k4]) = self.lens.equidistant {
            return Distortion::Equidistant { k1, k2, k3, k4 };
        }
        let [k1, k2, p1, p2, k3, k4, k5, k6] = self.lens.distortion;
        let is_zero = |coefficients: &[f64]| coefficients.iter().all(|value| *value == 0.0);
        if is_zero(&self.lens.distortion) {
            Distortion::None
        } else if is_zero(&[k4, k5, k6]) {
            Distortion::PlumbBob { k1, k2, p1, p2, k3 }
        } else {
            Distortion::RationalPolynomial { k1, k2, p1, p2, k3, k4, k5, k6 }
        }
    }

    fn check(&self) -> Result<(), ScenarioError> {
        for (key, value, min, max) in [
            ("width_px", f64::from(self.width_px), 8.0, 8192.0),
            ("height_px", f64::from(self.height_px), 8.0, 8192.0),
            ("read_noise", self.read_noise, 0.0, 65_535.0),
            ("shot_gain", self.shot_gain, 0.0, 1000.0),
            ("laser_distance_m", self.laser_distance_m, 1e-3, 100.0),
        ] {
            check_range(&format!("rig.{key}"), value, min, max)?;
        }
        let normal = Vector3::from(self.laser_normal);
        let slope = normal.z / normal.norm();
        if slope.is_nan() || slope < 0.05 {
            let allowed = "a direction away from the lens that the optical axis has too".to_owned();
            return Err(range_error(
                "rig.laser_normal",
                format!("{:?}", self.laser_normal),
                allowed,
            ));
        }
        self.lens.check()
    }
}

impl RigScenario {
    /// Reads a scenario and checks every value.
    ///
    /// # Errors
    /// The text is not a scenario, or a value is out of range; both errors name the key.
    pub fn from_yaml(text: &str) -> Result<Self, ScenarioError> {
        let scenario: Self = parsed(text)?;
        scenario.check()?;
        Ok(scenario)
    }

    fn check(&self) -> Result<(), ScenarioError> {
        check_range("frames", f64::from(self.frames), 1.0, 100_000.0)?;
        check_times(self.frame_rate_hz, self.start_time_ns)?;
        self.motion.check()?;
        self.laser.check()?;
        self.rig.check()?;
        match (&self.gauge, &self.boards) {
            (Some(gauge), None) => gauge.check(),
            (None, Some(boards)) => boards.check(),
            _ => {
                let value = "both or neither of gauge and boards";
                Err(range_error("the scene", value, "one of them".to_owned()))
            }
        }
    }
}

impl Scene for RigScenario {
    fn frames(&self) -> u32 {
        self.frames
    }

    fn is_dropped(&self, _frame: u32) -> bool {
        false
    }

    fn stamp_ns(&self, frame: u32) -> i64 {
        self.start_time_ns + i64::from(frame) * (1e9 / self.frame_rate_hz).round() as i64
    }

    fn position_m(&self, frame: u32) -> f64 {
        self.motion.start_m + f64::from(frame) * self.motion.step_m
    }

    fn velocity_m_s(&self) -> f64 {
        self.motion.step_m * self.frame_rate_hz
    }

    fn picture(&self) -> Picture {
        Picture {
            width_px: self.rig.width_px,
            height_px: self.rig.height_px,
            bit_depth: self.rig.bit_depth,
            stripe_direction: self.rig.stripe_direction(),
        }
    }

    fn camera(&self) -> Option<Camera> {
        Some(self.rig.calibration().camera)
    }

    fn calibration_yaml(&self) -> String {
        Calibration::CameraAndPlane(Box::new(self.rig.calibration())).to_yaml()
    }

    fn render(&self, frame: u32, out: &mut RenderedFrame) {
        let mut rng = frame_rng(self.seed, u64::from(frame));
        let laser = &self.laser;
        let length_px = self.rig.length_px();
        let shares = speckle(&mut rng, length_px, laser.speckle_contrast, laser.speckle_sigma_px);
        out.exposure.reset(self.rig.width_px, self.rig.height_px, 0.0);
        out.truth.clear();
        if let Some(gauge) = &self.gauge {
            let world = geometry::World::new(&self.rig);
            let position_m = self.position_m(frame);
            out.truth.extend((0..).zip(&shares).map(|(line, share)| {
                let mut section = gauge.cross_section(&self.rig, &world, position_m, line);
                section.sigma_px = laser.sigma_px;
                section.amplitude *= share * laser.amplitude;
                section
            }));
            let truth = &out.truth;
            out.exposure.add_stripe(self.rig.stripe_direction(), |line| truth[line as usize]);
        }
        if let Some(boards) = &self.boards {
            let view = boards.view(&self.rig, self.seed, frame);
            boards.expose(&self.rig, laser, &view, &mut out.exposure);
        }
        self.rig.sensor().read_out(&out.exposure, &mut rng, &mut out.samples);
    }
}

#[cfg(test)]
mod tests;
