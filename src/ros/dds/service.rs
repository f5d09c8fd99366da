//! A service: a reader of requests, a writer of replies.

use std::{sync::Arc, time::Duration};

use rustdds::{GUID, RTPSEntity, WriteOptionsBuilder, bytes::Bytes, rpc::SampleIdentity};

use super::{
    listener::Listener,
    names,
    participant::{Participant, RawDataWriter},
    qos::{Side, policies},
    raw::RawDecoder,
    reader::Sample,
    rpc::{self, Envelope},
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
        let answers = Answers { name: service.name.clone(), mapping, writer };
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
    writer: RawDataWriter,
}

impl Answers {
    fn answer(&self, sample: Sample, on_request: &mut OnRequest, participant: &Participant) {
        let refuse = |why: &str| tracing::warn!("{}: a request gets no response: {why}", self.name);
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
        let options = WriteOptionsBuilder::new().related_sample_identity_opt(related).build();
        if let Err(error) = self.writer.write_with_options(Bytes::from(body), options) {
            refuse(&error.to_string());
        }
    }
}
