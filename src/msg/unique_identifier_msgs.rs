//! `unique_identifier_msgs`: identities of scans and sessions.

use serde::{Deserialize, Serialize};

use super::schema::message;

/// A universally unique identifier (RFC 9562).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Uuid {
    /// Bytes, most significant first.
    pub(crate) uuid: [u8; 16],
}

message!(
    Uuid,
    "unique_identifier_msgs/msg/UUID",
    include_str!("definitions/unique_identifier_msgs/UUID.msg"),
    "RIHS01_1b8e8aca958cbea28fe6ef60bf6c19b683c97a9ef60bb34752067d0f2f7ab437",
    []
);
