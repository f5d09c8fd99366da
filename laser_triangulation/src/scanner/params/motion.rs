//! Chosen values: how the part moves, and how that is known.

use crate::named_enum;

named_enum! {
    /// Where the position of a profile along the scan comes from.
    MotionSource {
        /// Nowhere: every profile lies at 0.
        None = "none",
        /// A known step a frame, or a known velocity and the stamps.
        Constant = "constant",
        /// A joint of `sensor_msgs/JointState`.
        JointState = "joint_state",
        /// An encoder, `laser_profiler_msgs/EncoderStamped`.
        Encoder = "encoder",
        /// Poses of coordinate frames, `tf2_msgs/TFMessage`.
        Tf = "tf",
    }
}

named_enum! {
    /// What the axis of the motion does.
    AxisChoice {
        /// What the calibration says; shift, where it says nothing.
        Auto = "auto",
        /// It shifts the part: positions are metres.
        Prismatic = "prismatic",
        /// It turns the part: positions are radians.
        Revolute = "revolute",
    }
}

named_enum! {
    /// Which way positions go in a scan.
    ScanDirection {
        /// The way that they go first.
        Auto = "auto",
        /// Up.
        Forward = "forward",
        /// Down.
        Backward = "backward",
        /// To and fro.
        Both = "both",
    }
}

/// How the part moves, and how that is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionParams {
    /// Where positions come from.
    pub source: MotionSource,
    /// Metres a frame, lost frames included; used when not 0.
    pub step_m: f64,
    /// Metres a second, times the difference of stamps; used when `step_m` is 0.
    pub velocity_m_s: f64,
    /// What the axis does.
    pub axis: AxisChoice,
    /// Metres (radians) a unit of what is measured; 0: as the messages say.
    pub scale: f64,
    /// Bits after which the encoder's counter wraps; 0: it does not.
    pub encoder_bits: u32,
    /// Which way positions should go.
    pub direction: ScanDirection,
    /// How far the axis may move back and yet stand still, metres (radians).
    pub backlash: f64,
    /// Farthest between two samples that is no gap, metres (radians); 0: any distance.
    pub max_step: f64,
    /// Longest time between two samples that is no gap, seconds; 0: four times the usual one.
    pub max_gap_s: f64,
    /// Frames that wait for a sample behind them, at most.
    pub max_wait_frames: u32,
    /// From the stamp of a frame to the middle of its exposure, seconds.
    pub exposure_offset_s: f64,
}

impl Default for MotionParams {
    /// No motion.
    fn default() -> Self {
        Self {
            source: MotionSource::None,
            step_m: 0.0,
            velocity_m_s: 0.0,
            axis: AxisChoice::Auto,
            scale: 0.0,
            encoder_bits: 0,
            direction: ScanDirection::Auto,
            backlash: 1e-5,
            max_step: 0.0,
            max_gap_s: 0.0,
            max_wait_frames: 32,
            exposure_offset_s: 0.0,
        }
    }
}

impl MotionSource {
    /// Whether positions come in messages of their own.
    pub const fn is_measured(self) -> bool {
        matches!(self, Self::JointState | Self::Encoder | Self::Tf)
    }
}
