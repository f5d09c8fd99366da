//! A subscriber.

use std::{collections::BTreeMap, sync::Arc, time::Instant};

use rustdds::{GUID, Timestamp, dds::ReadError, no_key::DeserializedCacheChange};

use super::{
    listener::Listener,
    names,
    participant::Participant,
    qos::{Side, policies},
    raw::{RawDecoder, Received, time_ns},
};
use crate::msg::qos::Durability;
use crate::ros::transport::{
    Arrival, Fault, OnArrival, Subscription, TopicEndpoint, TransportError,
};

/// A message with its RTPS metadata.
pub(super) type Sample = Result<DeserializedCacheChange<Received>, ReadError>;

pub(super) struct Reader {
    guid: GUID,
    listener: Option<Listener>,
    participant: Arc<Participant>,
}

impl Reader {
    pub(super) fn open(
        participant: &Arc<Participant>,
        topic: &TopicEndpoint,
        limit_bytes: usize,
        mut on_arrival: OnArrival,
    ) -> Result<Self, TransportError> {
        let dds_name = names::topic(&topic.name, &participant.node)?;
        let type_name = names::type_name(topic.kind.name, "");
        let reader =
            participant.reader(&dds_name, &type_name, &policies(&topic.qos, Side::Reader))?;
        let guid = reader.guid();
        let mut subscriber = Self { guid, listener: None, participant: Arc::clone(participant) };
        let mut origins = Origins::new(Arc::clone(participant), type_name);
        // RustDDS gives a new reader what it received for an earlier one of the same topic.
        let is_volatile = topic.qos.durability != Durability::TransientLocal;
        let opened = is_volatile.then(Timestamp::now);
        let noted = participant.endpoints.stream(guid);
        let listener = Listener::start(&topic.name, move |stop| {
            let samples = reader.as_async_stream_with(RawDecoder { limit_bytes });
            stop.follow(samples, |sample| {
                if is_from_before(&sample, opened) {
                    return reader.drain_read_notifications();
                }
                noted.note(Instant::now());
                on_arrival(arrival(sample, &mut origins));
                reader.drain_read_notifications();
            });
        });
        subscriber.listener = Some(listener?);
        Ok(subscriber)
    }
}

impl Subscription for Reader {
    fn num_matched(&self) -> usize {
        self.participant.endpoints.num_matched(self.guid)
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        // The thread owns RustDDS's reader, so stopping it drops the reader.
        self.listener = None;
        self.participant.leave(self.guid);
    }
}

fn is_from_before(sample: &Sample, opened: Option<Timestamp>) -> bool {
    let received = sample.as_ref().ok().map(|sample| sample.receive_instant);
    received.zip(opened).is_some_and(|(received, opened)| received < opened)
}

fn arrival(sample: Sample, origins: &mut Origins) -> Result<Arrival, Fault> {
    let sample = sample.map_err(|error| Fault::Foreign(error.to_string()))?;
    origins.check(sample.writer_guid)?;
    Ok(Arrival {
        publisher: sample.writer_guid.to_bytes(),
        sequence: Some(i64::from(sample.sequence_number)),
        source_time_ns: sample.source_timestamp().map_or(0, time_ns),
        receive_time_ns: time_ns(sample.receive_instant),
        data: sample.sample?,
    })
}

/// Largest number of cached publishers; beyond it, the cache is cleared.
const MAX_ORIGINS: usize = 64;

/// Checks that publishers send the expected type: RustDDS matches them by topic name only.
struct Origins {
    participant: Arc<Participant>,
    expected: String,
    foreign: BTreeMap<GUID, Option<String>>,
}

impl Origins {
    fn new(participant: Arc<Participant>, expected: String) -> Self {
        Self { participant, expected, foreign: BTreeMap::new() }
    }

    fn check(&mut self, writer: GUID) -> Result<(), Fault> {
        if !self.foreign.contains_key(&writer) {
            let Some(sent) = self.participant.type_sent_by(writer) else { return Ok(()) };
            if self.foreign.len() >= MAX_ORIGINS {
                self.foreign.clear();
            }
            self.foreign.insert(writer, Some(sent).filter(|sent| *sent != self.expected));
        }
        match self.foreign.get(&writer) {
            Some(Some(sent)) => Err(Fault::Foreign(format!(
                "a publisher sends {sent}, but {} is expected",
                self.expected
            ))),
            _ => Ok(()),
        }
    }
}
