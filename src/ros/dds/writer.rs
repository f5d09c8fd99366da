//! A publisher.

use std::sync::Arc;

use rustdds::{GUID, RTPSEntity, WriteOptions, bytes::Bytes, dds::WriteError};

use super::{
    names,
    participant::{Participant, RawDataWriter},
    qos::{Side, policies},
    raw::{HEADER_BYTES, timestamp},
};
use crate::ros::transport::{Publication, TopicEndpoint, TransportError};

/// Header of little-endian CDR, the encoding of every message here.
const LITTLE_ENDIAN: [u8; 2] = [0, 1];

pub(super) struct Writer {
    name: String,
    guid: GUID,
    endpoint: RawDataWriter,
    participant: Arc<Participant>,
}

impl Writer {
    pub(super) fn open(
        participant: &Arc<Participant>,
        topic: &TopicEndpoint,
    ) -> Result<Self, TransportError> {
        let dds_name = names::topic(&topic.name, &participant.node)?;
        let type_name = names::type_name(topic.kind.name, "");
        let endpoint =
            participant.writer(&dds_name, &type_name, &policies(&topic.qos, Side::Writer))?;
        let (name, guid) = (topic.name.clone(), endpoint.guid());
        Ok(Self { name, guid, endpoint, participant: Arc::clone(participant) })
    }

    fn refused(&self, reason: String) -> TransportError {
        TransportError::Endpoint { name: self.name.clone(), reason }
    }
}

impl Publication for Writer {
    fn publish(&mut self, data: &Arc<[u8]>, source_time_ns: i64) -> Result<(), TransportError> {
        let body = body(data).ok_or_else(|| {
            self.refused("the message is not little-endian CDR (00 01)".to_owned())
        })?;
        let options = WriteOptions::from(timestamp(source_time_ns));
        match self.endpoint.write_with_options(body, options) {
            Ok(_) => Ok(()),
            Err(WriteError::WouldBlock { .. }) => {
                Err(self.refused("subscribers are too slow, the message is dropped".to_owned()))
            }
            Err(error) => Err(self.refused(error.to_string())),
        }
    }

    fn num_matched(&self) -> usize {
        self.participant.endpoints.num_matched(self.guid)
    }
}

/// Returns the bytes after the header, shared and not copied; `None` for another header.
pub(super) fn body(data: &Arc<[u8]>) -> Option<Bytes> {
    let is_plain = data.len() >= HEADER_BYTES && data.starts_with(&LITTLE_ENDIAN);
    is_plain.then(|| Bytes::from_owner(Arc::clone(data)).slice(HEADER_BYTES..))
}

impl Drop for Writer {
    fn drop(&mut self) {
        self.participant.leave(self.guid);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_is_removed_without_a_copy() {
        let data: Arc<[u8]> = Arc::from([0, 1, 0, 0, 7, 8]);
        let body = body(&data).unwrap();
        assert_eq!(body.as_ref(), [7, 8]);
        assert_eq!(body.as_ptr(), data[HEADER_BYTES..].as_ptr());
    }

    #[test]
    fn another_header_is_rejected() {
        for data in [&[][..], &[0, 1, 0], &[0, 0, 0, 0, 1], &[0, 7, 0, 0]] {
            assert!(body(&Arc::from(data)).is_none(), "{data:?}");
        }
    }
}
