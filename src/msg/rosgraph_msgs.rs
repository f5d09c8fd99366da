//! `rosgraph_msgs`: the clock of a replay.

use serde::{Deserialize, Serialize};

use super::{builtin_interfaces::Time, schema::message};

/// Current time for the nodes of a simulation or a replay.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Clock {
    /// Time.
    pub clock: Time,
}

message!(
    Clock,
    "rosgraph_msgs/msg/Clock",
    include_str!("definitions/rosgraph_msgs/Clock.msg"),
    "RIHS01_692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564",
    [Time]
);
