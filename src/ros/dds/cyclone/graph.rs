//! The node's own endpoints beside those of others: reports those that cannot work together, and peers that no longer
//! announce theirs.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Instant,
};

use cyclone_topics::{Discovery, Durability, Guid, Reliability, RemoteEndpoint, Terms};

use super::{super::qos::Side, Shared, peers::Peers};
use crate::ros::transport::Fault;

/// Takes faults of a subscription that are not those of one message.
pub(super) type OnFault = Arc<dyn Fn(Fault) + Send + Sync>;

/// An endpoint of this node, with the names of DDS.
pub(super) struct Own {
    pub(super) side: Side,
    pub(super) topic: String,
    pub(super) type_name: String,
    pub(super) terms: Terms,
    /// Only of subscriptions.
    pub(super) faults: Option<OnFault>,
}

#[derive(Default)]
struct Table {
    own: BTreeMap<Guid, Own>,
    /// Reported pairs, own endpoint first: discovery repeats itself.
    reported: BTreeSet<(Guid, Guid)>,
    peers: Peers,
}

/// All endpoints of the node on Cyclone.
#[derive(Default)]
pub(super) struct Graph(Mutex<Table>);

impl Shared {
    /// Announces an endpoint, and compares it with those that are there.
    pub(super) fn enter(&self, guid: Guid, own: Own) {
        self.announcer.enter(guid, own.side);
        self.graph.lock().own.insert(guid, own);
        for other in self.domain.endpoints() {
            self.graph.meet(&other);
        }
    }

    /// Announces that an endpoint is gone.
    pub(super) fn leave(&self, guid: Guid) {
        let mut table = self.graph.lock();
        let gone = table.own.remove(&guid);
        table.reported.retain(|(own, _)| *own != guid);
        drop(table);
        // A callback is not dropped under the lock.
        drop(gone);
        self.announcer.leave(guid);
    }
}

impl Graph {
    fn lock(&self) -> MutexGuard<'_, Table> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns side, topic and type of every endpoint.
    pub(super) fn own(&self) -> Vec<(Side, String, String)> {
        let table = self.lock();
        let own = table.own.values();
        own.map(|own| (own.side, own.topic.clone(), own.type_name.clone())).collect()
    }

    /// Applies a change among others.
    pub(super) fn apply(&self, change: &Discovery) {
        match change {
            Discovery::Found(other) => self.meet(other),
            Discovery::Lost(guid) => {
                let mut table = self.lock();
                table.reported.retain(|(_, other)| other != guid);
                table.peers.lost(*guid);
            }
            Discovery::Joined(guid) => self.lock().peers.joined(*guid, Instant::now()),
            Discovery::Left(guid) => self.lock().peers.left(*guid),
        }
    }

    /// Returns the reason why the node must join anew.
    pub(super) fn failure(&self) -> Option<String> {
        let has_incomplete = self.lock().peers.has_incomplete(Instant::now());
        has_incomplete.then(|| {
            "a peer returned after it was silent for longer than its lease, and does not announce its endpoints again"
                .to_owned()
        })
    }

    /// Reports the own endpoints that cannot work with another one, once for each pair.
    fn meet(&self, other: &RemoteEndpoint) {
        let mut table = self.lock();
        let Table { own, reported, peers } = &mut *table;
        if own.values().any(|own| is_counterpart(own, other)) {
            peers.found(other.guid);
        }
        let mut faults = Vec::new();
        for (guid, own) in own {
            let Some(problem) = problem(own, other) else { continue };
            if !reported.insert((*guid, other.guid)) {
                continue;
            }
            tracing::warn!("{}: {}", own.topic, problem.text());
            if let (Problem::ForeignType(_), Some(on_fault)) = (&problem, &own.faults) {
                faults.push((Arc::clone(on_fault), problem.text()));
            }
        }
        drop(table);
        for (on_fault, text) in faults {
            on_fault(Fault::Foreign(text));
        }
    }
}

/// Why two endpoints of one topic do not work together.
enum Problem {
    ForeignType(String),
    Terms(String),
}

impl Problem {
    fn text(&self) -> String {
        let (Self::ForeignType(text) | Self::Terms(text)) = self;
        text.clone()
    }
}

/// True for a writer and a reader of one topic.
fn is_counterpart(own: &Own, other: &RemoteEndpoint) -> bool {
    let is_opposite = (own.side == Side::Writer) == (other.side == cyclone_topics::Side::Reader);
    own.topic == other.topic && is_opposite
}

fn problem(own: &Own, other: &RemoteEndpoint) -> Option<Problem> {
    if !is_counterpart(own, other) {
        return None;
    }
    let is_writer = own.side == Side::Writer;
    if own.type_name != other.type_name {
        let (other, own) = (&other.type_name, &own.type_name);
        return Some(Problem::ForeignType(if is_writer {
            format!("a subscriber expects {other}, but {own} is sent")
        } else {
            format!("a publisher sends {other}, but {own} is expected")
        }));
    }
    let (offered, requested, what) = if is_writer {
        (&own.terms, &other.terms, "a subscriber receives nothing")
    } else {
        (&other.terms, &own.terms, "messages of a publisher are not received")
    };
    offered.conflict(requested)?;
    let (offered, requested) = (brief(offered), brief(requested));
    Some(Problem::Terms(format!("{what}: offered {offered}, requested {requested}")))
}

/// Formats the policies that can make ROS endpoints incompatible.
fn brief(terms: &Terms) -> String {
    let mut words = vec![
        match terms.reliability {
            Reliability::Reliable => "reliable",
            Reliability::BestEffort => "best effort",
        }
        .to_owned(),
        match terms.durability {
            Durability::TransientLocal => "transient local",
            Durability::Volatile => "volatile",
        }
        .to_owned(),
    ];
    words.extend(terms.deadline.map(|period| format!("deadline {period:?}")));
    words.extend(
        terms.liveliness_lease.map(|lease| format!("{:?} within {lease:?}", terms.liveliness)),
    );
    words.join(", ")
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::{msg::qos::QosProfile, ros::dds::cyclone::qos::convert};

    fn terms(profile: &QosProfile) -> Terms {
        convert(profile, Side::Writer, "").terms()
    }

    fn own(side: Side, profile: &QosProfile, faults: Option<OnFault>) -> Own {
        let (topic, type_name) = ("rt/x".to_owned(), "Image_".to_owned());
        Own { side, topic, type_name, terms: terms(profile), faults }
    }

    fn other(number: u8, side: cyclone_topics::Side, type_name: &str) -> RemoteEndpoint {
        RemoteEndpoint {
            guid: [number; 16],
            participant: [0; 16],
            side,
            topic: "rt/x".to_owned(),
            type_name: type_name.to_owned(),
            terms: terms(&QosProfile::reliable(1)),
            user_data: Vec::new(),
        }
    }

    #[test]
    fn a_publisher_of_another_type_is_one_fault_until_it_comes_back() {
        let faults = Arc::new(Mutex::new(Vec::new()));
        let seen = Arc::clone(&faults);
        let note: OnFault =
            Arc::new(move |fault: Fault| seen.lock().unwrap().push(fault.to_string()));
        let graph = Graph::default();
        let reader = own(Side::Reader, &QosProfile::reliable(1), Some(note));
        graph.lock().own.insert([1; 16], reader);
        let wrong = other(2, cyclone_topics::Side::Writer, "Centerline_");
        for endpoint in [&wrong, &wrong, &other(3, cyclone_topics::Side::Writer, "Image_")] {
            graph.apply(&Discovery::Found(endpoint.clone()));
        }
        assert_eq!(
            *faults.lock().unwrap(),
            ["a publisher sends Centerline_, but Image_ is expected"]
        );
        graph.apply(&Discovery::Lost([2; 16]));
        graph.apply(&Discovery::Found(wrong));
        assert_eq!(faults.lock().unwrap().len(), 2);
    }

    #[test]
    fn terms_that_do_not_fit_are_stated() {
        let best_effort = own(Side::Writer, &QosProfile::best_effort(1), None);
        let reader = other(2, cyclone_topics::Side::Reader, "Image_");
        let text = problem(&best_effort, &reader).unwrap().text();
        assert_eq!(
            text,
            "a subscriber receives nothing: offered best effort, volatile, requested reliable, volatile"
        );
        let strict = Terms { deadline: Some(Duration::from_secs(1)), ..reader.terms };
        let strict = RemoteEndpoint { terms: strict, ..reader.clone() };
        let reliable = own(Side::Writer, &QosProfile::reliable(1), None);
        let text = problem(&reliable, &strict).unwrap().text();
        assert!(text.ends_with("requested reliable, volatile, deadline 1s"), "{text}");
        assert!(problem(&reliable, &reader).is_none());
    }

    #[test]
    fn the_same_side_and_other_topics_do_not_matter() {
        let writer = own(Side::Writer, &QosProfile::best_effort(1), None);
        assert!(problem(&writer, &other(2, cyclone_topics::Side::Writer, "Other_")).is_none());
        let elsewhere = RemoteEndpoint {
            topic: "rt/y".to_owned(),
            ..other(2, cyclone_topics::Side::Reader, "Other_")
        };
        assert!(problem(&writer, &elsewhere).is_none());
    }
}
