//! A service: a reader of requests, a writer of replies.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use rustdds::{
    GUID, RTPSEntity, SequenceNumber, WriteOptions, WriteOptionsBuilder,
    bytes::Bytes,
    dds::{WriteError, WriteResult},
    rpc::SampleIdentity,
};

use super::{
    listener::Listener,
    names,
    participant::{Participant, RawDataWriter},
    qos::{Side, policies},
    raw::{HEADER_BYTES, RawDecoder},
    reader::Sample,
    rpc::{self, Envelope},
    rtps::{self, FRAGMENT_BYTES, Reply},
    second_copies::{Acknowledged, Delivery, Recipient},
};
use crate::{
    msg::qos::QosProfile,
    ros::{
        node_params::ServiceMapping,
        transport::{OnRequest, Server, ServiceEndpoint, TransportError},
    },
};

/// Quality of service of rmw's services.
const QOS: QosProfile = QosProfile::reliable(10);
/// Largest request, bytes; requests of parameters and switches are much smaller.
const MAX_REQUEST_BYTES: usize = 1 << 20;
/// Longest wait for the discovery of a reply's reader: a request may overtake discovery, on Cyclone by about 300 ms.
const MAX_WAIT: Duration = Duration::from_secs(2);
/// Longest wait for room for a reply. RustDDS keeps 256 replies for the reader that has acknowledged least, whoever they
/// are for, so that a client that was killed or stopped leaves no room until its lease ends. After this the node joins
/// anew.
const MAX_ROOM_WAIT: Duration = Duration::from_secs(7);

pub(super) struct Service {
    requests: GUID,
    replies: GUID,
    listener: Option<Listener>,
    participant: Arc<Participant>,
}

impl Service {
    pub(super) fn open(
        participant: &Arc<Participant>,
        service: &ServiceEndpoint,
        mapping: ServiceMapping,
        mut on_request: OnRequest,
    ) -> Result<Self, TransportError> {
        let (requests, replies) = names::service(&service.name, &participant.node)?;
        let kind = |suffix| names::type_name(service.kind.name, suffix);
        let writer =
            participant.writer(&replies, &kind("_Response"), &policies(&QOS, Side::Writer))?;
        let replies = writer.guid();
        let reader = participant
            .reader(&requests, &kind("_Request"), &policies(&QOS, Side::Reader))
            .inspect_err(|_| participant.leave(replies))?;
        let requests = reader.guid();
        let participant = Arc::clone(participant);
        let mut server = Self { requests, replies, listener: None, participant };
        let mut answers = Answers::new(&service.name, mapping, writer);
        let peers = Arc::clone(&server.participant);
        let listener = Listener::start(&service.name, move |stop| {
            let limit_bytes = MAX_REQUEST_BYTES;
            let samples = reader.as_async_stream_with(RawDecoder { limit_bytes });
            stop.follow(samples, |sample| {
                answers.answer(sample, &mut on_request, &peers);
                reader.drain_read_notifications();
            });
        });
        server.listener = Some(listener?);
        Ok(server)
    }
}

impl Server for Service {}

impl Drop for Service {
    fn drop(&mut self) {
        self.listener = None;
        self.participant.leave(self.requests);
        self.participant.leave(self.replies);
    }
}

struct Answers {
    name: String,
    mapping: ServiceMapping,
    writer: Arc<RawDataWriter>,
    /// The last reply; number 0 before the first.
    last: SampleIdentity,
}

impl Answers {
    fn new(name: &str, mapping: ServiceMapping, writer: RawDataWriter) -> Self {
        let sequence_number = SequenceNumber::new(0);
        let last = SampleIdentity { writer_guid: writer.guid(), sequence_number };
        Self { name: name.to_owned(), mapping, writer: Arc::new(writer), last }
    }

    fn answer(&mut self, sample: Sample, on_request: &mut OnRequest, participant: &Participant) {
        let name = self.name.clone();
        let refuse = |why: &str| tracing::warn!("{name}: a request gets no response: {why}");
        let sample = match sample {
            Ok(sample) => sample,
            Err(error) => return refuse(&error.to_string()),
        };
        let envelope = Envelope {
            sample: SampleIdentity {
                writer_guid: sample.writer_guid,
                sequence_number: sample.sequence_number,
            },
            related: sample.related_sample_identity(),
        };
        let request = match sample.sample {
            Ok(request) => request,
            Err(fault) => return refuse(&fault.to_string()),
        };
        let Some((caller, request)) = rpc::open(request, envelope, self.mapping) else {
            return refuse("it is shorter than the header of Cyclone DDS's service mapping");
        };
        let Some(reply) = on_request(&request) else { return refuse("it is malformed") };
        let peer = envelope.sample.writer_guid;
        let writer = self.writer.guid();
        if !participant.endpoints.wait_for_participant_of(writer, peer, MAX_WAIT) {
            return refuse("no reader of the response was discovered");
        }
        let (body, related) = rpc::seal(caller, reply);
        let reply = Sealed { body: Bytes::from(body), related, peer };
        if let Err(error) = self.send(&reply, participant) {
            if matches!(error, WriteError::WouldBlock { .. }) {
                participant.endpoints.note_blocked(&name);
            }
            refuse(&error.to_string());
        }
    }

    fn send(&mut self, reply: &Sealed, participant: &Participant) -> WriteResult<(), Bytes> {
        let reader = self.reader_of(reply, participant);
        let mut readers = participant.readers_of(self.writer.guid(), reply.peer).into_iter();
        let recipient = readers.find(|found| Some(found.reader) == reader);
        if let Some(Recipient { reader, addresses }) = &recipient {
            // A volatile reader of Cyclone DDS begins behind the first heartbeat that it sees. RustDDS sends that when
            // it has matched the reader, or is asked for it: by then it may include the reply, which would be lost. The
            // reader's answer matters, too: while it is missing, RustDDS waits for it from the 257th reply on.
            participant.send(&rtps::heartbeat(&self.last, *reader), addresses);
        }
        let mut options = WriteOptionsBuilder::new().related_sample_identity_opt(reply.related);
        // Clients keep the last ten replies on the topic: those to others would push out their own.
        if let Some(reader) = reader {
            options = options.to_single_reader(reader);
        }
        self.last = self.write(&reply.body, &options.build())?;
        self.send_copies(reply, recipient, participant);
        Ok(())
    }

    /// Returns the reader of a reply, if that is certain.
    fn reader_of(&self, reply: &Sealed, participant: &Participant) -> Option<GUID> {
        let matched = participant.endpoints.matched_of(self.writer.guid(), reply.peer);
        let known = reply.related.map(|related| related.writer_guid);
        match matched[..] {
            // Cyclone DDS and older releases of Fast DDS state no reader.
            [only] => Some(only),
            _ => known.filter(|known| matched.contains(known)),
        }
    }

    /// Writes a reply, when there is room for it.
    fn write(&self, body: &Bytes, options: &WriteOptions) -> WriteResult<SampleIdentity, Bytes> {
        let deadline = Instant::now() + MAX_ROOM_WAIT;
        loop {
            match self.writer.write_with_options(body.clone(), options.clone()) {
                // Has waited already, see `MAX_BLOCKING`.
                Err(WriteError::WouldBlock { .. }) if Instant::now() < deadline => {}
                written => return written,
            }
        }
    }

    /// Sends copies of the last reply if RustDDS may have sent it as fragments that nobody can read: those with a
    /// related identity.
    fn send_copies(&self, reply: &Sealed, to: Option<Recipient>, participant: &Participant) {
        let bytes = reply.body.len();
        let Some(related) = reply.related.filter(|_| bytes + HEADER_BYTES > FRAGMENT_BYTES) else {
            return;
        };
        let Some(recipient) = to else {
            let name = &self.name;
            tracing::warn!(
                "{name}: a reply of {bytes} bytes may not reach its client, which names no reader for it"
            );
            return;
        };
        let reply = Reply { sample: self.last, related, body: reply.body.clone() };
        let acknowledged = Acknowledged::of(&self.writer);
        participant.second_copies.send(Delivery { reply, recipient, acknowledged });
    }
}

/// A reply and its addressee.
struct Sealed {
    body: Bytes,
    related: Option<SampleIdentity>,
    /// The writer of the request.
    peer: GUID,
}
