//! Participants that return without their endpoints.
//!
//! A process that was stopped for longer than its lease is forgotten here. When it continues, it may still know this
//! node, and then Fast DDS 2.14.6 does not announce its endpoints again, however often Cyclone asks: its images, or
//! results to it, are lost for good. It does announce them to a node that joins anew.

use std::{
    collections::{BTreeMap, BTreeSet},
    time::{Duration, Instant},
};

use cyclone_topics::Guid;

/// Time for the endpoints of a participant that returned. Discovery takes less than one second.
const PATIENCE: Duration = Duration::from_secs(5);
/// Most participants that are remembered.
const MAX_PEERS: usize = 1000;

/// Part of an identity that all endpoints of a participant share.
type Prefix = [u8; 12];

#[derive(Default)]
struct Peer {
    endpoints: BTreeSet<Guid>,
    is_away: bool,
    returned: Option<Instant>,
}

/// Participants with endpoints on the node's topics, also those that left.
#[derive(Default)]
pub(super) struct Peers(BTreeMap<Prefix, Peer>);

impl Peers {
    /// Notes an endpoint on one of the node's topics.
    pub(super) fn found(&mut self, endpoint: Guid) {
        if self.0.len() >= MAX_PEERS {
            self.0.retain(|_, peer| !peer.endpoints.is_empty());
        }
        let is_known = self.0.contains_key(&prefix(endpoint));
        if is_known || self.0.len() < MAX_PEERS {
            let peer = self.0.entry(prefix(endpoint)).or_default();
            peer.endpoints.insert(endpoint);
            peer.returned = None;
        }
    }

    pub(super) fn lost(&mut self, endpoint: Guid) {
        if let Some(peer) = self.0.get_mut(&prefix(endpoint)) {
            peer.endpoints.remove(&endpoint);
        }
    }

    /// Notes a participant that appeared at `now`.
    pub(super) fn joined(&mut self, participant: Guid, now: Instant) {
        if let Some(peer) = self.0.get_mut(&prefix(participant)) {
            // A short absence may go unseen, but not that of its endpoints.
            if std::mem::take(&mut peer.is_away) || peer.endpoints.is_empty() {
                peer.returned = Some(now);
            }
        }
    }

    pub(super) fn left(&mut self, participant: Guid) {
        if let Some(peer) = self.0.get_mut(&prefix(participant)) {
            peer.is_away = true;
            peer.returned = None;
        }
    }

    /// True if one has been back without its endpoints for too long.
    pub(super) fn has_incomplete(&self, now: Instant) -> bool {
        let is_late = |since: Instant| now.saturating_duration_since(since) > PATIENCE;
        self.0.values().any(|peer| peer.endpoints.is_empty() && peer.returned.is_some_and(is_late))
    }
}

fn prefix(guid: Guid) -> Prefix {
    let [prefix @ .., _, _, _, _] = guid;
    prefix
}

#[cfg(test)]
mod tests {
    use super::*;

    const PARTICIPANT: Guid = [7; 16];
    const SOON: Duration = Duration::from_secs(2);
    const LATE: Duration = Duration::from_secs(6);

    fn endpoint(number: u8) -> Guid {
        let mut guid = PARTICIPANT;
        guid[12] = number;
        guid
    }

    /// A participant with two endpoints that has fallen silent.
    fn silent() -> Peers {
        let mut peers = Peers::default();
        peers.joined(PARTICIPANT, Instant::now());
        for number in [1, 2] {
            peers.found(endpoint(number));
        }
        for number in [1, 2] {
            peers.lost(endpoint(number));
        }
        peers.left(PARTICIPANT);
        peers
    }

    #[test]
    fn a_peer_that_returns_without_endpoints_is_incomplete_after_a_while() {
        let (mut peers, now) = (silent(), Instant::now());
        assert!(!peers.has_incomplete(now + LATE), "it has not returned");
        peers.joined(PARTICIPANT, now);
        assert!(!peers.has_incomplete(now + SOON));
        assert!(peers.has_incomplete(now + LATE));
        peers.left(PARTICIPANT);
        assert!(!peers.has_incomplete(now + LATE));
    }

    #[test]
    fn a_peer_that_returns_with_an_endpoint_is_complete() {
        let (mut peers, now) = (silent(), Instant::now());
        peers.joined(PARTICIPANT, now);
        peers.found(endpoint(1));
        assert!(!peers.has_incomplete(now + LATE));
        // Later it ends its publisher.
        peers.lost(endpoint(1));
        assert!(!peers.has_incomplete(now + LATE));
    }

    #[test]
    fn the_order_of_the_events_does_not_matter() {
        let (mut peers, now) = (Peers::default(), Instant::now());
        peers.found(endpoint(1));
        peers.left(PARTICIPANT);
        peers.joined(PARTICIPANT, now);
        assert!(!peers.has_incomplete(now + LATE));
        peers.lost(endpoint(1));
        assert!(peers.has_incomplete(now + LATE));
        // Both events on the participant were too close to be seen.
        let mut peers = Peers::default();
        peers.found(endpoint(1));
        peers.lost(endpoint(1));
        peers.joined(PARTICIPANT, now);
        assert!(peers.has_incomplete(now + LATE));
    }

    #[test]
    fn participants_on_other_topics_do_not_matter_and_the_memory_is_bounded() {
        let (mut peers, now) = (Peers::default(), Instant::now());
        peers.joined(PARTICIPANT, now);
        assert!(!peers.has_incomplete(now + LATE));
        for number in 0..=u16::MAX {
            let mut guid = [0; 16];
            guid[..2].copy_from_slice(&number.to_be_bytes());
            peers.found(guid);
        }
        assert_eq!(peers.0.len(), MAX_PEERS);
    }
}
