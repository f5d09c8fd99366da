//! Texts and type hashes of the messages, so that files explain themselves and peers recognise our types.

use serde::Serialize;

/// A ROS 2 message type.
#[derive(Debug)]
pub struct MessageType {
    /// Full name, as in `sensor_msgs/msg/Image`.
    pub name: &'static str,
    /// Fields and constants in the `.msg` language.
    pub text: &'static str,
    /// Types of the fields that are messages themselves, direct ones only.
    pub dependencies: &'static [&'static Self],
    /// `RIHS01_` and 64 hexadecimal digits (REP-2016).
    pub hash: &'static str,
}

impl MessageType {
    /// The schema as MCAP's `ros2msg` wants it: the text, then every dependency once behind a rule of 80 `=`.
    pub fn schema(&self) -> String {
        todo!()
    }
}

/// A struct that is a ROS message.
pub trait Message: Serialize {
    /// Its type.
    const TYPE: &'static MessageType;
}
