//! `diagnostic_msgs`: health of the node, for people and for aggregators.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::{schema::message, std_msgs::Header, text};

/// States of the components of a system at one time.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct DiagnosticArray<'a> {
    /// Time of the states.
    #[serde(borrow)]
    pub(crate) header: Header<'a>,
    /// One entry per component.
    #[serde(borrow)]
    pub(crate) status: Vec<DiagnosticStatus<'a>>,
}

/// State of one component.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct DiagnosticStatus<'a> {
    /// [`OK`](Self::OK), [`WARN`](Self::WARN), [`ERROR`](Self::ERROR) or [`STALE`](Self::STALE).
    pub(crate) level: u8,
    /// Name of the component.
    #[serde(borrow, with = "text")]
    pub(crate) name: Cow<'a, str>,
    /// The state in words.
    #[serde(borrow, with = "text")]
    pub(crate) message: Cow<'a, str>,
    /// Identity of the hardware.
    #[serde(borrow, with = "text")]
    pub(crate) hardware_id: Cow<'a, str>,
    /// Values that explain the state.
    #[serde(borrow)]
    pub(crate) values: Vec<KeyValue<'a>>,
}

impl DiagnosticStatus<'_> {
    /// Normal operation.
    pub(crate) const OK: u8 = 0;
    /// Works, but needs attention.
    pub(crate) const WARN: u8 = 1;
    /// Does not work.
    pub(crate) const ERROR: u8 = 2;
}

/// A named value for people to read.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct KeyValue<'a> {
    /// Name of the value.
    #[serde(borrow, with = "text")]
    pub(crate) key: Cow<'a, str>,
    /// Value as text.
    #[serde(borrow, with = "text")]
    pub(crate) value: Cow<'a, str>,
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
