//! Recordings: rosbag2 directories and bare MCAP files, read and written. Edge: does I/O.

use std::sync::Arc;

/// A topic of a recording, and all that a reader needs to understand it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Fully resolved name, as in `/camera/image_raw`.
    pub name: String,
    /// Full type name, as in `sensor_msgs/msg/Image`.
    pub type_name: String,
    /// Encoding of the messages: `cdr`.
    pub message_encoding: String,
    /// Encoding of the schema: `ros2msg`.
    pub schema_encoding: String,
    /// The schema.
    pub schema: Vec<u8>,
    /// `RIHS01_…`, empty where the recording states none.
    pub type_hash: String,
    /// `offered_qos_profiles` as YAML, empty where the recording states none.
    pub qos: String,
}

/// One stored message.
#[derive(Clone, Debug)]
pub struct RawMessage {
    /// Where it belongs.
    pub topic: Arc<Topic>,
    /// When it was received, nanoseconds since the epoch.
    pub log_time_ns: i64,
    /// When it was sent, nanoseconds since the epoch.
    pub publish_time_ns: i64,
    /// The writer's counter; 0 where it does not count.
    pub sequence: u32,
    /// CDR bytes with their header.
    pub data: Vec<u8>,
}
