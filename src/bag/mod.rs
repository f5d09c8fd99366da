//! Recordings: rosbag2 directories and bare MCAP files, read and written; pictures and videos, read as recordings. Edge: does I/O.
//!
//! Files are not trusted. Every length is checked against the file size and a limit before memory is allocated, and
//! every chunk against its checksum before its messages are returned. Damage is reported and skipped.

pub(crate) mod error;
mod qos;
pub(crate) mod metadata;
mod kind;
mod convert;
mod find;
pub(crate) mod place;
mod unpack;
mod format;
mod open;
mod fields;
mod type_name;
mod ros1;
mod foxglove_image;
mod foxglove_ros;
mod rewrite;
mod channels;
mod chunk;
mod inflate;
mod plain;
mod take;
mod content;
mod summary;
mod scan;
mod layout;
mod waiting;
pub(crate) mod messages;
pub(crate) mod pictures;
pub(crate) mod read;
mod sink;
pub(crate) mod record;
pub(crate) mod split;
mod damaged;
pub(crate) mod recover;
pub(crate) mod import;
pub(crate) mod statistics;
pub(crate) mod images;
pub(crate) mod info;
pub(crate) mod player;

use std::sync::Arc;

use crate::msg::{
    qos::{Durability, QosProfile},
    schema::MessageType,
};

pub(crate) use error::{BagError, RecordError};
pub(crate) use messages::Messages;
pub use pictures::{PictureError, PictureOptions};
pub use read::{BagReader, ReadOptions};
pub use record::{Compression, RecordOptions, RecordSummary, Recorder, Times, TopicId};
pub(crate) use split::{SplitLimits, SplitRecorder};
pub use take::Filter;

/// A topic of a recording, with everything needed to decode its messages.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Topic {
    /// Fully resolved name, for example `/camera/image_raw`.
    pub name: String,
    /// Full type name, for example `sensor_msgs/msg/Image`.
    pub type_name: String,
    /// Encoding of the messages; `cdr` in ROS 2.
    pub message_encoding: String,
    /// Encoding of the schema; usually `ros2msg`.
    pub schema_encoding: String,
    /// Content of the schema.
    pub schema: Vec<u8>,
    /// Type hash (`RIHS01_…`); empty if the recording states none.
    pub type_hash: String,
    /// `offered_qos_profiles`, a YAML list of profiles; empty if the recording states none.
    pub qos: String,
}

impl Topic {
    /// Returns a topic for one of this crate's message types, encoded as CDR.
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

    /// True if late subscribers receive the last message (transient local durability in ROS 2).
    pub(crate) fn is_latched(&self) -> bool {
        let profiles = qos::parse(&self.qos).unwrap_or_default();
        profiles.iter().any(|profile| profile.durability == Durability::TransientLocal)
    }

    /// Checks that the messages are CDR, the encoding of ROS 2.
    ///
    /// # Errors
    /// The messages are not CDR, for example in a ROS 1 recording.
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
    /// Topic of the message.
    pub topic: Arc<Topic>,
    /// Time of reception, nanoseconds since the epoch.
    pub log_time_ns: i64,
    /// Time of publication, nanoseconds since the epoch.
    pub publish_time_ns: i64,
    /// Sequence number of the writer; 0 if it does not count.
    pub sequence: u32,
    /// CDR bytes with their header.
    pub data: Vec<u8>,
    /// Name of the picture file that the message was made of, if any.
    pub file: Option<Arc<str>>,
}

/// A file inside the recording, for example `calibration.yaml`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Attachment {
    /// File name.
    pub name: String,
    /// MIME type, for example `application/yaml`.
    pub media_type: String,
    /// Time of recording, nanoseconds since the epoch. The caller supplies it, so that equal input gives equal bytes.
    pub log_time_ns: i64,
    /// Time of creation, nanoseconds since the epoch; 0 if unknown.
    pub create_time_ns: i64,
    /// Content.
    pub data: Vec<u8>,
}

/// Named key-value pairs inside the recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MetadataRecord {
    /// Name of the record, for example `laser_profiler`.
    pub name: String,
    /// Keys and values.
    pub entries: std::collections::BTreeMap<String, String>,
}

#[cfg(test)]
mod tests;
