//! Definitions and type hashes of the messages: definitions make files self-describing, hashes let peers match types.

use serde::Serialize;

/// A ROS 2 message type.
#[derive(Debug)]
pub struct MessageType {
    /// Full name, such as `sensor_msgs/msg/Image`.
    pub name: &'static str,
    /// Fields and constants in the `.msg` language.
    pub(crate) text: &'static str,
    /// Types of the fields that are messages themselves; direct dependencies only.
    pub(crate) dependencies: &'static [&'static Self],
    /// `RIHS01_` and 64 hexadecimal digits (REP-2016).
    pub hash: &'static str,
}

impl MessageType {
    /// Returns the schema in MCAP's `ros2msg` format: the text, then every dependency once after a line of 80 `=`.
    ///
    /// Dependencies are in rosbag2's order: depth first, sorted by name within a message.
    pub fn schema(&self) -> String {
        let mut schema = self.text.to_owned();
        self.append_dependencies(&mut Vec::new(), &mut schema);
        schema
    }

    fn append_dependencies(&self, seen: &mut Vec<&'static str>, schema: &mut String) {
        let mut dependencies = self.dependencies.to_vec();
        dependencies.sort_by_key(|dependency| dependency.name);
        for dependency in dependencies {
            if seen.contains(&dependency.name) {
                continue;
            }
            seen.push(dependency.name);
            schema.push('\n');
            schema.push_str(&"=".repeat(80));
            schema.push_str("\nMSG: ");
            schema.push_str(&dependency.name.replace("/msg/", "/"));
            schema.push('\n');
            schema.push_str(dependency.text);
            dependency.append_dependencies(seen, schema);
        }
    }
}

/// A struct that represents a ROS message: its fields are those of the type's text, in the same order.
pub trait Message: Serialize {
    /// Type of the message.
    const TYPE: &'static MessageType;
}

/// A ROS 2 service type.
#[derive(Debug)]
pub struct ServiceType {
    /// Full name, such as `std_srvs/srv/Trigger`.
    pub name: &'static str,
    /// Request and response in the `.srv` language, as in the type's description.
    pub text: &'static str,
    /// `RIHS01_` and 64 hexadecimal digits of the whole service (REP-2016).
    pub hash: &'static str,
}

/// Returns the request part of a service's text.
pub(super) const fn request_text(service: &'static str) -> &'static str {
    service.split_at(separator(service)).0
}

/// Returns the response part of a service's text.
pub(super) const fn response_text(service: &'static str) -> &'static str {
    service.split_at(separator(service) + SEPARATOR.len()).1
}

const SEPARATOR: &[u8] = b"---\n";

/// Returns the offset of the line that separates request from response. A text without one does not compile.
const fn separator(service: &str) -> usize {
    let text = service.as_bytes();
    let mut start = 0;
    loop {
        if text[start] == SEPARATOR[0] && text[start + 1] == SEPARATOR[1] {
            return start;
        }
        while text[start] != b'\n' {
            start += 1;
        }
        start += 1;
    }
}

/// Implements [`Message`] for a struct: name, text, hash and the messages among its fields.
macro_rules! message {
    ($message:ty, $name:literal, $text:expr, $hash:literal, [$($dependency:ty),*]) => {
        impl $crate::msg::schema::Message for $message {
            const TYPE: &'static $crate::msg::schema::MessageType = &$crate::msg::schema::MessageType {
                name: $name,
                text: $text,
                dependencies: &[$(<$dependency as $crate::msg::schema::Message>::TYPE),*],
                hash: $hash,
            };
        }
    };
}
pub(super) use message;

#[cfg(test)]
mod tests;
