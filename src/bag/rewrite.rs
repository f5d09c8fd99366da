//! Topics whose messages are rewritten as messages of ROS 2.

use super::{Topic, foxglove_image, ros1};
use crate::msg::{qos::QosProfile, schema::MessageType};

/// How the messages of a topic are rewritten.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rewrite {
    /// From ROS 1, with these fields.
    Ros1(ros1::Fields),
    /// From Foxglove's Protobuf.
    Foxglove(foxglove_image::Kind),
}

impl Rewrite {
    /// Makes a topic of another system the topic of ROS 2 that its messages become. `None` for a topic of ROS 2 and for
    /// types that are not read, which stay as they are.
    pub(super) fn adopt(topic: &mut Topic) -> Option<Self> {
        let (kind, rewrite): (&MessageType, _) = match topic.message_encoding.as_str() {
            ros1::ENCODING => {
                let (kind, fields) = ros1::type_of(&topic.type_name)?;
                (kind, Self::Ros1(fields))
            }
            foxglove_image::ENCODING => {
                let kind = foxglove_image::Kind::of(&topic.type_name)?;
                (kind.becomes(), Self::Foxglove(kind))
            }
            _ => return None,
        };
        let name = std::mem::take(&mut topic.name);
        *topic = Topic::new(name, kind, QosProfile::reliable(10));
        Some(rewrite)
    }

    /// Rewrites a message as CDR into `out`.
    ///
    /// # Errors
    /// The message does not have the fields of its type.
    pub(super) fn to_cdr(self, message: &[u8], out: &mut Vec<u8>) -> Result<(), String> {
        match self {
            Self::Ros1(fields) => ros1::to_cdr(message, fields, out),
            Self::Foxglove(kind) => kind.to_cdr(message, out),
        }
    }
}
