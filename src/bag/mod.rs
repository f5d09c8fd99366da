//! Recordings: rosbag2 directories and bare MCAP files, read and written. Edge: does I/O.
//!
//! Nothing in a file is trusted: every length is checked against the file and against a limit before memory is
//! taken, every chunk against its checksum before a message leaves it. What is damaged is reported and passed over.

pub(crate) mod error;
mod qos;
pub(crate) mod metadata;
pub(crate) mod place;
mod format;
mod fields;
mod channels;
mod chunk;
mod plain;
mod take;
mod content;
mod summary;
mod scan;
mod layout;
pub(crate) mod messages;
pub(crate) mod read;
mod sink;
pub(crate) mod record;
pub(crate) mod split;
pub(crate) mod recover;
pub(crate) mod statistics;
pub(crate) mod info;
pub(crate) mod player;

use std::sync::Arc;

use crate::msg::{
    qos::{Durability, QosProfile},
    schema::MessageType,
};

pub(crate) use error::{BagError, RecordError};
pub(crate) use messages::Messages;
pub use read::{BagReader, ReadOptions};
pub use record::{Compression, RecordOptions, RecordSummary, Recorder, Times, TopicId};
pub(crate) use split::{SplitLimits, SplitRecorder};
pub use take::Filter;

/// A topic of a recording, with everything needed to decode its messages.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
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
    /// `offered_qos_profiles` as a YAML list of profiles, empty where the recording states none.
    pub qos: String,
}

impl Topic {
    /// A topic of our own messages of that type.
    pub fn new(name: impl Into<String>, kind: &MessageType, qos: QosProfile) -> Self {
        Self {
            name: name.into(),
            type_name: kind.name.to_owned(),
            message_encoding: "cdr".to_owned(),
            schema_encoding: "ros2msg".to_owned(),
            schema: kind.schema().into_bytes(),
            type_hash: kind.hash.to_owned(),
            qos: qos::to_yaml(&[qos]),
        }
    }

    /// True if late subscribers get the last message (ROS 2: transient local).
    pub(crate) fn is_latched(&self) -> bool {
        let profiles = qos::parse(&self.qos).unwrap_or_default();
        profiles.iter().any(|profile| profile.durability == Durability::TransientLocal)
    }

    /// Checks that the messages are CDR, as ROS 2 writes them.
    ///
    /// # Errors
    /// Messages that are not CDR, as in recordings of ROS 1.
    pub(crate) fn require_cdr(&self) -> Result<(), BagError> {
        if self.message_encoding == "cdr" {
            return Ok(());
        }
        Err(BagError::Encoding {
            topic: self.name.clone(),
            encoding: self.message_encoding.clone(),
        })
    }
}

/// One stored message.
#[derive(Clone, Debug, PartialEq, Eq)]
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

/// A file inside the recording, as in `calibration.yaml`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// File name.
    pub name: String,
    /// MIME type, as in `application/yaml`.
    pub media_type: String,
    /// When it was recorded, nanoseconds since the epoch; an argument, so that the same input gives the same bytes.
    pub log_time_ns: i64,
    /// When it was made, nanoseconds since the epoch; 0 where unknown.
    pub create_time_ns: i64,
    /// Content.
    pub data: Vec<u8>,
}

/// Named text pairs inside the recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MetadataRecord {
    /// Name of the record, as in `laser_profiler`.
    pub name: String,
    /// Keys and values.
    pub entries: std::collections::BTreeMap<String, String>,
}

#[cfg(test)]
mod tests;
