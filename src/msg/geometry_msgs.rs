//! `geometry_msgs`: poses of coordinate frames.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::{schema::message, std_msgs::Header, text};

/// A vector.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names are self-explanatory")]
pub struct Vector3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// A rotation as a unit quaternion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names are self-explanatory")]
pub struct Quaternion {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub w: f64,
}

impl Default for Quaternion {
    /// No rotation.
    fn default() -> Self {
        Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
    }
}

/// A pose that maps points of the child frame to the parent frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Transform {
    /// Origin of the child in the parent, metres.
    pub translation: Vector3,
    /// Axes of the child in the parent.
    pub rotation: Quaternion,
}

/// Pose of one coordinate frame in another at one time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformStamped<'a> {
    /// Time and parent frame.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Child frame.
    #[serde(borrow, with = "text")]
    pub child_frame_id: Cow<'a, str>,
    /// Pose of the child in the parent.
    pub transform: Transform,
}

message!(
    Vector3,
    "geometry_msgs/msg/Vector3",
    include_str!("definitions/geometry_msgs/Vector3.msg"),
    "RIHS01_cc12fe83e4c02719f1ce8070bfd14aecd40f75a96696a67a2a1f37f7dbb0765d",
    []
);
message!(
    Quaternion,
    "geometry_msgs/msg/Quaternion",
    include_str!("definitions/geometry_msgs/Quaternion.msg"),
    "RIHS01_8a765f66778c8ff7c8ab94afcc590a2ed5325a1d9a076ffff38fbce36f458684",
    []
);
message!(
    Transform,
    "geometry_msgs/msg/Transform",
    include_str!("definitions/geometry_msgs/Transform.msg"),
    "RIHS01_beb83fbe698636351461f6f35d1abb20010c43d55374d81bd041f1ba2581fddc",
    [Vector3, Quaternion]
);
message!(
    TransformStamped<'_>,
    "geometry_msgs/msg/TransformStamped",
    include_str!("definitions/geometry_msgs/TransformStamped.msg"),
    "RIHS01_0a241f87d04668d94099cbb5ba11691d5ad32c2f29682e4eb5653424bd275206",
    [Header<'_>, Transform]
);
