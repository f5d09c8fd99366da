//! Chosen values: how the part moves, and how that is known.

use crate::{named_enum, parameter_group};

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

parameter_group! {
    /// How the part moves, and how that is known.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct MotionParams {
        /// Where a profile's position along the scan comes from. none: every profile at 0. constant: motion.step or
        /// motion.velocity. joint_state: a joint on joint_states. encoder: EncoderStamped on encoder. tf: the pose of
        /// motion.sensor_frame in motion.part_frame, on /tf and /tf_static. The last three are looked up at the
        /// middle of the exposure; a frame whose position nobody knows is published, but left out of the scan.
        source: MotionSource = MotionSource::None => ["motion.source"],
        /// Distance between two frames, lost ones included; for triggered cameras. Negative moves against the scan
        /// axis.
        step_m: Option<f64> = None => ["motion.step", -1.0..=1.0, "m/frame"],
        /// Speed of the part; times the difference of stamps. For free-running cameras with good stamps.
        velocity_m_s: Option<f64> = None => ["motion.velocity", -100.0..=100.0, "m/s"],
        /// What the axis does. auto: what the calibration says of it; shift the part, where it says nothing.
        /// prismatic: positions are metres; revolute: radians, and a turn that begins again at 0 goes on. Another
        /// axis than the calibration's is refused.
        axis: AxisChoice = AxisChoice::Auto => ["motion.axis"],
        /// What one unit of a joint or one count of an encoder means; negative turns the axis round. 0: as the
        /// messages say, 1 for joints. The scale of the calibration's axis counts as well.
        scale: Option<f64> = None => ["motion.scale", -1e6..=1e6, "m or rad a unit"],
        /// Width of the encoder's counter, where its counts begin again at 0 after it; the axis must not move half
        /// the range between two samples. 0: counts are unwrapped already, as EncoderStamped wants them.
        encoder_bits: Option<u32> = None => ["motion.encoder_bits", 0..=63, "bits"],
        /// Which way positions should go; what goes the other way is flagged REVERSED. auto: the way that a scan goes
        /// first; forward: up; backward: down; both: to and fro, nothing is flagged. Set it where an axis may run the
        /// wrong way.
        direction: ScanDirection = ScanDirection::Auto => ["motion.direction"],
        /// How far the axis may move back and yet stand still: some counts of the encoder.
        backlash: f64 = 1e-5 => ["motion.backlash", 0.0..=1.0, "m or rad"],
        /// Frames between two samples that lie further apart are flagged GAP: a counter that was reset, an axis that
        /// slipped. 0: any distance is believed.
        max_step: Option<f64> = None => ["motion.max_step", 0.0..=1e6, "m or rad"],
        /// Longest time between two samples: frames between those further apart are flagged STALE, and a motion is
        /// thought to go on (EXTRAPOLATED) no longer than this. 0: four times the usual time between samples.
        max_gap_s: Option<f64> = None => ["motion.max_gap", 0.0..=3600.0, "s"],
        /// Frames that wait at most for a sample taken after them, 256 MiB of them and at least a second. Raise it
        /// where positions come much later than images.
        max_wait_frames: u32 = 32 => ["motion.max_wait", 0..=1000, "frames"],
        /// From the stamp of a frame to the middle of its exposure: half the exposure time, where cameras stamp its
        /// beginning. An axis that stands still while exposing may be looked up where its position was taken.
        exposure_offset_s: f64 = 0.0 => ["motion.exposure_offset", -10.0..=10.0, "s"],
    }
}

impl MotionSource {
    /// Whether positions come in messages of their own.
    pub const fn is_measured(self) -> bool {
        matches!(self, Self::JointState | Self::Encoder | Self::Tf)
    }
}
