//! What can be recorded: frames, an axis, a camera, and the truth about them.

use super::{scenario::Scenario, sensor::BitDepth, world::RenderedFrame};
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
