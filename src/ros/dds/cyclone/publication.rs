//! A publisher.

use std::{
    sync::Arc,
    time::{SystemTime, UNIX_EPOCH},
};

use cyclone_topics::{Error, Writer};

use super::{
    super::{names, qos::Side, raw::timestamp},
    Shared,
    graph::Own,
    qos::convert,
    refused,
};
use crate::ros::transport::{Publication, TopicEndpoint, TransportError};

/// Header of little-endian CDR, the encoding of every message here.
const LITTLE_ENDIAN: [u8; 2] = [0, 1];

pub(super) struct CyclonePublication {
    name: String,
    writer: Writer,
    shared: Arc<Shared>,
}

impl CyclonePublication {
    pub(super) fn open(
        shared: &Arc<Shared>,
        topic: &TopicEndpoint,
    ) -> Result<Self, TransportError> {
        let dds_name = names::topic(&topic.name, &shared.node)?;
        let type_name = names::type_name(topic.kind.name, "");
        let qos = convert(&topic.qos, Side::Writer, topic.kind.hash);
        let writer = shared.domain.writer(&dds_name, &type_name, &qos);
        let writer = writer.map_err(|error| refused(&topic.name, &error))?;
        let (side, terms) = (Side::Writer, qos.terms());
        let own = Own { side, topic: dds_name, type_name, terms, faults: None };
        shared.enter(writer.guid(), own);
        Ok(Self { name: topic.name.clone(), writer, shared: Arc::clone(shared) })
    }
}

impl Publication for CyclonePublication {
    fn publish(&mut self, data: &Arc<[u8]>, source_time_ns: i64) -> Result<(), TransportError> {
        let refused = |reason: String| TransportError::Endpoint { name: self.name.clone(), reason };
        if !data.starts_with(&LITTLE_ENDIAN) {
            return Err(refused("the message is not little-endian CDR (00 01)".to_owned()));
        }
        // What DDS cannot represent is sent as now.
        let is_valid = timestamp(source_time_ns).is_some();
        let sent_ns = if is_valid { source_time_ns } else { now_ns() };
        self.writer.write(data, sent_ns).map_err(|error| match error {
            Error::TooSlow => {
                refused("subscribers are too slow, the message is dropped".to_owned())
            }
            error => refused(error.to_string()),
        })
    }

    fn num_matched(&self) -> usize {
        self.writer.num_matched()
    }
}

impl Drop for CyclonePublication {
    fn drop(&mut self) {
        self.shared.leave(self.writer.guid());
    }
}

/// Nanoseconds since the epoch.
pub(super) fn now_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}
