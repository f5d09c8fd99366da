//! `rcl_interfaces/msg/Log`: a line of a node's log, as published on `/rosout`.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::{builtin_interfaces::Time, schema::message, text};

/// A line of a node's log.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Log<'a> {
    /// Time of the line.
    pub stamp: Time,
    /// [`DEBUG`](Self::DEBUG) to [`FATAL`](Self::FATAL).
    pub level: u8,
    /// Name of the logger.
    #[serde(borrow, with = "text")]
    pub name: Cow<'a, str>,
    /// Text of the line.
    #[serde(borrow, with = "text")]
    pub msg: Cow<'a, str>,
    /// Source file.
    #[serde(borrow, with = "text")]
    pub file: Cow<'a, str>,
    /// Function in that file.
    #[serde(borrow, with = "text")]
    pub function: Cow<'a, str>,
    /// Line of the file.
    pub line: u32,
}

impl Log<'_> {
    /// Details for debugging the node.
    pub const DEBUG: u8 = 10;
    /// Normal operation.
    pub const INFO: u8 = 20;
    /// Works, but needs attention.
    pub const WARN: u8 = 30;
    /// Something does not work.
    pub const ERROR: u8 = 40;
    /// The node terminates.
    pub const FATAL: u8 = 50;
}

message!(
    Log<'_>,
    "rcl_interfaces/msg/Log",
    include_str!("definitions/rcl_interfaces/Log.msg"),
    "RIHS01_e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac",
    [Time]
);
