//! The publishers, subscribers and services of the graph, for viewers.

use std::{
    collections::BTreeMap,
    sync::{Mutex, atomic::Ordering},
};

use super::{
    protocol::{GraphTopic, Reply},
    viewers::{Viewer, Viewers, lock},
};

/// Publishers and subscribers of each topic.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ConnectionGraph(BTreeMap<String, Ends>);

#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Ends {
    publishers: Vec<String>,
    subscribers: Vec<String>,
}

impl ConnectionGraph {
    /// Adds a topic.
    pub fn add(&mut self, topic: String, publishers: Vec<String>, subscribers: Vec<String>) {
        self.0.insert(topic, Ends { publishers, subscribers });
    }

    /// Returns the message that brings a viewer from an earlier graph to this one.
    fn update<'a>(&'a self, before: &'a Self) -> Reply<'a> {
        let changed = || self.0.iter().filter(|(name, ends)| before.0.get(*name) != Some(ends));
        let published = changed().map(|(name, ends)| GraphTopic {
            name,
            publisher_ids: Some(&ends.publishers),
            subscriber_ids: None,
        });
        let subscribed = changed().map(|(name, ends)| GraphTopic {
            name,
            publisher_ids: None,
            subscriber_ids: Some(&ends.subscribers),
        });
        let removed = before.0.keys().filter(|name| !self.0.contains_key(*name));
        Reply::ConnectionGraphUpdate {
            published_topics: published.collect(),
            subscribed_topics: subscribed.collect(),
            advertised_services: [],
            removed_topics: removed.map(String::as_str).collect(),
            removed_services: [],
        }
    }
}

/// The graph that viewers have.
#[derive(Default)]
pub(super) struct Graph(Mutex<ConnectionGraph>);

impl Graph {
    /// Reports changes to a viewer from now on.
    pub(super) fn introduce(&self, viewer: &Viewer) {
        let graph = lock(&self.0);
        if !viewer.wants_graph.swap(true, Ordering::Relaxed) {
            viewer.tell(&graph.update(&ConnectionGraph::default()));
        }
    }

    /// Reports a graph to those that want it.
    pub(super) fn publish(&self, viewers: &Viewers, graph: ConnectionGraph) {
        let mut before = lock(&self.0);
        if *before != graph {
            let wanting =
                viewers.all().into_iter().filter(|it| it.wants_graph.load(Ordering::Relaxed));
            wanting.for_each(|viewer| viewer.tell(&graph.update(&before)));
            *before = graph;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph(topics: &[(&str, usize)]) -> ConnectionGraph {
        let mut graph = ConnectionGraph::default();
        for (name, num_publishers) in topics {
            graph.add((*name).to_owned(), vec!["p".to_owned(); *num_publishers], Vec::new());
        }
        graph
    }

    #[test]
    fn an_update_holds_what_has_changed() {
        let (before, after) =
            (graph(&[("/a", 1), ("/b", 1), ("/c", 1)]), graph(&[("/a", 1), ("/b", 2)]));
        let text = after.update(&before).encode();
        assert_eq!(
            text,
            r#"{"op":"connectionGraphUpdate","publishedTopics":[{"name":"/b","publisherIds":["p","p"]}],"#
                .to_owned()
                + r#""subscribedTopics":[{"name":"/b","subscriberIds":[]}],"advertisedServices":[],"#
                + r#""removedTopics":["/c"],"removedServices":[]}"#
        );
    }
}
