//! Topics over RustDDS: services have the same participant.
//!
//! Memory of RustDDS: a reader stores `depth + 1` messages, and for ten seconds up to 128 incomplete messages per
//! publisher. On a network that loses fragments, a best-effort subscription to images of 5 MB can take 700 MB; a
//! reliable one has fragments sent again and stays below 150 MB. RustDDS allocates the length stated in a fragment
//! before this module sees it: `limit_bytes` of a subscription applies to complete messages only. A reliable writer
//! stores sent messages for about six seconds.
//!
//! RustDDS orders the messages of a best-effort subscription by the machine's clock: if that is set back, nothing
//! arrives until it has caught up. Reliable subscriptions are ordered by sequence number.

use std::sync::Arc;

use ros2_client::builtin_topics::ros_discovery::{TOPIC_NAME, TYPE_NAME};
use rustdds::{
    DomainParticipant, Publisher, RTPSEntity, TopicKind, bytes::Bytes, dds::CreateResult,
};

use super::{
    announcer::{Announcer, Send},
    names,
    participant::{Participant, RawDataWriter},
    qos::{Side, policies},
    reader::Reader,
    settings::DdsSettings,
    writer::Writer,
};
use crate::{
    msg::qos::QosProfile,
    ros::transport::{
        GraphTopic, NodeIdentity, OnArrival, Publication, Subscription, TopicEndpoint,
        TransportError,
    },
};

/// The node's only participant.
pub(super) struct Topics {
    participant: Arc<Participant>,
}

impl Topics {
    /// Largest reliably delivered message, bytes. RustDDS sends fragments of 256 bytes without pacing, so larger
    /// messages overrun the default socket buffers of a Fast DDS reader (measured: 96 KiB always arrive, two thirds of
    /// 256 KiB are lost).
    pub(super) const MAX_RELIABLE_BYTES: Option<usize> = Some(96 * 1024);

    /// Joins a domain and announces the node there.
    ///
    /// # Errors
    /// An invalid setting; no free port or no network.
    pub(super) fn join(
        settings: &DdsSettings,
        identity: &NodeIdentity,
    ) -> Result<Self, TransportError> {
        let node = names::node_name(identity)?;
        let participant = Participant::join(settings, node.clone(), |domain, publisher| {
            Ok(Arc::new(Announcer::open(node, domain.guid(), sender(domain, publisher)?)))
        });
        Ok(Self { participant: Arc::new(participant?) })
    }

    /// Returns the participant for services.
    #[expect(clippy::unnecessary_wraps, reason = "Cyclone's topics have a second participant")]
    pub(super) fn services(
        &self,
        _: &DdsSettings,
    ) -> Result<Option<Arc<Participant>>, TransportError> {
        Ok(Some(Arc::clone(&self.participant)))
    }

    pub(super) fn advertise(
        &self,
        topic: &TopicEndpoint,
    ) -> Result<Box<dyn Publication>, TransportError> {
        Ok(Box::new(Writer::open(&self.participant, topic)?))
    }

    pub(super) fn subscribe(
        &self,
        topic: &TopicEndpoint,
        limit_bytes: usize,
        on_arrival: OnArrival,
    ) -> Result<Box<dyn Subscription>, TransportError> {
        Ok(Box::new(Reader::open(&self.participant, topic, limit_bytes, on_arrival)?))
    }

    /// None of topics alone: services have the same participant.
    #[expect(clippy::unused_self, reason = "Cyclone's topics have a second participant")]
    pub(super) const fn failure(&self) -> Option<String> {
        None
    }

    /// Returns the topics of the graph.
    pub(super) fn topics(&self) -> Vec<GraphTopic> {
        self.participant.topics()
    }
}

/// Returns a sender of announcements on this participant.
fn sender(domain: &DomainParticipant, publisher: &Publisher) -> CreateResult<Send> {
    let policies = policies(&QosProfile::latched(1), Side::Writer);
    let (name, kind) = (TOPIC_NAME.to_owned(), TYPE_NAME.to_owned());
    let topic = domain.create_topic(name, kind, &policies, TopicKind::NoKey)?;
    let writer: RawDataWriter = publisher.create_datawriter_no_key(&topic, None)?;
    Ok(Box::new(move |body| {
        writer.write(Bytes::from(body), None).map_err(|error| error.to_string())
    }))
}
