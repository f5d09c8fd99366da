//! `diagnostic_msgs`: how the node is doing, for people and for aggregators.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::{schema::message, std_msgs::Header, text};

/// States of the components of a system at one time.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticArray<'a> {
    /// Time of the states.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// One entry a component.
    #[serde(borrow)]
    pub status: Vec<DiagnosticStatus<'a>>,
}

/// State of one component.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticStatus<'a> {
    /// [`OK`](Self::OK), [`WARN`](Self::WARN), [`ERROR`](Self::ERROR) or [`STALE`](Self::STALE).
    pub level: u8,
    /// Name of the component.
    #[serde(borrow, with = "text")]
    pub name: Cow<'a, str>,
    /// The state in words.
    #[serde(borrow, with = "text")]
    pub message: Cow<'a, str>,
    /// Identity of the hardware.
    #[serde(borrow, with = "text")]
    pub hardware_id: Cow<'a, str>,
    /// Figures behind the state.
    #[serde(borrow)]
    pub values: Vec<KeyValue<'a>>,
}

impl DiagnosticStatus<'_> {
    /// All is well.
    pub const OK: u8 = 0;
    /// It works, but somebody should look.
    pub const WARN: u8 = 1;
    /// It does not work.
    pub const ERROR: u8 = 2;
    /// Nothing was heard of it for too long.
    pub const STALE: u8 = 3;
}

/// A named value for people to read.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeyValue<'a> {
    /// What it is.
    #[serde(borrow, with = "text")]
    pub key: Cow<'a, str>,
    /// Its value as text.
    #[serde(borrow, with = "text")]
    pub value: Cow<'a, str>,
}

message!(
    DiagnosticArray<'_>,
    "diagnostic_msgs/msg/DiagnosticArray",
    include_str!("definitions/diagnostic_msgs/DiagnosticArray.msg"),
    "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    [Header<'_>, DiagnosticStatus<'_>]
);
message!(
    DiagnosticStatus<'_>,
    "diagnostic_msgs/msg/DiagnosticStatus",
    include_str!("definitions/diagnostic_msgs/DiagnosticStatus.msg"),
    "RIHS01_b0e3e692ea2d54a8af2f4ef1930e81556a2db55216b771f8a7d2724ed47bf0e4",
    [KeyValue<'_>]
);
message!(
    KeyValue<'_>,
    "diagnostic_msgs/msg/KeyValue",
    include_str!("definitions/diagnostic_msgs/KeyValue.msg"),
    "RIHS01_d68081eaa540288c5440753baecef0c4e16e81a5f78ad68902ded5100413bb42",
    []
);
