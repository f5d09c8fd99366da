//! `action_msgs`: the goals of an action server, and their cancellation.

use serde::{Deserialize, Serialize};

use super::{
    builtin_interfaces::Time,
    schema::{ServiceType, message, request_text, response_text},
    unique_identifier_msgs::Uuid,
};

const CANCEL_GOAL_TEXT: &str = include_str!("definitions/action_msgs/CancelGoal.srv");

/// Cancels goals.
pub const CANCEL_GOAL: ServiceType = ServiceType {
    name: "action_msgs/srv/CancelGoal",
    text: CANCEL_GOAL_TEXT,
    hash: "RIHS01_573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a",
};

/// Identity of a goal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GoalInfo {
    /// Identity, chosen by the client.
    pub(crate) goal_id: Uuid,
    /// Time at which the server accepted it.
    pub(crate) stamp: Time,
}

/// States of a goal, as in [`GoalStatus::status`].
pub(crate) mod status {
    pub(crate) const UNKNOWN: i8 = 0;
    pub(crate) const EXECUTING: i8 = 2;
    pub(crate) const CANCELING: i8 = 3;
    pub(crate) const SUCCEEDED: i8 = 4;
    pub(crate) const CANCELED: i8 = 5;
    pub(crate) const ABORTED: i8 = 6;
}

/// A goal and its state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GoalStatus {
    /// The goal.
    pub(crate) goal_info: GoalInfo,
    /// A constant of [`status`].
    pub(crate) status: i8,
}

/// The goals of an action server.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GoalStatusArray {
    /// The goals.
    pub(crate) status_list: Vec<GoalStatus>,
}

/// Request of [`CANCEL_GOAL`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CancelGoalRequest {
    /// Goals to cancel: that of the identity, those accepted up to the stamp, or, with neither, all.
    pub(crate) goal_info: GoalInfo,
}

/// Outcomes of a cancellation, as in [`CancelGoalResponse::return_code`].
pub(crate) mod cancel {
    pub(crate) const NONE: i8 = 0;
    pub(crate) const UNKNOWN_GOAL_ID: i8 = 2;
    pub(crate) const GOAL_TERMINATED: i8 = 3;
}

/// Response of [`CANCEL_GOAL`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CancelGoalResponse {
    /// A constant of [`cancel`].
    pub(crate) return_code: i8,
    /// Goals that end.
    pub(crate) goals_canceling: Vec<GoalInfo>,
}

message!(
    GoalInfo,
    "action_msgs/msg/GoalInfo",
    include_str!("definitions/action_msgs/GoalInfo.msg"),
    "RIHS01_6398fe763154554353930716b225947f93b672f0fb2e49fdd01bb7a7e37933e9",
    [Uuid, Time]
);
message!(
    GoalStatus,
    "action_msgs/msg/GoalStatus",
    include_str!("definitions/action_msgs/GoalStatus.msg"),
    "RIHS01_32f4cfd717735d17657e1178f24431c1ce996c878c515230f6c5b3476819dbb9",
    [GoalInfo]
);
message!(
    GoalStatusArray,
    "action_msgs/msg/GoalStatusArray",
    include_str!("definitions/action_msgs/GoalStatusArray.msg"),
    "RIHS01_6c1684b00f177d37438febe6e709fc4e2b0d4248dca4854946f9ed8b30cda83e",
    [GoalStatus]
);
message!(
    CancelGoalRequest,
    "action_msgs/srv/CancelGoal_Request",
    request_text(CANCEL_GOAL_TEXT),
    "RIHS01_3d3c84653c1f96918086887e1dcb236faec88b81a5b14fd4cf4840065bcdf8af",
    [GoalInfo]
);
message!(
    CancelGoalResponse,
    "action_msgs/srv/CancelGoal_Response",
    response_text(CANCEL_GOAL_TEXT),
    "RIHS01_35e682cf3f510e83c70a82a4aac888496dedee56773bf9d8e5e0aa81f9e1c960",
    [GoalInfo]
);
