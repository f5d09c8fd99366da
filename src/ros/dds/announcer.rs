//! The topic on which ROS nodes announce their endpoints: DDS itself has participants, but no nodes.

use std::{
    collections::BTreeMap,
    sync::{Mutex, PoisonError},
};

use byteorder::LittleEndian;
use ros2_client::{
    Gid, NodeName,
    builtin_topics::ros_discovery::TOPIC_NAME,
    entities_info::{NodeEntitiesInfo, ParticipantEntitiesInfo},
};

use super::qos::Side;

/// Sends CDR bytes without their header to the topic.
pub(super) type Send = Box<dyn FnMut(Vec<u8>) -> Result<(), String> + std::marker::Send>;

/// Announces the node's endpoints, whichever participant has them.
pub(super) struct Announcer {
    node: NodeName,
    /// The participant that others take for the node's.
    participant: Gid,
    current: Mutex<Current>,
}

struct Current {
    endpoints: BTreeMap<Gid, Side>,
    send: Send,
}

impl Announcer {
    /// Announces a node without endpoints.
    pub(super) fn open(node: NodeName, participant: impl Into<Gid>, send: Send) -> Self {
        let current = Current { endpoints: BTreeMap::new(), send };
        let announcer =
            Self { node, participant: participant.into(), current: Mutex::new(current) };
        announcer.change(|_| {});
        announcer
    }

    /// Announces that there is an endpoint.
    pub(super) fn enter(&self, endpoint: impl Into<Gid>, side: Side) {
        self.change(|endpoints| {
            endpoints.insert(endpoint.into(), side);
        });
    }

    /// Announces that an endpoint is gone.
    pub(super) fn leave(&self, endpoint: impl Into<Gid>) {
        self.change(|endpoints| {
            endpoints.remove(&endpoint.into());
        });
    }

    fn change(&self, change: impl FnOnce(&mut BTreeMap<Gid, Side>)) {
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        change(&mut current.endpoints);
        let message = self.message(&current.endpoints);
        let mut body = Vec::new();
        let written = cdr_encoding::to_writer::<_, LittleEndian, _>(&mut body, &message)
            .map_err(|error| error.to_string())
            .and_then(|()| (current.send)(body));
        if let Err(error) = written {
            tracing::warn!("{TOPIC_NAME}: cannot announce this node to others: {error}");
        }
    }

    fn message(&self, endpoints: &BTreeMap<Gid, Side>) -> ParticipantEntitiesInfo {
        let mut node = NodeEntitiesInfo::new(self.node.clone());
        for (gid, side) in endpoints {
            match side {
                Side::Reader => node.add_reader(*gid),
                Side::Writer => node.add_writer(*gid),
            }
        }
        ParticipantEntitiesInfo::new(self.participant, vec![node])
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, mpsc};

    use super::*;

    #[test]
    fn every_change_is_announced_with_all_endpoints() {
        let (sender, sent) = mpsc::sync_channel(8);
        let send: Send = Box::new(move |body| sender.send(body).map_err(|error| error.to_string()));
        let node = NodeName::new("/cell", "profiler").unwrap();
        let announcer = Arc::new(Announcer::open(node, [1; 16], send));
        announcer.enter([2; 16], Side::Writer);
        // Of another participant.
        announcer.enter([9; 16], Side::Reader);
        announcer.leave([2; 16]);
        let messages: Vec<Vec<u8>> = sent.try_iter().collect();
        let has = |message: &[u8], byte| message.windows(16).any(|bytes| bytes == [byte; 16]);
        let contents = messages.iter().map(|message| [1, 2, 9].map(|byte| has(message, byte)));
        let expected =
            [[true, false, false], [true, true, false], [true, true, true], [true, false, true]];
        assert_eq!(contents.collect::<Vec<_>>(), expected);
    }
}
