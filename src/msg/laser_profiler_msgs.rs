//! `laser_profiler_msgs`: our own interface package. `msgs/laser_profiler_msgs` documents each field in detail.

pub mod scan;

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::{
    builtin_interfaces::Time,
    schema::{ServiceType, message, request_text, response_text},
    sensor_msgs::RegionOfInterest,
    std_msgs::Header,
    text,
    unique_identifier_msgs::Uuid,
};

const START_SCAN_TEXT: &str = include_str!("../../msgs/laser_profiler_msgs/srv/StartScan.srv");

/// Starts a scan.
pub const START_SCAN: ServiceType = ServiceType {
    name: "laser_profiler_msgs/srv/StartScan",
    text: START_SCAN_TEXT,
    hash: "RIHS01_f4259805747f25c2e6f744c771c1487dce16ab59e3d4d52f687a51553a94ac2b",
};

/// Identity of a frame, frames missing before it, and position of the axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameTrace {
    /// Frame counter, 64 bit.
    pub frame_number: u64,
    /// Source of `frame_number`, one of the `SOURCE_` constants.
    pub frame_number_source: u8,
    /// Frames known to be missing directly before this one.
    pub frames_missing: u32,
    /// True if `frames_missing` is known.
    pub frames_missing_valid: bool,
    /// Encoder, counts.
    pub encoder: i64,
    /// Position along the scan axis, metres.
    pub position: f64,
    /// Source of `encoder` and `position`, one of the `SOURCE_` constants.
    pub encoder_source: u8,
    /// Bits of the `ENCODER_` constants.
    pub encoder_status: u8,
    /// Digital inputs at exposure, bit i = input i.
    pub digital_inputs: u16,
    /// Exposure time, seconds; NaN: unknown.
    pub exposure_time: f32,
    /// Time at which this host received the frame.
    pub receive_stamp: Time,
}

impl FrameTrace {
    /// Unknown; the value is 0.
    pub const SOURCE_NONE: u8 = 0;
    /// From the camera or sensor.
    pub const SOURCE_DEVICE: u8 = 1;
    /// Publication sequence number of the middleware.
    pub const SOURCE_TRANSPORT: u8 = 2;
    /// Counted, or interpolated, on this host.
    pub const SOURCE_HOST: u8 = 3;
    /// Step of the encoder larger than the configured limit.
    pub const ENCODER_GAP: u8 = 1;
    /// The encoder moved against the scan direction.
    pub const ENCODER_REVERSED: u8 = 2;
    /// No new sample of the encoder within the configured time.
    pub const ENCODER_STALE: u8 = 4;
    /// The encoder's value is extrapolated.
    pub const ENCODER_EXTRAPOLATED: u8 = 8;
}

impl Default for FrameTrace {
    /// Returns the trace of an unknown frame: zeros, and NaN for the exposure time.
    fn default() -> Self {
        Self {
            frame_number: 0,
            frame_number_source: Self::SOURCE_NONE,
            frames_missing: 0,
            frames_missing_valid: false,
            encoder: 0,
            position: 0.0,
            encoder_source: Self::SOURCE_NONE,
            encoder_status: 0,
            digital_inputs: 0,
            exposure_time: f32::NAN,
            receive_stamp: Time::default(),
        }
    }
}

/// The stripe's sub-pixel centreline in one frame; see [`stripe::Centerline`](crate::scanner::stripe::Centerline).
///
/// The per-point arrays `width` to `flags` are as long as `u` and `v`, or empty.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Centerline<'a> {
    /// Header of the image.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Position of the frame in the stream.
    pub trace: FrameTrace,
    /// Columns of the image.
    pub image_width: u32,
    /// Rows of the image.
    pub image_height: u32,
    /// Region of interest.
    pub roi: RegionOfInterest,
    /// Direction of the stripe in the image, one of the `STRIPE_` constants.
    pub stripe_direction: u8,
    /// Method, `/` and a hash of its parameters.
    #[serde(borrow, with = "text")]
    pub method: Cow<'a, str>,
    /// Columns, pixels; pixel centres at integers.
    pub u: Cow<'a, [f32]>,
    /// Rows, pixels.
    pub v: Cow<'a, [f32]>,
    /// Index of the first point of each connected stripe.
    pub stripe_start: Cow<'a, [u32]>,
    /// Full width at half maximum, pixels.
    pub width: Cow<'a, [f32]>,
    /// Grey level at the centre, units of the image.
    pub intensity: Cow<'a, [f32]>,
    /// One standard deviation of the centre, pixels.
    pub sigma: Cow<'a, [f32]>,
    /// Bits of [`stripe::flag`](crate::scanner::stripe::flag).
    #[serde(borrow, with = "serde_bytes")]
    pub flags: Cow<'a, [u8]>,
}

impl Centerline<'_> {
    /// Unknown: written before the field existed.
    pub const STRIPE_UNKNOWN: u8 = 0;
    /// Horizontal: one centre per column, `u` is an integer.
    pub const STRIPE_HORIZONTAL: u8 = 1;
    /// Vertical: one centre per row, `v` is an integer.
    pub const STRIPE_VERTICAL: u8 = 2;
}

/// One metric cross-section; see [`profile::Profile`](crate::scanner::profile::Profile).
///
/// The arrays `intensity` to `sigma_z`, and `calibration_sigma_z`, are as long as `x` and `z`, or empty.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Profile<'a> {
    /// Stamp of the image, frame of the laser plane.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Position of the frame in the stream.
    pub trace: FrameTrace,
    /// Number of the stripe or laser, from 0.
    pub stripe: u16,
    /// Positions along the stripe, metres; NaN if not measured.
    pub x: Cow<'a, [f32]>,
    /// Heights, metres; NaN if not measured.
    pub z: Cow<'a, [f32]>,
    /// Grey levels as a share of full scale, 0 to 1.
    pub intensity: Cow<'a, [f32]>,
    /// Bits of [`stripe::flag`](crate::scanner::stripe::flag).
    #[serde(borrow, with = "serde_bytes")]
    pub flags: Cow<'a, [u8]>,
    /// One standard deviation of `z` from that of the centre, metres: independent noise of each point.
    pub sigma_z: Cow<'a, [f32]>,
    /// Points with finite `x` and `z`.
    pub valid_count: u32,
    /// Hash of the calibration.
    #[serde(borrow, with = "text")]
    pub calibration_id: Cow<'a, str>,
    /// One standard deviation of `z` from the uncertainty of the calibration, metres: common to neighbouring points, so it
    /// does not average out. NaN if not measured; empty if the calibration states no uncertainty, and in messages of
    /// versions without the field.
    pub calibration_sigma_z: Cow<'a, [f32]>,
}

/// Range of a slice and frames missing from it; see [`scan::SliceAccount`](crate::scanner::scan::SliceAccount).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SliceInfo<'a> {
    /// Header of the slice's cloud.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Identity of the scan.
    pub scan_id: Uuid,
    /// Identity of the part.
    #[serde(borrow, with = "text")]
    pub part_id: Cow<'a, str>,
    /// Number of the slice in its scan, from 0.
    pub slice_index: u32,
    /// True if the scan ends with this slice.
    pub last_slice: bool,
    /// First frame.
    pub first_frame: u64,
    /// Last frame, inclusive.
    pub last_frame: u64,
    /// Position of the first profile, metres.
    pub first_position: f64,
    /// Position of the last profile, metres.
    pub last_position: f64,
    /// `frames_accepted + frames_missing + frames_rejected`.
    pub frames_expected: u32,
    /// Frames in the slice.
    pub frames_accepted: u32,
    /// Frames that never reached the node.
    pub frames_missing: u32,
    /// Frames that reached the node, but were not used.
    pub frames_rejected: u32,
    /// Accepted frames without a valid point.
    pub profiles_empty: u32,
    /// Valid points in the cloud.
    pub points: u64,
    /// Worst state in the slice: [`COMPLETE`](Self::COMPLETE) to [`ABORTED`](Self::ABORTED).
    pub state: u8,
}

impl SliceInfo<'_> {
    /// The slice contains every expected frame.
    pub const COMPLETE: u8 = 0;
    /// Frames are missing or rejected; positions are correct.
    pub const GAPS: u8 = 1;
    /// Positions are in doubt.
    pub const DEGRADED: u8 = 2;
    /// The scan ended early.
    pub const ABORTED: u8 = 3;
}

/// Counters since activation; they never decrease while `session_id` is unchanged.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StreamStatus<'a> {
    /// Time of the counters.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Identity of the session.
    pub session_id: Uuid,
    /// Input topic, fully resolved.
    #[serde(borrow, with = "text")]
    pub topic: Cow<'a, str>,
    /// Frames received from the source.
    pub frames_received: u64,
    /// Frames measured.
    pub frames_processed: u64,
    /// Frames whose results were published.
    pub frames_published: u64,
    /// Gaps in the camera's frame counter.
    pub lost_upstream: u64,
    /// Gaps in the middleware's sequence number.
    pub lost_transport: u64,
    /// Frames dropped because the queue was full.
    pub dropped_overload: u64,
    /// Frames with invalid size, step, encoding or CDR.
    pub rejected_malformed: u64,
    /// Frames received twice.
    pub rejected_duplicate: u64,
    /// Frames older than their predecessors.
    pub rejected_out_of_order: u64,
    /// Messages processed, but not recorded.
    pub recorder_dropped: u64,
    /// Bytes recorded.
    pub recorder_bytes: u64,
    /// Frames received per second, over the last second.
    pub rate: f32,
    /// Median latency from stamp to publication, seconds, over the last second.
    pub latency_p50: f32,
    /// 99th percentile of that latency, seconds.
    pub latency_p99: f32,
    /// Maximum of that latency, seconds.
    pub latency_max: f32,
    /// Frames in the queue.
    pub queue_depth: u32,
    /// Capacity of the queue, frames.
    pub queue_capacity: u32,
}

/// Encoder sample of one axis.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EncoderStamped<'a> {
    /// Latch time.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Raw counts, unwrapped to 64 bit.
    pub counts: i64,
    /// Metres per count, signed; 0: not calibrated.
    pub scale: f64,
    /// Counts at the last index pulse.
    pub index_counts: i64,
    /// True if `index_counts` is valid.
    pub index_valid: bool,
    /// Velocity, metres per second; NaN: not measured.
    pub velocity: f32,
    /// Error bits of the device; 0: none.
    pub error: u32,
}

/// Request of [`START_SCAN`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StartScanRequest<'a> {
    /// Name of the part.
    #[serde(borrow, with = "text")]
    pub part_id: Cow<'a, str>,
    /// Travel after the axis's scale, metres; 0: until stopped. Must be 0 on a revolute axis without measured poses.
    pub length: f64,
}

/// Response of [`START_SCAN`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StartScanResponse<'a> {
    /// True if the scan has started.
    pub success: bool,
    /// Reason for a failure.
    #[serde(borrow, with = "text")]
    pub message: Cow<'a, str>,
    /// Identity of the scan.
    pub scan_id: Uuid,
}

message!(
    FrameTrace,
    "laser_profiler_msgs/msg/FrameTrace",
    include_str!("../../msgs/laser_profiler_msgs/msg/FrameTrace.msg"),
    "RIHS01_8c47b55c0143779382deace35fd0635dcb126dccabc3ce94f3fe0e8ad33d605c",
    [Time]
);
message!(
    Centerline<'_>,
    "laser_profiler_msgs/msg/Centerline",
    include_str!("../../msgs/laser_profiler_msgs/msg/Centerline.msg"),
    "RIHS01_ff3b478f46d354f91382d435d1c00766fa1abf3715ca431834c3b699e60b2090",
    [Header<'_>, FrameTrace, RegionOfInterest]
);
message!(
    Profile<'_>,
    "laser_profiler_msgs/msg/Profile",
    include_str!("../../msgs/laser_profiler_msgs/msg/Profile.msg"),
    "RIHS01_03d0b461f12771f11110d3f5542ab60ed8e75df0224d2171c553ce308dd77e06",
    [Header<'_>, FrameTrace]
);
message!(
    SliceInfo<'_>,
    "laser_profiler_msgs/msg/SliceInfo",
    include_str!("../../msgs/laser_profiler_msgs/msg/SliceInfo.msg"),
    "RIHS01_7aef36e2a4092a794b598b8f578b7010732d796ac352684a1ba7dc339cf804ff",
    [Header<'_>, Uuid]
);
message!(
    StreamStatus<'_>,
    "laser_profiler_msgs/msg/StreamStatus",
    include_str!("../../msgs/laser_profiler_msgs/msg/StreamStatus.msg"),
    "RIHS01_355d7da1400ef992c455bce1a45973391bd0b3b4fae8cc5df0b2249fb275efb6",
    [Header<'_>, Uuid]
);
message!(
    EncoderStamped<'_>,
    "laser_profiler_msgs/msg/EncoderStamped",
    include_str!("../../msgs/laser_profiler_msgs/msg/EncoderStamped.msg"),
    "RIHS01_cc9bc4f8a4424bc85c975d3d7d6bafc75edb6aa1e6d04fb6983536c2af1b749e",
    [Header<'_>]
);
message!(
    StartScanRequest<'_>,
    "laser_profiler_msgs/srv/StartScan_Request",
    request_text(START_SCAN_TEXT),
    "RIHS01_8284f7a471adb7606fef5deed2c7368ae65a9f93712d97ba956b86c0bb5ba688",
    []
);
message!(
    StartScanResponse<'_>,
    "laser_profiler_msgs/srv/StartScan_Response",
    response_text(START_SCAN_TEXT),
    "RIHS01_d5da3a0e3ee2c33e67a3d577ede5ff2a281eb502b5f320741742e07a6f15067d",
    [Uuid]
);
