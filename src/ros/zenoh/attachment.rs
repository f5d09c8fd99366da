//! Attachment that `rmw_zenoh_cpp` sends with every message, request and response.

use zenoh::bytes::ZBytes;
use zenoh_ext::{z_deserialize, z_serialize};

use crate::ros::transport::Fault;

/// First field of attachments before 0.2.5, which contain field names: 77 bytes.
const OLD_START: &[u8] = b"\x0fsequence_number";

/// Sequence number, time and sender.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Attachment {
    /// Sequence number of the sender, from 1.
    pub(super) sequence: i64,
    /// Time of sending by the sender's clock, nanoseconds since the epoch.
    pub(super) source_time_ns: i64,
    /// Identity of the sending endpoint.
    pub(super) sender: [u8; 16],
}

impl Attachment {
    /// Returns 33 bytes: two little-endian numbers, the length 16 and the identity.
    pub(super) fn to_bytes(self) -> ZBytes {
        z_serialize(&(self.sequence, self.source_time_ns, self.sender))
    }

    /// # Errors
    /// The attachment is missing, has the format before 0.2.5 or an unknown one; the fault states the remedy.
    pub(super) fn parse(attachment: Option<&ZBytes>) -> Result<Self, Fault> {
        let Some(bytes) = attachment else {
            return Err(foreign(
                "has no attachment: its sender is not a ROS 2 node on rmw_zenoh_cpp",
            ));
        };
        if let Ok((sequence, source_time_ns, sender)) = z_deserialize(bytes) {
            return Ok(Self { sequence, source_time_ns, sender });
        }
        if bytes.to_bytes().starts_with(OLD_START) {
            return Err(foreign(
                "has the attachment of rmw_zenoh_cpp before 0.2.5: update the ROS packages of its sender",
            ));
        }
        let length = bytes.len();
        Err(foreign(&format!(
            "has an attachment of {length} bytes that rmw_zenoh_cpp 0.2.5 and later do not send"
        )))
    }
}

fn foreign(what: &str) -> Fault {
    Fault::Foreign(format!("a Zenoh message {what}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SENDER: [u8; 16] = *b"0123456789abcdef";

    #[test]
    fn bytes_are_those_of_rmw_zenoh() {
        let attachment = Attachment { sequence: 258, source_time_ns: -2, sender: SENDER };
        let mut expected = vec![2, 1, 0, 0, 0, 0, 0, 0];
        expected.extend([0xfe, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x10]);
        expected.extend(SENDER);
        assert_eq!(attachment.to_bytes().to_bytes(), expected);
        assert_eq!(Attachment::parse(Some(&attachment.to_bytes())), Ok(attachment));
    }

    fn rejection(bytes: &[u8]) -> String {
        Attachment::parse(Some(&bytes.into())).unwrap_err().to_string()
    }

    #[test]
    fn the_old_format_is_named() {
        let mut old = OLD_START.to_vec();
        old.extend(1_i64.to_le_bytes());
        old.extend(b"\x10source_timestamp");
        old.extend(2_i64.to_le_bytes());
        old.extend(b"\x0asource_gid\x10");
        old.extend(SENDER);
        assert_eq!(old.len(), 77);
        assert!(rejection(&old).contains("before 0.2.5: update"), "{}", rejection(&old));
    }

    #[test]
    fn other_attachments_are_rejected() {
        let none = Attachment::parse(None).unwrap_err().to_string();
        assert!(none.contains("no attachment"), "{none}");
        let good = Attachment { sequence: 1, source_time_ns: 2, sender: SENDER }.to_bytes();
        let good = good.to_bytes().into_owned();
        let longer = [&good[..], &[0]].concat();
        let mut wrong_length = good.clone();
        wrong_length[16] = 15;
        for bytes in [&[][..], &good[..32], &longer, &wrong_length, &[0xff; 33]] {
            assert!(rejection(bytes).contains("do not send"), "{bytes:?}");
        }
    }
}
