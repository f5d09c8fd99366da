//! The action `Scan`: one scan, from its goal to its result. `msgs/laser_profiler_msgs/action/Scan.action` documents each
//! field in detail.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use crate::msg::{
    builtin_interfaces::{Duration, Time},
    schema::{ServiceType, message, request_text, response_text},
    text::{self, Text},
    unique_identifier_msgs::Uuid,
};

const ACTION_TEXT: &str = include_str!("../../../msgs/laser_profiler_msgs/action/Scan.action");
const SEND_GOAL_TEXT: &str = "unique_identifier_msgs/UUID goal_id\nScan_Goal goal\n---\nbool accepted\n\
                              builtin_interfaces/Time stamp\n";
const GET_RESULT_TEXT: &str =
    "unique_identifier_msgs/UUID goal_id\n---\nint8 status\nScan_Result result\n";

/// Asks for a scan.
pub const SEND_GOAL: ServiceType = ServiceType {
    name: "laser_profiler_msgs/action/Scan_SendGoal",
    text: SEND_GOAL_TEXT,
    hash: "RIHS01_c10df4b358632166af2393cf5544498f7ba81ce1a42435e819587b5bc9108f42",
};

/// Waits for the result of a scan.
pub const GET_RESULT: ServiceType = ServiceType {
    name: "laser_profiler_msgs/action/Scan_GetResult",
    text: GET_RESULT_TEXT,
    hash: "RIHS01_f1ce5088a493a0e6537b593fc3606d9f48dc80526513cdc8c6e2756bd141a8e2",
};

/// The scan to run. It ends at the first limit reached; a limit of 0 is none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ScanGoal<'a> {
    /// Name of the part; may be empty.
    #[serde(borrow, with = "text")]
    pub part_id: Cow<'a, str>,
    /// Length along the axis, metres.
    pub length: f64,
    /// Number of frames.
    pub frames: u64,
    /// Time.
    pub max_duration: Duration,
    /// Position of the first row, metres; 0 or NaN: where the scan begins.
    pub start_position: f64,
    /// True to record the scan.
    pub record: bool,
}

/// The outcome of a scan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ScanResult<'a> {
    /// One of the constants.
    pub result: u8,
    /// The reason that it ended.
    #[serde(borrow, with = "text")]
    pub message: Cow<'a, str>,
    /// Identity of the scan.
    pub scan_id: Uuid,
    /// Frames that belong to the scan.
    pub frames_expected: u64,
    /// Frames measured.
    pub frames_accepted: u64,
    /// Frames that never arrived.
    pub frames_missing: u64,
    /// Frames that arrived and were not used.
    pub frames_rejected: u64,
    /// Valid points.
    pub points: u64,
    /// Length covered, metres; NaN: unknown.
    pub length: f64,
    /// URIs of the recorded files.
    #[serde(borrow)]
    pub(crate) recordings: Vec<Text<'a>>,
    /// Their SHA-256, hexadecimal.
    #[serde(borrow)]
    pub(crate) recordings_sha256: Vec<Text<'a>>,
}

impl ScanResult<'_> {
    /// No frame is missing.
    pub const SUCCEEDED: u8 = 0;
    /// Complete, but frames are missing or were rejected.
    pub const SUCCEEDED_WITH_GAPS: u8 = 1;
    /// It did not reach its end.
    pub const FAILED: u8 = 2;
}

/// The progress of a scan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ScanFeedback {
    /// Frames measured.
    pub frames_accepted: u64,
    /// Frames that never arrived.
    pub frames_missing: u64,
    /// Position of the axis, metres; NaN: unknown.
    pub position: f64,
    /// Share of the nearest limit, 0 to 1.
    pub progress: f32,
}

/// Request of [`SEND_GOAL`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SendGoalRequest<'a> {
    /// Identity of the goal.
    pub goal_id: Uuid,
    /// The scan.
    #[serde(borrow)]
    pub goal: ScanGoal<'a>,
}

/// Response of [`SEND_GOAL`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SendGoalResponse {
    /// True if the scan begins.
    pub accepted: bool,
    /// Time of the decision.
    pub stamp: Time,
}

/// Request of [`GET_RESULT`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GetResultRequest {
    /// Identity of the goal.
    pub goal_id: Uuid,
}

/// Response of [`GET_RESULT`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GetResultResponse<'a> {
    /// Final state of the goal, as in `action_msgs/GoalStatus`.
    pub status: i8,
    /// The outcome.
    #[serde(borrow)]
    pub result: ScanResult<'a>,
}

/// Feedback on a goal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FeedbackMessage {
    /// Identity of the goal.
    pub goal_id: Uuid,
    /// The progress.
    pub feedback: ScanFeedback,
}

message!(
    ScanGoal<'_>,
    "laser_profiler_msgs/action/Scan_Goal",
    request_text(ACTION_TEXT),
    "RIHS01_180e35b5f25c435ad2f8fdbdcc726077a2d259623f3481a009d7c57a6bbfcfe8",
    [Duration]
);
message!(
    ScanResult<'_>,
    "laser_profiler_msgs/action/Scan_Result",
    request_text(response_text(ACTION_TEXT)),
    "RIHS01_db258a9b43a9ad6dd4ade335f87e49737920367ab00cd66f43c0f77e2471cd95",
    [Uuid]
);
message!(
    ScanFeedback,
    "laser_profiler_msgs/action/Scan_Feedback",
    response_text(response_text(ACTION_TEXT)),
    "RIHS01_c96908a39dc78f494ceb2ca8efcf19a60304bb997df81e312a0f6871ccba653f",
    []
);
message!(
    SendGoalRequest<'_>,
    "laser_profiler_msgs/action/Scan_SendGoal_Request",
    request_text(SEND_GOAL_TEXT),
    "RIHS01_bcfbb2acb8a1087af0cf7dc2d96dfc1b324a43dba2b459a22fead393a9e31d8c",
    [Uuid, ScanGoal<'_>]
);
message!(
    SendGoalResponse,
    "laser_profiler_msgs/action/Scan_SendGoal_Response",
    response_text(SEND_GOAL_TEXT),
    "RIHS01_dd2d076dfb51b009432aa91a701548b555ae108ef92cb1f23ff8f6d932d80812",
    [Time]
);
message!(
    GetResultRequest,
    "laser_profiler_msgs/action/Scan_GetResult_Request",
    request_text(GET_RESULT_TEXT),
    "RIHS01_25e44de8e7662b7bb46c85cb2ec0ea172c5dc716c76e58d4ad3f81fa303a89fa",
    [Uuid]
);
message!(
    GetResultResponse<'_>,
    "laser_profiler_msgs/action/Scan_GetResult_Response",
    response_text(GET_RESULT_TEXT),
    "RIHS01_385f68efc4e8cdea0ce3df148d58240f4ab07c60dd942e752744d6f09408ed3c",
    [ScanResult<'_>]
);
message!(
    FeedbackMessage,
    "laser_profiler_msgs/action/Scan_FeedbackMessage",
    "unique_identifier_msgs/UUID goal_id\nScan_Feedback feedback\n",
    "RIHS01_b2a820f9fdaf6a34f29edbd819252309ec3b5cb0a6607e5343e36b0f26f08706",
    [Uuid, ScanFeedback]
);
