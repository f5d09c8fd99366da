//! The node's own endpoints and their matches.

use std::{
    collections::{BTreeMap, BTreeSet, VecDeque},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use rustdds::{
    DomainParticipantStatusEvent as Event, GUID, LostReason, QosPolicies, policy::Deadline,
};

use super::{names, qos::Side, stream::Stream};

/// A reader or writer of this node.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "cyclone", expect(dead_code, reason = "those of services are only counted"))]
pub(super) struct Endpoint {
    pub(super) side: Side,
    /// Topic and type have the names of DDS.
    pub(super) topic: String,
    pub(super) type_name: String,
}

#[derive(Default)]
struct Table {
    own: BTreeMap<GUID, Endpoint>,
    /// Matched remote endpoints, by own endpoint. A match may be reported before the endpoint is inserted.
    matched: BTreeMap<GUID, BTreeSet<GUID>>,
    /// Already reported incompatible endpoints: discovery repeats its events.
    reported: BTreeSet<(GUID, GUID)>,
    /// Matched participants that fell silent, the latest last.
    silent: VecDeque<GUID>,
    /// One of them that spoke again.
    returned: Option<GUID>,
    num_participants: usize,
    /// A service that can send no more replies.
    blocked: Option<String>,
    /// Arrivals, by own subscription.
    streams: BTreeMap<GUID, Arc<Stream>>,
}

/// Participants that RustDDS still handles: with thousands, it matches no new ones.
const MAX_PARTICIPANTS: usize = 1000;

/// Silent participants that are remembered.
const MAX_SILENT: usize = 256;

/// All endpoints of the node.
#[derive(Default)]
pub(super) struct Endpoints {
    table: Mutex<Table>,
    changed: Condvar,
}

impl Endpoints {
    fn lock(&self) -> MutexGuard<'_, Table> {
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn insert(&self, guid: GUID, endpoint: Endpoint) {
        self.lock().own.insert(guid, endpoint);
    }

    pub(super) fn remove(&self, guid: GUID) {
        let mut table = self.lock();
        table.own.remove(&guid);
        table.streams.remove(&guid);
        table.matched.remove(&guid);
        table.reported.retain(|(own, _)| *own != guid);
    }

    /// Returns a copy of all endpoints, in order.
    #[cfg(not(feature = "cyclone"))]
    pub(super) fn all(&self) -> Vec<(GUID, Endpoint)> {
        self.lock().own.iter().map(|(guid, endpoint)| (*guid, endpoint.clone())).collect()
    }

    /// Returns true for an own reader of a service's requests.
    pub(super) fn takes_requests(&self, own: GUID) -> bool {
        let table = self.lock();
        table.own.get(&own).is_some_and(|endpoint| names::is_requests(&endpoint.topic))
    }

    /// Returns the number of remote endpoints matched with an own one.
    pub(super) fn num_matched(&self, own: GUID) -> usize {
        self.lock().matched.get(&own).map_or(0, BTreeSet::len)
    }

    /// Returns the endpoints of `peer`'s participant that are matched with an own one.
    pub(super) fn matched_of(&self, own: GUID, peer: GUID) -> Vec<GUID> {
        let table = self.lock();
        let matched = table.matched.get(&own).into_iter().flatten();
        matched.filter(|guid| guid.prefix == peer.prefix).copied().collect()
    }

    /// Waits at most `at_most` until an own endpoint is matched with any endpoint of `peer`'s participant; returns true
    /// if it is.
    pub(super) fn wait_for_participant_of(&self, own: GUID, peer: GUID, at_most: Duration) -> bool {
        let is_missing = |table: &mut Table| {
            let matched = table.matched.get(&own).into_iter().flatten();
            !matched.into_iter().any(|guid| guid.prefix == peer.prefix)
        };
        let waited = self.changed.wait_timeout_while(self.lock(), at_most, is_missing);
        !waited.unwrap_or_else(PoisonError::into_inner).1.timed_out()
    }

    /// Returns where a subscription notes what arrives.
    pub(super) fn stream(&self, own: GUID) -> Arc<Stream> {
        Arc::clone(self.lock().streams.entry(own).or_default())
    }

    /// Notes that there has been no room for a reply of `service`.
    pub(super) fn note_blocked(&self, service: &str) {
        self.lock().blocked = Some(service.to_owned());
    }

    /// Returns the reason why RustDDS 0.15.1 matches no peer, or one peer, any more, or answers nobody.
    pub(super) fn failure(&self) -> Option<String> {
        let table = self.lock();
        if let Some(service) = &table.blocked {
            return Some(format!("{service}: its replies are no longer acknowledged"));
        }
        if table.num_participants > MAX_PARTICIPANTS {
            return Some(format!("more than {MAX_PARTICIPANTS} participants were announced"));
        }
        let now = Instant::now();
        let is_matched =
            |own: &GUID| table.matched.get(own).is_some_and(|matched| !matched.is_empty());
        let stopped =
            table.streams.iter().find(|(own, stream)| stream.has_stopped(now) && is_matched(own));
        if let Some(endpoint) = stopped.and_then(|(own, _)| table.own.get(own)) {
            return Some(format!(
                "{} stopped: its publisher may have forgotten this node",
                endpoint.topic
            ));
        }
        table.returned.map(|_| {
            "a peer returned after it was silent for longer than its lease, and RustDDS does not match it again"
                .to_owned()
        })
    }

    /// Applies an event of discovery.
    pub(super) fn apply(&self, event: &Event) {
        let mut table = self.lock();
        match event {
            Event::RemoteReaderMatched { local_writer: own, remote_reader: other }
            | Event::RemoteWriterMatched { local_reader: own, remote_writer: other } => {
                // Ignores the built-in endpoints of discovery.
                if own.entity_id.kind().is_user_defined() {
                    table.matched.entry(*own).or_default().insert(*other);
                    table.reported.remove(&(*own, *other));
                }
            }
            Event::ReaderLost { guid, reason } | Event::WriterLost { guid, reason } => {
                // Comes before the event about its participant.
                if matches!(reason, LostReason::Timeout { .. }) {
                    table.note_silence(*guid);
                }
                table.forget(|other| other == guid);
            }
            Event::ParticipantLost { id, reason } => {
                table.num_participants = table.num_participants.saturating_sub(1);
                if matches!(reason, LostReason::Timeout { .. }) {
                    table.note_silence(GUID { prefix: *id, ..GUID::GUID_UNKNOWN });
                }
                table.forget(|other| other.prefix == *id);
            }
            Event::ParticipantDiscovered { dpd } => {
                table.num_participants += 1;
                table.note_voice(dpd.guid);
            }
            Event::RemoteReaderQosIncompatible {
                local_writer,
                remote_reader,
                requested_qos,
                offered_qos,
            } => {
                let what = "a subscriber receives nothing";
                let end = (*local_writer, *remote_reader);
                table.report(end, what, requested_qos, offered_qos);
            }
            Event::RemoteWriterQosIncompatible {
                local_reader,
                remote_writer,
                requested_qos,
                offered_qos,
            } => {
                let what = "messages of a publisher are not received";
                let end = (*local_reader, *remote_writer);
                table.report(end, what, requested_qos, offered_qos);
            }
            _ => return,
        }
        drop(table);
        self.changed.notify_all();
    }
}

impl Table {
    fn note_silence(&mut self, participant: GUID) {
        let is_matched = |guid: &GUID| guid.prefix == participant.prefix;
        let is_new = !self.silent.iter().any(is_matched);
        if is_new && self.matched.values().flatten().any(is_matched) {
            if self.silent.len() >= MAX_SILENT {
                self.silent.pop_front();
            }
            self.silent.push_back(participant);
        }
    }

    fn note_voice(&mut self, participant: GUID) {
        if self.silent.iter().any(|silent| silent.prefix == participant.prefix) {
            self.returned = Some(participant);
        }
    }

    fn forget(&mut self, is_gone: impl Fn(&GUID) -> bool) {
        for others in self.matched.values_mut() {
            others.retain(|other| !is_gone(other));
        }
        self.reported.retain(|(_, other)| !is_gone(other));
    }

    fn report(
        &mut self,
        end: (GUID, GUID),
        what: &str,
        requested: &QosPolicies,
        offered: &QosPolicies,
    ) {
        if !self.reported.insert(end) {
            return;
        }
        let Some(Endpoint { topic, .. }) = self.own.get(&end.0) else { return };
        let (requested, offered) = (brief(requested), brief(offered));
        tracing::warn!("{topic}: {what}: offered {offered}, requested {requested}");
    }
}

/// Formats the policies that can make ROS endpoints incompatible.
fn brief(policies: &QosPolicies) -> String {
    let reliability = if policies.is_reliable() { "reliable" } else { "best effort" };
    let durability = if policies.is_volatile() { "volatile" } else { "transient local" };
    match policies.deadline() {
        Some(Deadline(period)) if period < rustdds::Duration::INFINITE => {
            format!("{reliability}, {durability}, deadline {:?}", period.to_std())
        }
        _ => format!("{reliability}, {durability}"),
    }
}

#[cfg(test)]
mod tests {
    use rustdds::LostReason;

    use super::*;

    /// An endpoint without a key: 3 is a writer's kind, 4 a reader's.
    fn guid(participant: u8, entity: u8, kind: u8) -> GUID {
        let mut bytes = [participant; 16];
        bytes[12..].copy_from_slice(&[0, 0, entity, kind]);
        GUID::from_bytes(bytes)
    }

    fn matched(local_reader: GUID, remote_writer: GUID) -> Event {
        Event::RemoteWriterMatched { local_reader, remote_writer }
    }

    #[test]
    fn only_a_matched_peer_that_fell_silent_returns() {
        let endpoints = Endpoints::default();
        let timeout = || LostReason::Timeout {
            lease: rustdds::Duration::from_secs(10),
            elapsed: rustdds::Duration::from_secs(11),
        };
        let (matched_peer, other) = (guid(2, 1, 3), guid(3, 1, 3));
        endpoints.apply(&matched(guid(1, 1, 4), matched_peer));
        let table = |returned: GUID| {
            endpoints.lock().note_voice(returned);
            endpoints.failure().is_some()
        };
        assert!(!table(matched_peer), "never silent");
        endpoints.apply(&Event::ParticipantLost { id: other.prefix, reason: timeout() });
        assert!(!table(other), "nothing was exchanged with it");
        let left = LostReason::Disposed;
        endpoints.apply(&Event::ParticipantLost { id: matched_peer.prefix, reason: left });
        assert!(!table(matched_peer), "it had said farewell");
        endpoints.apply(&matched(guid(1, 1, 4), matched_peer));
        endpoints.apply(&Event::WriterLost { guid: matched_peer, reason: timeout() });
        endpoints.apply(&Event::ParticipantLost { id: matched_peer.prefix, reason: timeout() });
        assert!(endpoints.failure().is_none(), "still silent");
        assert!(table(matched_peer));
    }

    #[test]
    fn a_service_without_room_for_replies_is_a_failure() {
        let endpoints = Endpoints::default();
        assert!(endpoints.failure().is_none());
        endpoints.note_blocked("/cell/node/reset");
        assert!(endpoints.failure().unwrap().starts_with("/cell/node/reset"));
    }

    #[test]
    fn matches_come_and_go() {
        let endpoints = Endpoints::default();
        let own = guid(1, 1, 4);
        for writer in [guid(2, 1, 3), guid(2, 2, 3), guid(3, 1, 3), guid(2, 1, 3)] {
            endpoints.apply(&matched(own, writer));
        }
        assert_eq!(endpoints.num_matched(own), 3);
        let reason = LostReason::Disposed;
        endpoints.apply(&Event::WriterLost { guid: guid(2, 1, 3), reason: reason.clone() });
        assert_eq!(endpoints.num_matched(own), 2);
        endpoints.apply(&Event::ParticipantLost { id: guid(2, 0, 3).prefix, reason });
        assert_eq!(endpoints.num_matched(own), 1);
        endpoints.remove(own);
        assert_eq!(endpoints.num_matched(own), 0);
    }

    #[test]
    fn waiting_ends_when_the_peer_is_there() {
        let endpoints = Endpoints::default();
        let (own, peer) = (guid(1, 1, 4), guid(2, 9, 3));
        assert!(!endpoints.wait_for_participant_of(own, peer, Duration::from_millis(1)));
        std::thread::scope(|scope| {
            let waiting = scope
                .spawn(|| endpoints.wait_for_participant_of(own, peer, Duration::from_mins(1)));
            endpoints.apply(&matched(own, guid(2, 1, 3)));
            assert!(waiting.join().unwrap());
        });
    }

    #[test]
    fn built_in_endpoints_do_not_count() {
        let endpoints = Endpoints::default();
        let builtin = guid(1, 1, 0xc7);
        endpoints.apply(&matched(builtin, guid(2, 1, 0xc2)));
        assert_eq!(endpoints.num_matched(builtin), 0);
    }
}
