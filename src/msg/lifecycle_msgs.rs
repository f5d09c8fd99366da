//! `lifecycle_msgs`: states of a managed node, and the services that change and report them.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::{
    schema::{ServiceType, message, request_text, response_text},
    text,
};

const CHANGE_STATE_TEXT: &str = include_str!("definitions/lifecycle_msgs/ChangeState.srv");
const GET_STATE_TEXT: &str = include_str!("definitions/lifecycle_msgs/GetState.srv");
const GET_AVAILABLE_STATES_TEXT: &str =
    include_str!("definitions/lifecycle_msgs/GetAvailableStates.srv");
const GET_AVAILABLE_TRANSITIONS_TEXT: &str =
    include_str!("definitions/lifecycle_msgs/GetAvailableTransitions.srv");

/// Service that changes the state.
pub const CHANGE_STATE: ServiceType = ServiceType {
    name: "lifecycle_msgs/srv/ChangeState",
    text: CHANGE_STATE_TEXT,
    hash: "RIHS01_356fe34f0475a43acf54542013af4167b0e729f77ea22ffb045c6ad8e20668e5",
};

/// Service that returns the state.
pub const GET_STATE: ServiceType = ServiceType {
    name: "lifecycle_msgs/srv/GetState",
    text: GET_STATE_TEXT,
    hash: "RIHS01_800a0a5aae599782b02932de0caf563f6dc4e7e94b794eadde075ba2cbef9795",
};

/// Service that returns all states.
pub const GET_AVAILABLE_STATES: ServiceType = ServiceType {
    name: "lifecycle_msgs/srv/GetAvailableStates",
    text: GET_AVAILABLE_STATES_TEXT,
    hash: "RIHS01_00a07d79d2207d71e81a8cbc1880e5d924cc16d4688ea8e8e06e443dc8f8aa1d",
};

/// Service that returns transitions: those possible in the current state, or all.
pub const GET_AVAILABLE_TRANSITIONS: ServiceType = ServiceType {
    name: "lifecycle_msgs/srv/GetAvailableTransitions",
    text: GET_AVAILABLE_TRANSITIONS_TEXT,
    hash: "RIHS01_59b7ecefce0982a8a844b9f2c4f14764c1c4543cc55e72924e2aa4adad83e9bc",
};

/// A state of a managed node.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct State<'a> {
    /// Number.
    pub id: u8,
    /// Name, such as `inactive`.
    #[serde(borrow, with = "text")]
    pub label: Cow<'a, str>,
}

/// A change of state.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Transition<'a> {
    /// Number.
    pub id: u8,
    /// Name, such as `configure`. Takes precedence over the id unless empty.
    #[serde(borrow, with = "text")]
    pub label: Cow<'a, str>,
}

/// A transition with its start and goal states.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TransitionDescription<'a> {
    /// Transition.
    #[serde(borrow)]
    pub transition: Transition<'a>,
    /// State before the transition.
    #[serde(borrow)]
    pub start_state: State<'a>,
    /// State after the transition.
    #[serde(borrow)]
    pub goal_state: State<'a>,
}

/// A change of state, as in ROS 2 Jazzy. Lyrical has a `stamp` instead of the timestamp, and therefore another hash.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TransitionEvent<'a> {
    /// Time of the change, nanoseconds since the epoch.
    pub timestamp: u64,
    /// Transition.
    #[serde(borrow)]
    pub transition: Transition<'a>,
    /// State before.
    #[serde(borrow)]
    pub start_state: State<'a>,
    /// Current state.
    #[serde(borrow)]
    pub goal_state: State<'a>,
}

/// Request of [`CHANGE_STATE`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChangeStateRequest<'a> {
    /// Transition, by id or by label.
    #[serde(borrow)]
    pub transition: Transition<'a>,
}

/// Response of [`CHANGE_STATE`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChangeStateResponse {
    /// True if the transition was allowed and succeeded.
    pub success: bool,
}

/// Request of [`GET_STATE`]; empty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GetStateRequest {
    /// Placeholder that ROS adds to empty messages.
    pub structure_needs_at_least_one_member: u8,
}

/// Response of [`GET_STATE`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GetStateResponse<'a> {
    /// Current state of the node.
    #[serde(borrow)]
    pub current_state: State<'a>,
}

/// Request of [`GET_AVAILABLE_STATES`]; empty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GetAvailableStatesRequest {
    /// Placeholder that ROS adds to empty messages.
    pub structure_needs_at_least_one_member: u8,
}

/// Response of [`GET_AVAILABLE_STATES`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GetAvailableStatesResponse<'a> {
    /// All states.
    #[serde(borrow)]
    pub available_states: Vec<State<'a>>,
}

/// Request of [`GET_AVAILABLE_TRANSITIONS`]; empty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GetAvailableTransitionsRequest {
    /// Placeholder that ROS adds to empty messages.
    pub structure_needs_at_least_one_member: u8,
}

/// Response of [`GET_AVAILABLE_TRANSITIONS`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct GetAvailableTransitionsResponse<'a> {
    /// Transitions.
    #[serde(borrow)]
    pub available_transitions: Vec<TransitionDescription<'a>>,
}

message!(
    State<'_>,
    "lifecycle_msgs/msg/State",
    include_str!("definitions/lifecycle_msgs/State.msg"),
    "RIHS01_dd2d02b82f3ebc858e53c431b1e6e91f3ffc71436fc81d0715214ac6ee2107a0",
    []
);
message!(
    Transition<'_>,
    "lifecycle_msgs/msg/Transition",
    include_str!("definitions/lifecycle_msgs/Transition.msg"),
    "RIHS01_c65d7b31ea134cba4f54fc867b817979be799f7452035cd35fac9b7421fb3424",
    []
);
message!(
    TransitionDescription<'_>,
    "lifecycle_msgs/msg/TransitionDescription",
    include_str!("definitions/lifecycle_msgs/TransitionDescription.msg"),
    "RIHS01_c5f1cd4bb1ad2ba0e3329d4ac7015c52a674a72c1faf7974c37a33f4f6048b28",
    [Transition<'_>, State<'_>]
);
message!(
    TransitionEvent<'_>,
    "lifecycle_msgs/msg/TransitionEvent",
    include_str!("definitions/lifecycle_msgs/TransitionEvent.msg"),
    "RIHS01_d5f8873a2f0146498f812d7885c7327ce27e463d36811d8792f35ee38c0d6c38",
    [Transition<'_>, State<'_>]
);
message!(
    ChangeStateRequest<'_>,
    "lifecycle_msgs/srv/ChangeState_Request",
    request_text(CHANGE_STATE_TEXT),
    "RIHS01_d74c6f524e14cade7b67e7297190360ed749264af300524fc1456f27cc2a553a",
    [Transition<'_>]
);
message!(
    ChangeStateResponse,
    "lifecycle_msgs/srv/ChangeState_Response",
    response_text(CHANGE_STATE_TEXT),
    "RIHS01_e1ddfed0271fefe63767aa71561926e4d9eac0f1ddf9e71a8873eb46b36deac2",
    []
);
message!(
    GetStateRequest,
    "lifecycle_msgs/srv/GetState_Request",
    request_text(GET_STATE_TEXT),
    "RIHS01_77a9c844e7975f15bc2221e8bbebafc4d118afb78c7f7071eef91f83f940f2f6",
    []
);
message!(
    GetStateResponse<'_>,
    "lifecycle_msgs/srv/GetState_Response",
    response_text(GET_STATE_TEXT),
    "RIHS01_fe249babab472e42cb5653b5d6a6b0c42a003b0fdfb84851aea3fde08760b4f5",
    [State<'_>]
);
message!(
    GetAvailableStatesRequest,
    "lifecycle_msgs/srv/GetAvailableStates_Request",
    request_text(GET_AVAILABLE_STATES_TEXT),
    "RIHS01_c2c0c12de6023822f284929577d4ca2862e0501150010966e8a90b632e4424de",
    []
);
message!(
    GetAvailableStatesResponse<'_>,
    "lifecycle_msgs/srv/GetAvailableStates_Response",
    response_text(GET_AVAILABLE_STATES_TEXT),
    "RIHS01_223e0dd5bb8a847ebb9532adaf8b5e2a97e6e68e79faeaabd81a45fb32925bd1",
    [State<'_>]
);
message!(
    GetAvailableTransitionsRequest,
    "lifecycle_msgs/srv/GetAvailableTransitions_Request",
    request_text(GET_AVAILABLE_TRANSITIONS_TEXT),
    "RIHS01_52a73c0b5d7489bee0df6ddb0aec45c41289d223ff225b58fe11d859ac8109a6",
    []
);
message!(
    GetAvailableTransitionsResponse<'_>,
    "lifecycle_msgs/srv/GetAvailableTransitions_Response",
    response_text(GET_AVAILABLE_TRANSITIONS_TEXT),
    "RIHS01_4711339461aadf02bcfff797a198de911f885074bd3f2fe9f7b677ef87f0741c",
    [TransitionDescription<'_>]
);
