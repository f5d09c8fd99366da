//! Topics whose messages are rewritten as messages of ROS 2.

use super::{RawMessage, Topic, foxglove_image, foxglove_ros, ros1};
use crate::msg::{qos::QosProfile, schema::MessageType};

/// Depth of the queue in the quality of service of a topic that states none.
const DEPTH: u64 = 10;

/// How the messages of a topic are rewritten.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rewrite {
    /// From ROS 1, with these fields.
    Ros1(ros1::Fields),
    /// From Foxglove's Protobuf.
    Foxglove(foxglove_image::Kind),
    /// From Foxglove's types in ROS 2.
    FoxgloveRos(foxglove_image::Kind),
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
            foxglove_ros::ENCODING => {
                let kind = foxglove_ros::kind_of(&topic.type_name)?;
                (kind.becomes(), Self::FoxgloveRos(kind))
            }
            _ => return None,
        };
        let adopted =
            Topic::new(std::mem::take(&mut topic.name), kind, QosProfile::reliable(DEPTH));
        let stated = std::mem::take(&mut topic.qos);
        let qos = if stated.is_empty() { adopted.qos } else { stated };
        *topic = Topic { qos, ..adopted };
        Some(rewrite)
    }

    /// The system that the messages come from.
    pub(super) const fn origin(self) -> &'static str {
        match self {
            Self::Ros1(_) => "ROS 1",
            Self::Foxglove(_) => "Foxglove (Protobuf)",
            Self::FoxgloveRos(_) => "foxglove_msgs",
        }
    }

    /// True if the messages are CDR before they are rewritten, too.
    pub(super) const fn is_of_cdr(self) -> bool {
        matches!(self, Self::FoxgloveRos(_))
    }

    /// Rewrites a message as CDR in place; `spare` is where its old buffer goes.
    ///
    /// # Errors
    /// The message does not have the fields of its type; the text names its topic.
    pub(super) fn apply(
        self,
        message: &mut RawMessage,
        spare: &mut Vec<Vec<u8>>,
    ) -> Result<(), String> {
        let mut data = spare.pop().unwrap_or_default();
        let rewritten = match self {
            Self::Ros1(fields) => ros1::to_cdr(&message.data, fields, &mut data),
            Self::Foxglove(kind) => kind.to_cdr(&message.data, &mut data),
            Self::FoxgloveRos(kind) => foxglove_ros::to_cdr(kind, &message.data, &mut data),
        };
        rewritten.map_err(|what| format!("{}: {what}", message.topic.name))?;
        spare.push(std::mem::replace(&mut message.data, data));
        Ok(())
    }
}
