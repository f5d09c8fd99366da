//! `tf2_msgs`: poses of coordinate frames, as on `/tf` and `/tf_static`.

use serde::{Deserialize, Serialize};

use super::{geometry_msgs::TransformStamped, schema::message};

/// Poses of coordinate frames.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TFMessage<'a> {
    /// One entry per child frame.
    #[serde(borrow)]
    pub transforms: Vec<TransformStamped<'a>>,
}

message!(
    TFMessage<'_>,
    "tf2_msgs/msg/TFMessage",
    include_str!("definitions/tf2_msgs/TFMessage.msg"),
    "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    [TransformStamped<'_>]
);
