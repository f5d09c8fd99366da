//! Parameters of the motion of the part and of its source.

use crate::{named_enum, parameter_group};

named_enum! {
    /// Source of a profile's position along the scan.
    MotionSource {
        /// None: every profile lies at 0.
        None = "none",
        /// A known step per frame, or a known velocity and the time stamps.
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
    /// Type of the motion axis.
    AxisChoice {
        /// As calibrated; prismatic if the calibration has no axis.
        Auto = "auto",
        /// Translation: positions in metres.
        Prismatic = "prismatic",
        /// Rotation: positions in radians.
        Revolute = "revolute",
    }
}

named_enum! {
    /// Expected direction of positions in a scan.
    ScanDirection {
        /// The first direction of each scan.
        Auto = "auto",
        /// Increasing.
        Forward = "forward",
        /// Decreasing.
        Backward = "backward",
        /// Either: no check.
        Both = "both",
    }
}

parameter_group! {
    /// Parameters of the motion.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct MotionParams {
        /// Source of a profile's position along the scan. none: all at 0; constant: motion.step or motion.velocity;
        /// joint_state, encoder: samples on joint_states or encoder; tf: pose of motion.sensor_frame in
        /// motion.part_frame. Measured positions are looked up at mid-exposure; a frame without a position is
        /// published, but not added to the scan.
        source: MotionSource = MotionSource::None => ["motion.source"],
        /// Movement between consecutive frames, lost frames included; for triggered cameras. Metres on a prismatic
        /// axis, radians on a revolute axis, before the scale of the calibrated axis. Negative: against the scan axis.
        step: Option<f64> = None => ["motion.step", -1.0..=1.0, "m or rad per frame"],
        /// Speed of the part, multiplied by the difference of time stamps; for free-running cameras with accurate
        /// stamps. Metres on a prismatic axis, radians on a revolute axis, before the scale of the calibrated axis.
        /// Negative: against the scan axis.
        velocity: Option<f64> = None => ["motion.velocity", -100.0..=100.0, "m/s or rad/s"],
        /// Type of the axis. auto: as calibrated, otherwise prismatic; prismatic: positions in metres; revolute:
        /// positions in radians, continuous over several turns. Contradicting the calibration is an error.
        axis: AxisChoice = AxisChoice::Auto => ["motion.axis"],
        /// Travel per unit of a joint or count of an encoder; negative reverses the axis. 0: the scale in the messages,
        /// 1 for joints. The calibrated scale of the axis applies in addition.
        scale: Option<f64> = None => ["motion.scale", -1e6..=1e6, "m or rad per unit"],
        /// Width of an encoder counter that wraps to 0; the axis must move less than half its range between two
        /// samples. 0: counts arrive unwrapped, as EncoderStamped specifies.
        encoder_bits: Option<u32> = None => ["motion.encoder_bits", 0..=63, "bits"],
        /// Expected direction of positions in a scan; movement against it is flagged REVERSED. auto: the first
        /// direction of each scan; forward: increasing; backward: decreasing; both: no check.
        direction: ScanDirection = ScanDirection::Auto => ["motion.direction"],
        /// Backlash tolerance: movement against the scan direction below this value is ignored. Typically a few encoder
        /// counts.
        backlash: f64 = 1e-5 => ["motion.backlash", 0.0..=1.0, "m or rad"],
        /// Largest plausible movement between two samples; frames between samples further apart are flagged GAP, as
        /// after a counter reset or a slipping axis. 0: no limit.
        max_step: Option<f64> = None => ["motion.max_step", 0.0..=1e6, "m or rad"],
        /// Longest time between two samples: frames in longer gaps are flagged STALE, and positions are extrapolated
        /// (EXTRAPOLATED) for at most this time. 0: four times the median interval.
        max_gap_s: Option<f64> = None => ["motion.max_gap", 0.0..=3600.0, "s"],
        /// Largest number of frames that wait for the next position sample, at most 256 MiB of them and for max_gap or
        /// 1 s, whichever is longer. Raise it if positions arrive much later than images.
        max_wait_frames: u32 = 32 => ["motion.max_wait", 0..=1000, "frames"],
        /// Time from the stamp of a frame to the middle of its exposure. Typically half the exposure time, if the
        /// camera stamps its start.
        exposure_offset_s: f64 = 0.0 => ["motion.exposure_offset", -10.0..=10.0, "s"],
    }
}

impl MotionSource {
    /// Returns true if positions are received as messages.
    pub const fn is_measured(self) -> bool {
        matches!(self, Self::JointState | Self::Encoder | Self::Tf)
    }
}
