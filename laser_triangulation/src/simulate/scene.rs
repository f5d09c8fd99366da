//! What can be recorded: frames, an axis, a camera, and the truth about them.

use serde::{Deserialize, de::IgnoredAny};

use super::{
    rig::RigScenario,
    scenario::{Scenario, ScenarioError},
    sensor::BitDepth,
    world::RenderedFrame,
};
use crate::scanner::{camera::Camera, params::StripeDirection};

/// The form of all pictures of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Bits of a sample.
    pub bit_depth: BitDepth,
    /// Which way the stripe runs.
    pub stripe_direction: StripeDirection,
}

/// A simulated recording. A frame is a function of the scene and its number.
pub trait Scene {
    /// Frames that the camera takes, dropped ones included.
    fn frames(&self) -> u32;
    /// Whether a frame is taken but never arrives.
    fn is_dropped(&self, frame: u32) -> bool;
    /// Stamp of a frame, nanoseconds since the epoch: the middle of its exposure.
    fn stamp_ns(&self, frame: u32) -> i64;
    /// Position of the axis in a frame, metres.
    fn position_m(&self, frame: u32) -> f64;
    /// Velocity of the axis, metres a second.
    fn velocity_m_s(&self) -> f64;
    /// The form of its pictures.
    fn picture(&self) -> Picture;
    /// The camera, where it is more than formula 6.
    fn camera(&self) -> Option<Camera>;
    /// The calibration file that fits.
    fn calibration_yaml(&self) -> String;
    /// Renders a frame.
    fn render(&self, frame: u32, out: &mut RenderedFrame);
}

/// Reads a scenario of either kind: a part under the camera of formula 6, or, where it has a `rig`, gauges and boards
/// before any camera.
///
/// # Errors
/// A text that is not a scenario, or a value outside of its range; both name the key.
pub fn from_yaml(text: &str) -> Result<Box<dyn Scene>, ScenarioError> {
    #[derive(Deserialize)]
    struct Head {
        rig: Option<IgnoredAny>,
    }
    let head: Head =
        serde_saphyr::from_str(text).map_err(|error| ScenarioError::Yaml(Box::new(error)))?;
    Ok(match head.rig {
        Some(_) => Box::new(RigScenario::from_yaml(text)?),
        None => Box::new(Scenario::from_yaml(text)?),
    })
}

impl Scene for Scenario {
    fn frames(&self) -> u32 {
        self.frames
    }

    fn is_dropped(&self, frame: u32) -> bool {
        self.dropped_frames.contains(&frame)
    }

    fn stamp_ns(&self, frame: u32) -> i64 {
        self.stamp_ns(frame)
    }

    fn position_m(&self, frame: u32) -> f64 {
        self.position_m(frame)
    }

    fn velocity_m_s(&self) -> f64 {
        self.motion.step_m * self.frame_rate_hz
    }

    fn picture(&self) -> Picture {
        let camera = &self.camera;
        Picture {
            width_px: camera.width_px,
            height_px: camera.height_px,
            bit_depth: camera.bit_depth,
            stripe_direction: camera.stripe_direction,
        }
    }

    fn camera(&self) -> Option<Camera> {
        None
    }

    fn calibration_yaml(&self) -> String {
        self.camera.calibration_yaml()
    }

    fn render(&self, frame: u32, out: &mut RenderedFrame) {
        self.render(frame, out);
    }
}
