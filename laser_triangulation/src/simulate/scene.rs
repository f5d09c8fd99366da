//! The interface of anything that can be recorded: frames, an axis, a camera, and the ground truth.

use super::{scenario::Scenario, sensor::BitDepth, world::RenderedFrame};
use crate::scanner::{camera::Camera, params::StripeDirection};

/// Image format of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Width, pixels.
    pub width_px: u32,
    /// Height, pixels.
    pub height_px: u32,
    /// Bits per sample.
    pub bit_depth: BitDepth,
    /// Direction of the stripe.
    pub stripe_direction: StripeDirection,
}

/// A simulated recording. A frame is a function of the scene and its number.
pub trait Scene {
    /// Frames that the camera takes, dropped ones included.
    fn frames(&self) -> u32;
    /// Returns true if a frame is taken but dropped.
    fn is_dropped(&self, frame: u32) -> bool;
    /// Returns the stamp of a frame, nanoseconds since the epoch: the middle of its exposure.
    fn stamp_ns(&self, frame: u32) -> i64;
    /// Returns the position of the axis in a frame, metres.
    fn position_m(&self, frame: u32) -> f64;
    /// Returns the velocity of the axis, metres per second.
    fn velocity_m_s(&self) -> f64;
    /// Returns the image format.
    fn picture(&self) -> Picture;
    /// Returns the camera; `None` for the camera of formula 6.
    fn camera(&self) -> Option<Camera>;
    /// Returns the matching calibration file.
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
