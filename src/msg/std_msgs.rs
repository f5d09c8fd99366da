//! `std_msgs`: the header of every stamped message.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::{builtin_interfaces::Time, schema::message, text};

/// Time and coordinate frame of the data.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header<'a> {
    /// Time of acquisition.
    pub stamp: Time,
    /// Name of the coordinate frame.
    #[serde(borrow, with = "text")]
    pub frame_id: Cow<'a, str>,
}

impl Header<'_> {
    /// Returns the same header with borrowed text.
    pub fn borrowed(&self) -> Header<'_> {
        Header { stamp: self.stamp, frame_id: Cow::Borrowed(&self.frame_id) }
    }
}

message!(
    Header<'_>,
    "std_msgs/msg/Header",
    include_str!("definitions/std_msgs/Header.msg"),
    "RIHS01_f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01",
    [Time]
);
