//! The RTPS messages that this node writes itself, because RustDDS does not write them as needed (OMG RTPS 2.5): a reply
//! as `DATA_FRAG`, the `HEARTBEAT` in front of a reply, and the `ACKNACK` that asks a new client for its first request.
//!
//! All numbers are little endian, which the flags of each submessage say (9.4.5.1.2).

use rustdds::{GUID, SequenceNumber, bytes::Bytes, rpc::SampleIdentity};

use super::raw::HEADER_BYTES;

/// Payload bytes per fragment (`fragmentSize`). With everything around it a fragment takes 1184 bytes of an IPv4
/// packet, so that it is not cut on links with an MTU of 1280 bytes, as in tunnels.
pub(super) const FRAGMENT_BYTES: usize = 1024;
/// A GUID is a prefix, which the participant's endpoints share, and an entity (9.3.1).
const PREFIX_BYTES: usize = 12;
/// Protocol version and vendor of RustDDS, as in its own messages (9.4.4).
const VERSION: [u8; 2] = [2, 4];
const VENDOR: [u8; 2] = [0x01, 0x12];
/// `submessageId` (9.4.5.1.1).
const ACKNACK: u8 = 0x06;
const HEARTBEAT: u8 = 0x07;
const INFO_DST: u8 = 0x0e;
const DATA_FRAG: u8 = 0x16;
/// Flags `E`, little endian, and `Q`, inline QoS follows (9.4.5.1.2, 9.4.5.5.1).
const FLAG_E: u8 = 0x01;
const FLAG_Q: u8 = 0x02;
/// Bytes of a `DATA_FRAG` in front of its inline QoS (9.4.5.5): from behind the submessage's header, and from behind
/// `octetsToInlineQos`.
const FIXED_BYTES: usize = 32;
const TO_INLINE_QOS_BYTES: u16 = 28;
/// `PID_RELATED_SAMPLE_IDENTITY` (RPC over DDS 1.0, 7.8.2), and the number that Fast DDS used before the standard had one.
const RELATED_SAMPLE_IDENTITY: [u16; 2] = [0x0083, 0x800f];
/// `PID_SENTINEL` ends a parameter list (9.4.2.11).
const SENTINEL: u16 = 0x0001;
/// A GUID and a sequence number.
const IDENTITY_BYTES: u16 = 24;
const INLINE_QOS_BYTES: usize = RELATED_SAMPLE_IDENTITY.len() * (4 + IDENTITY_BYTES as usize) + 4;
/// Header of little-endian CDR, in front of the body in the payload (10.2).
const CDR_LE: [u8; HEADER_BYTES] = [0, 1, 0, 0];

/// A reply that its writer has already numbered.
#[derive(Clone, Debug)]
pub(super) struct Reply {
    /// The writer, and the number it gave to the reply.
    pub(super) sample: SampleIdentity,
    /// The request, as the client identifies it.
    pub(super) related: SampleIdentity,
    /// CDR without its header.
    pub(super) body: Bytes,
}

impl Reply {
    /// Length of the payload, bytes: the body and its header.
    pub(super) fn payload_bytes(&self) -> usize {
        HEADER_BYTES + self.body.len()
    }

    /// Number of fragments (8.3.8.3.5); `None` if the standard's 32 bits cannot express the length.
    pub(super) fn num_fragments(&self) -> Option<u32> {
        let payload_bytes = u32::try_from(self.payload_bytes()).ok()?;
        Some(payload_bytes.div_ceil(FRAGMENT_BYTES as u32))
    }

    /// Replaces `message` by the one that brings fragment `number`, counted from 1, to a reader.
    pub(super) fn encode(&self, number: u32, reader: GUID, message: &mut Vec<u8>) {
        let (reader, writer) = (reader.to_bytes(), self.sample.writer_guid.to_bytes());
        let (reader_prefix, reader_entity) = reader.split_at(PREFIX_BYTES);
        let (writer_prefix, writer_entity) = writer.split_at(PREFIX_BYTES);
        let fragment = self.fragment(number);
        message.clear();
        head(message, writer_prefix, reader_prefix);
        // The last submessage need not be a multiple of four bytes (9.4.5.1.3).
        let length_bytes = FIXED_BYTES + INLINE_QOS_BYTES + fragment.len();
        submessage(message, [DATA_FRAG, FLAG_E | FLAG_Q], length_bytes);
        message.extend([0; 2]);
        message.extend(TO_INLINE_QOS_BYTES.to_le_bytes());
        message.extend(reader_entity);
        message.extend(writer_entity);
        sequence_number(message, self.sample.sequence_number);
        message.extend(number.to_le_bytes());
        message.extend(1_u16.to_le_bytes());
        message.extend((FRAGMENT_BYTES as u16).to_le_bytes());
        message.extend((self.payload_bytes() as u32).to_le_bytes());
        self.inline_qos(message);
        message.extend(fragment);
    }

    /// A parameter list (9.4.2.11).
    fn inline_qos(&self, message: &mut Vec<u8>) {
        for parameter in RELATED_SAMPLE_IDENTITY {
            message.extend(parameter.to_le_bytes());
            message.extend(IDENTITY_BYTES.to_le_bytes());
            message.extend(self.related.writer_guid.to_bytes());
            sequence_number(message, self.related.sequence_number);
        }
        message.extend(SENTINEL.to_le_bytes());
        message.extend([0; 2]);
    }

    /// Returns the payload's bytes of a fragment; none behind the last.
    fn fragment(&self, number: u32) -> impl ExactSizeIterator<Item = u8> {
        let from = (number as usize).saturating_sub(1).saturating_mul(FRAGMENT_BYTES);
        let until = from.saturating_add(FRAGMENT_BYTES).min(self.payload_bytes());
        (from..until).map(|at| match at.checked_sub(HEADER_BYTES) {
            None => CDR_LE[at],
            Some(at) => self.body[at],
        })
    }
}

/// Returns a `HEARTBEAT` (9.4.5.7) that tells `reader` the writer and number of the last sample so far, and asks which
/// it has.
pub(super) fn heartbeat(last: &SampleIdentity, reader: GUID) -> Vec<u8> {
    let (reader, writer) = (reader.to_bytes(), last.writer_guid.to_bytes());
    let (reader_prefix, reader_entity) = reader.split_at(PREFIX_BYTES);
    let (writer_prefix, writer_entity) = writer.split_at(PREFIX_BYTES);
    let mut message = Vec::new();
    head(&mut message, writer_prefix, reader_prefix);
    submessage(&mut message, [HEARTBEAT, FLAG_E], 28);
    message.extend(reader_entity);
    message.extend(writer_entity);
    sequence_number(&mut message, SequenceNumber::new(1));
    sequence_number(&mut message, last.sequence_number);
    // RustDDS counts from 1: readers that have one of its heartbeats ignore this one.
    message.extend(0_u32.to_le_bytes());
    message
}

/// Returns an `ACKNACK` (9.4.5.3) by which `reader` asks a writer for its first sample.
pub(super) fn ask_for_first(reader: GUID, writer: GUID) -> Vec<u8> {
    let (reader, writer) = (reader.to_bytes(), writer.to_bytes());
    let (reader_prefix, reader_entity) = reader.split_at(PREFIX_BYTES);
    let (writer_prefix, writer_entity) = writer.split_at(PREFIX_BYTES);
    let mut message = Vec::new();
    head(&mut message, reader_prefix, writer_prefix);
    submessage(&mut message, [ACKNACK, FLAG_E], 28);
    message.extend(reader_entity);
    message.extend(writer_entity);
    // The missing ones (9.4.2.6): from number 1 on, one bit, which is set.
    message.extend([0, 0, 0, 0, 1, 0, 0, 0]);
    message.extend(1_u32.to_le_bytes());
    message.extend((1_u32 << 31).to_le_bytes());
    // RustDDS has sent number 0; Fast DDS counts from 1.
    message.extend(1_u32.to_le_bytes());
    message
}

/// Appends what every message begins with.
fn head(message: &mut Vec<u8>, sender_prefix: &[u8], receiver_prefix: &[u8]) {
    // Header (9.4.4).
    message.extend(b"RTPS");
    message.extend(VERSION);
    message.extend(VENDOR);
    message.extend(sender_prefix);
    // INFO_DST (9.4.5.9): no other participant may take this message.
    submessage(message, [INFO_DST, FLAG_E], PREFIX_BYTES);
    message.extend(receiver_prefix);
}

/// Appends a submessage's header (9.4.5.1).
fn submessage(message: &mut Vec<u8>, id_and_flags: [u8; 2], length_bytes: usize) {
    message.extend(id_and_flags);
    message.extend((length_bytes as u16).to_le_bytes());
}

/// Appends a sequence number: its upper half first (9.4.2.5).
fn sequence_number(message: &mut Vec<u8>, number: SequenceNumber) {
    let number = i64::from(number);
    message.extend(((number >> 32) as i32).to_le_bytes());
    message.extend((number as u32).to_le_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    fn identity(byte: u8, sequence: i64) -> SampleIdentity {
        let mut guid = [byte; 16];
        guid[15] = 0x03;
        let sequence_number = SequenceNumber::new(sequence);
        SampleIdentity { writer_guid: GUID::from_bytes(guid), sequence_number }
    }

    fn reply(num_body_bytes: usize) -> Reply {
        Reply {
            sample: identity(0xaa, 0x0000_0002_0000_0007),
            related: identity(0xbb, 9),
            body: (0..num_body_bytes).map(|at| at as u8).collect(),
        }
    }

    fn message(reply: &Reply, number: u32) -> Vec<u8> {
        let mut message = vec![0xff; 9];
        reply.encode(number, identity(0xcc, 1).writer_guid, &mut message);
        message
    }

    /// The layout of the standard's tables, field by field.
    #[test]
    fn a_fragment_has_the_standards_layout() {
        let reply = reply(2000);
        let identity = |number: [u8; 2]| {
            [&number[..], &[24, 0], &[0xbb; 15], &[3], &[0, 0, 0, 0, 9, 0, 0, 0]].concat()
        };
        let head = |length: [u8; 2], number: u8| {
            [
                &b"RTPS"[..],
                &[2, 4],
                &[0x01, 0x12],
                &[0xaa; 12],
                // INFO_DST, little endian, 12 bytes: the reader's participant.
                &[0x0e, 0x01, 12, 0],
                &[0xcc; 12],
                // DATA_FRAG, little endian with inline QoS.
                &[0x16, 0x03],
                &length,
                &[0, 0],
                &[28, 0],
                &[0xcc, 0xcc, 0xcc, 0x03],
                &[0xaa, 0xaa, 0xaa, 0x03],
                &[2, 0, 0, 0, 7, 0, 0, 0],
                &[number, 0, 0, 0],
                &[1, 0],
                &[0x00, 0x04],
                &[0xd4, 0x07, 0, 0],
                &identity([0x83, 0x00]),
                &identity([0x0f, 0x80]),
                &[1, 0, 0, 0],
            ]
            .concat()
        };
        // 32 + 60 + 1024 bytes, then the 980 that are left.
        let first = [&head([0x5c, 0x04], 1)[..], &[0, 1, 0, 0], &reply.body[..1020]].concat();
        assert_eq!(message(&reply, 1), first);
        let second = [&head([0x30, 0x04], 2)[..], &reply.body[1020..]].concat();
        assert_eq!(message(&reply, 2), second);
        assert_eq!(first.len() + 28, 1184, "the packet that the fragment's length promises");
    }

    #[test]
    fn a_first_sample_is_asked_for_in_the_standards_layout() {
        let expected = [
            &b"RTPS"[..],
            &[2, 4],
            &[0x01, 0x12],
            &[0xaa; 12],
            &[0x0e, 0x01, 12, 0],
            &[0xbb; 12],
            &[0x06, 0x01, 28, 0],
            &[0xaa, 0xaa, 0xaa, 0x03],
            &[0xbb, 0xbb, 0xbb, 0x03],
            &[0, 0, 0, 0, 1, 0, 0, 0],
            &[1, 0, 0, 0],
            &[0, 0, 0, 0x80],
            &[1, 0, 0, 0],
        ];
        let [reader, writer] = [0xaa, 0xbb].map(|byte| identity(byte, 1).writer_guid);
        assert_eq!(ask_for_first(reader, writer), expected.concat());
    }

    #[test]
    fn the_last_sample_is_told_in_the_standards_layout() {
        let expected = [
            &b"RTPS"[..],
            &[2, 4],
            &[0x01, 0x12],
            &[0xaa; 12],
            &[0x0e, 0x01, 12, 0],
            &[0xbb; 12],
            // HEARTBEAT, little endian, not final: to be answered.
            &[0x07, 0x01, 28, 0],
            &[0xbb, 0xbb, 0xbb, 0x03],
            &[0xaa, 0xaa, 0xaa, 0x03],
            &[0, 0, 0, 0, 1, 0, 0, 0],
            &[2, 0, 0, 0, 7, 0, 0, 0],
            &[0, 0, 0, 0],
        ];
        let last = identity(0xaa, 0x0000_0002_0000_0007);
        assert_eq!(heartbeat(&last, identity(0xbb, 1).writer_guid), expected.concat());
    }

    #[test]
    fn the_fragments_are_the_whole_payload_whatever_its_length() {
        for num_body_bytes in [0, 1, 1019, 1020, 1021, 2043, 2044, 2045, 5001] {
            let reply = reply(num_body_bytes);
            let around = message(&reply, u32::MAX).len();
            let num_fragments = reply.num_fragments().unwrap();
            let payload: Vec<u8> = (1..=num_fragments)
                .flat_map(|number| message(&reply, number).split_off(around))
                .collect();
            assert_eq!(payload, [&CDR_LE[..], &reply.body].concat());
            assert!(message(&reply, num_fragments).len() > around, "none is empty");
        }
    }
}
