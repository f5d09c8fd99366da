//! `std_srvs`: services that trigger an action or switch something on or off.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::{
    schema::{ServiceType, message, request_text, response_text},
    text,
};

const TRIGGER_TEXT: &str = include_str!("definitions/std_srvs/Trigger.srv");
const SET_BOOL_TEXT: &str = include_str!("definitions/std_srvs/SetBool.srv");

/// Service that triggers an action.
pub const TRIGGER: ServiceType = ServiceType {
    name: "std_srvs/srv/Trigger",
    text: TRIGGER_TEXT,
    hash: "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
};

/// Service that switches something on or off.
pub const SET_BOOL: ServiceType = ServiceType {
    name: "std_srvs/srv/SetBool",
    text: SET_BOOL_TEXT,
    hash: "RIHS01_abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a",
};

/// Request of [`TRIGGER`]; empty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TriggerRequest {
    /// Placeholder that ROS adds to empty messages.
    pub structure_needs_at_least_one_member: u8,
}

/// Response of [`TRIGGER`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TriggerResponse<'a> {
    /// True on success.
    pub success: bool,
    /// Result, or reason for a failure.
    #[serde(borrow, with = "text")]
    pub message: Cow<'a, str>,
}

/// Request of [`SET_BOOL`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetBoolRequest {
    /// True to switch on, false to switch off.
    pub data: bool,
}

/// Response of [`SET_BOOL`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetBoolResponse<'a> {
    /// True on success.
    pub success: bool,
    /// Result, or reason for a failure.
    #[serde(borrow, with = "text")]
    pub message: Cow<'a, str>,
}

message!(
    TriggerRequest,
    "std_srvs/srv/Trigger_Request",
    request_text(TRIGGER_TEXT),
    "RIHS01_d010825374ce8918e72bfd826c82603e60f45419e932ea976f807b74a863a199",
    []
);
message!(
    TriggerResponse<'_>,
    "std_srvs/srv/Trigger_Response",
    response_text(TRIGGER_TEXT),
    "RIHS01_2d946c21e2fc3f1e9ca6986a8191d85fcc70097a8bb7771a053564bc47009cdf",
    []
);
message!(
    SetBoolRequest,
    "std_srvs/srv/SetBool_Request",
    request_text(SET_BOOL_TEXT),
    "RIHS01_c62fbb99d94e1b25e8ef9e109f9581956bb1b3361a45a4e5810c36a90d29932e",
    []
);
message!(
    SetBoolResponse<'_>,
    "std_srvs/srv/SetBool_Response",
    response_text(SET_BOOL_TEXT),
    "RIHS01_d0814e7f7b4880ab77e9c57426c7aa1562ab69f11eef8e2e968812f9cbd0b059",
    []
);
