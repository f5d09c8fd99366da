//! A subscriber.

use std::sync::{Arc, Mutex, PoisonError};

use cyclone_topics::{Guid, Message, Reader, Received};

use super::{
    super::{
        names,
        qos::Side,
        raw::{foreign, is_plain},
    },
    Shared,
    graph::{OnFault, Own},
    publication::now_ns,
    qos::convert,
    refused,
};
use crate::ros::transport::{
    Arrival, Fault, OnArrival, Subscription, TopicEndpoint, TransportError,
};

pub(super) struct CycloneSubscription {
    // Ends before the rest is given up.
    reader: Option<Reader>,
    guid: Guid,
    shared: Arc<Shared>,
}

impl CycloneSubscription {
    pub(super) fn open(
        shared: &Arc<Shared>,
        topic: &TopicEndpoint,
        limit_bytes: usize,
        on_arrival: OnArrival,
    ) -> Result<Self, TransportError> {
        let dds_name = names::topic(&topic.name, &shared.node)?;
        let type_name = names::type_name(topic.kind.name, "");
        let qos = convert(&topic.qos, Side::Reader, topic.kind.hash);
        // Messages come on the reader's thread, faults of other publishers on that of discovery.
        let on_arrival = Arc::new(Mutex::new(on_arrival));
        let deliver = Arc::clone(&on_arrival);
        let deliver = move |what| deliver.lock().unwrap_or_else(PoisonError::into_inner)(what);
        let on_received = {
            let deliver = deliver.clone();
            move |received| deliver(arrival(received, limit_bytes))
        };
        let names = [dds_name.as_str(), type_name.as_str()];
        let reader = shared.domain.reader(names, &qos, limit_bytes, on_received);
        let reader = reader.map_err(|error| refused(&topic.name, &error))?;
        let guid = reader.guid();
        let faults: OnFault = Arc::new(move |fault| deliver(Err(fault)));
        let (side, terms, faults) = (Side::Reader, qos.terms(), Some(faults));
        shared.enter(guid, Own { side, topic: dds_name, type_name, terms, faults });
        Ok(Self { reader: Some(reader), guid, shared: Arc::clone(shared) })
    }
}

impl Subscription for CycloneSubscription {
    fn num_matched(&self) -> usize {
        self.reader.as_ref().map_or(0, Reader::num_matched)
    }
}

impl Drop for CycloneSubscription {
    fn drop(&mut self) {
        self.shared.leave(self.guid);
        self.reader = None;
    }
}

fn arrival(received: Received, limit_bytes: usize) -> Result<Arrival, Fault> {
    let message = match received {
        Received::Message(message) => message,
        Received::TooLarge { bytes } => return Err(Fault::TooLarge { bytes, limit_bytes }),
    };
    let Message { bytes, writer, sequence, source_time_ns } = message;
    let encapsulation = bytes.first_chunk().copied().unwrap_or([0xff; 2]);
    if !is_plain(encapsulation) {
        return Err(foreign(encapsulation));
    }
    Ok(Arrival {
        data: bytes,
        publisher: writer.unwrap_or_default(),
        sequence,
        source_time_ns,
        receive_time_ns: now_ns(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn received(bytes: &[u8]) -> Received {
        let bytes = bytes.to_vec();
        Received::Message(Message {
            bytes,
            writer: Some([7; 16]),
            sequence: Some(3),
            source_time_ns: 5,
        })
    }

    #[test]
    fn messages_keep_their_metadata() {
        let arrival = arrival(received(&[0, 0, 0, 0, 9]), 100).unwrap();
        assert_eq!(arrival.data, [0, 0, 0, 0, 9]);
        assert_eq!((arrival.publisher, arrival.sequence), ([7; 16], Some(3)));
        assert_eq!(arrival.source_time_ns, 5);
        assert!(arrival.receive_time_ns > 5);
    }

    #[test]
    fn too_large_and_foreign_messages_are_faults() {
        let fault = arrival(Received::TooLarge { bytes: 9 }, 8).unwrap_err();
        assert_eq!(fault, Fault::TooLarge { bytes: 9, limit_bytes: 8 });
        let fault = arrival(received(&[0, 7, 0, 0]), 8).unwrap_err().to_string();
        assert!(fault.contains("00 07 is not plain CDR"), "{fault}");
    }
}
