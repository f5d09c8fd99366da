//! Identification of a request's client, in the two mappings that implementations of DDS in ROS use.

use rustdds::{GUID, SequenceNumber, rpc::SampleIdentity};

use super::raw::HEADER_BYTES;
use crate::ros::node_params::ServiceMapping;

/// Length of the header of Cyclone's mapping, in front of request and reply: client and sequence number, eight bytes
/// each.
const CYCLONE_BYTES: usize = 16;
/// Vendor at the start of a Cyclone participant's GUID.
const CYCLONE_VENDOR: [u8; 2] = [0x01, 0x10];

/// Metadata of a request.
#[derive(Clone, Copy, Debug)]
pub(super) struct Envelope {
    /// Writer and sequence number.
    pub(super) sample: SampleIdentity,
    /// Related identity stated by the writer, as in Fast DDS.
    pub(super) related: Option<SampleIdentity>,
}

/// Recipient of a reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Caller {
    /// Identified in the metadata of the reply.
    Enhanced(SampleIdentity),
    /// Identified in a header in front of the reply, little endian.
    Cyclone([u8; CYCLONE_BYTES]),
}

/// Splits a request into caller and message; `None` if it is too short. The message keeps its CDR header.
pub(super) fn open(
    mut request: Vec<u8>,
    envelope: Envelope,
    mapping: ServiceMapping,
) -> Option<(Caller, Vec<u8>)> {
    let is_cyclone = match mapping {
        ServiceMapping::Enhanced => false,
        ServiceMapping::Cyclone => true,
        ServiceMapping::Auto => {
            let vendor = &envelope.sample.writer_guid.to_bytes()[..2];
            envelope.related.is_none() && vendor == CYCLONE_VENDOR
        }
    };
    if !is_cyclone {
        return Some((Caller::Enhanced(enhanced(envelope)), request));
    }
    let is_big_endian = request.get(1) == Some(&0);
    let header = request.get(HEADER_BYTES..HEADER_BYTES + CYCLONE_BYTES)?;
    let mut caller: [u8; CYCLONE_BYTES] = header.try_into().ok()?;
    if is_big_endian {
        // Swaps two numbers of eight bytes, because replies are little endian.
        caller[..8].reverse();
        caller[8..].reverse();
    }
    request.drain(HEADER_BYTES..HEADER_BYTES + CYCLONE_BYTES);
    Some((Caller::Cyclone(caller), request))
}

/// Returns the identity for the reply. Fast DDS states the reader of the reply without a sequence number; others state
/// nothing.
fn enhanced(Envelope { sample, related }: Envelope) -> SampleIdentity {
    let related = related.unwrap_or(sample);
    let is_known = |identity: &SampleIdentity| identity.writer_guid != GUID::GUID_UNKNOWN;
    let is_numbered = related.sequence_number > SequenceNumber::zero();
    SampleIdentity {
        writer_guid: if is_known(&related) { related } else { sample }.writer_guid,
        sequence_number: if is_numbered { related } else { sample }.sequence_number,
    }
}

/// Assembles a reply: the body without the CDR header, and the related identity for its metadata.
pub(super) fn seal(caller: Caller, mut reply: Vec<u8>) -> (Vec<u8>, Option<SampleIdentity>) {
    match caller {
        Caller::Enhanced(identity) => {
            reply.drain(..HEADER_BYTES.min(reply.len()));
            (reply, Some(identity))
        }
        Caller::Cyclone(header) => {
            reply.splice(..HEADER_BYTES.min(reply.len()), header);
            // Cyclone rejects RustDDS's last fragment otherwise.
            reply.resize(reply.len().next_multiple_of(4), 0);
            (reply, None)
        }
    }
}

/// Opens a request of a Cyclone client in every mapping, and seals an answer.
#[cfg(fuzzing)]
pub(super) fn fuzz(data: &[u8]) {
    let mut bytes = [1; 16];
    bytes[..2].copy_from_slice(&CYCLONE_VENDOR);
    let sequence_number = SequenceNumber::new(1);
    let sample = SampleIdentity { writer_guid: GUID::from_bytes(bytes), sequence_number };
    for mapping in [ServiceMapping::Auto, ServiceMapping::Enhanced, ServiceMapping::Cyclone] {
        let envelope = Envelope { sample, related: None };
        if let Some((caller, message)) = open(data.to_vec(), envelope, mapping) {
            drop(seal(caller, message));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BODY: [u8; 4] = [9, 8, 7, 6];

    fn identity(vendor: u8, last: u8, sequence: i64) -> SampleIdentity {
        let mut bytes = [1; 16];
        (bytes[1], bytes[15]) = (vendor, last);
        let sequence_number = SequenceNumber::new(sequence);
        SampleIdentity { writer_guid: GUID::from_bytes(bytes), sequence_number }
    }

    fn cyclone_request(order: u8, header: [u8; 16]) -> Vec<u8> {
        [&[0, order, 0, 0][..], &header, &BODY].concat()
    }

    #[test]
    fn a_request_of_fast_dds_identifies_the_reader_of_the_reply() {
        let sample = identity(0x0f, 3, 5);
        let mut related = identity(0x0f, 4, 0);
        related.sequence_number = SequenceNumber::UNKNOWN;
        let envelope = Envelope { sample, related: Some(related) };
        let request = [&[0, 1, 0, 0][..], &BODY].concat();
        let (caller, message) = open(request.clone(), envelope, ServiceMapping::Auto).unwrap();
        assert_eq!(message, request);
        assert_eq!(caller, Caller::Enhanced(identity(0x0f, 4, 5)));
        let (body, beside) = seal(caller, vec![0, 1, 0, 0, 42]);
        assert_eq!((body, beside), (vec![42], Some(identity(0x0f, 4, 5))));
    }

    #[test]
    fn a_request_without_related_identity_is_answered_to_its_writer() {
        let envelope = Envelope { sample: identity(0x12, 3, 5), related: None };
        let (caller, _) = open(vec![0, 1, 0, 0], envelope, ServiceMapping::Auto).unwrap();
        assert_eq!(caller, Caller::Enhanced(identity(0x12, 3, 5)));
    }

    #[test]
    fn a_request_of_cyclone_has_its_header_echoed() {
        let header = [1, 2, 3, 4, 5, 6, 7, 8, 21, 0, 0, 0, 0, 0, 0, 0];
        let envelope = Envelope { sample: identity(0x10, 3, 5), related: None };
        for mapping in [ServiceMapping::Auto, ServiceMapping::Cyclone] {
            let (caller, message) = open(cyclone_request(1, header), envelope, mapping).unwrap();
            assert_eq!(message, [&[0, 1, 0, 0][..], &BODY].concat());
            let (body, beside) = seal(caller, vec![0, 1, 0, 0, 42]);
            assert_eq!((body, beside), ([&header[..], &[42, 0, 0, 0]].concat(), None));
        }
    }

    #[test]
    fn replies_are_little_endian_for_either_byte_order() {
        let header = [8, 7, 6, 5, 4, 3, 2, 1, 0, 0, 0, 0, 0, 0, 0, 21];
        let envelope = Envelope { sample: identity(0x10, 3, 5), related: None };
        let request = cyclone_request(0, header);
        let (caller, _) = open(request, envelope, ServiceMapping::Cyclone).unwrap();
        assert_eq!(caller, Caller::Cyclone([1, 2, 3, 4, 5, 6, 7, 8, 21, 0, 0, 0, 0, 0, 0, 0]));
    }

    #[test]
    fn a_configured_mapping_overrides_the_detected_one() {
        let envelope = Envelope { sample: identity(0x10, 3, 5), related: None };
        let (caller, _) = open(vec![0, 1, 0, 0], envelope, ServiceMapping::Enhanced).unwrap();
        assert!(matches!(caller, Caller::Enhanced(_)));
    }

    #[test]
    fn short_requests_and_replies_do_not_panic() {
        let envelope = Envelope { sample: identity(0x10, 3, 5), related: None };
        for length in 0..20 {
            assert!(open(vec![0; length], envelope, ServiceMapping::Cyclone).is_none());
        }
        assert!(seal(Caller::Enhanced(identity(0x0f, 1, 1)), vec![0]).0.is_empty());
    }
}
