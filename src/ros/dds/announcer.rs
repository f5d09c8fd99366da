//! The topic on which ROS nodes announce their endpoints: DDS itself has participants, but no nodes.

use byteorder::LittleEndian;
use ros2_client::{
    Gid, NodeName,
    builtin_topics::ros_discovery::{TOPIC_NAME, TYPE_NAME},
    entities_info::{NodeEntitiesInfo, ParticipantEntitiesInfo},
};
use rustdds::{
    DomainParticipant, GUID, Publisher, RTPSEntity, TopicKind, bytes::Bytes, dds::CreateResult,
    no_key::DataWriter,
};

use super::{
    endpoints::Endpoint,
    qos::{Side, policies},
    raw::RawWriter,
};
use crate::msg::qos::QosProfile;

/// Publisher of the node's endpoints on that topic.
pub(super) struct Announcer {
    node: NodeName,
    participant: GUID,
    writer: DataWriter<Bytes, RawWriter>,
}

impl Announcer {
    pub(super) fn open(
        node: NodeName,
        participant: &DomainParticipant,
        publisher: &Publisher,
    ) -> CreateResult<Self> {
        let policies = policies(&QosProfile::latched(1), Side::Writer);
        let (name, kind) = (TOPIC_NAME.to_owned(), TYPE_NAME.to_owned());
        let topic = participant.create_topic(name, kind, &policies, TopicKind::NoKey)?;
        let writer = publisher.create_datawriter_no_key(&topic, None)?;
        Ok(Self { node, participant: participant.guid(), writer })
    }

    /// Announces the node's current endpoints.
    pub(super) fn announce(&mut self, endpoints: &[(GUID, Endpoint)]) {
        let message = self.message(endpoints);
        let mut body = Vec::new();
        let written = cdr_encoding::to_writer::<_, LittleEndian, _>(&mut body, &message)
            .map_err(|error| error.to_string())
            .and_then(|()| {
                self.writer.write(Bytes::from(body), None).map_err(|error| error.to_string())
            });
        if let Err(error) = written {
            tracing::warn!("{TOPIC_NAME}: cannot announce this node to others: {error}");
        }
    }

    fn message(&self, endpoints: &[(GUID, Endpoint)]) -> ParticipantEntitiesInfo {
        let mut node = NodeEntitiesInfo::new(self.node.clone());
        for (guid, endpoint) in endpoints {
            match endpoint.side {
                Side::Reader => node.add_reader(Gid::from(*guid)),
                Side::Writer => node.add_writer(Gid::from(*guid)),
            }
        }
        ParticipantEntitiesInfo::new(Gid::from(self.participant), vec![node])
    }
}
