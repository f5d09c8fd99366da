//! Publishers and subscribers of the network, from liveliness tokens.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use hiroz_protocol::format::rmw_zenoh::ros_type_name;
use tracing::warn;
use zenoh::{
    Session, Wait,
    pubsub::Subscriber,
    sample::{Sample, SampleKind},
};

use crate::ros::transport::GraphTopic;

/// Side of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Publisher,
    Subscriber,
}

/// One publisher or subscriber, parsed from its token.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Seen {
    side: Side,
    node: String,
    topic: String,
    /// Type on the wire, such as `sensor_msgs::msg::dds_::Image_`.
    wire_type: String,
    hash: String,
}

impl Seen {
    /// Parses a token; `None` for nodes, services, clients and kinds of later versions.
    fn parse(token: &str) -> Option<Self> {
        let mut chunks = token.split('/');
        let side = match chunks.nth(5)? {
            "MP" => Side::Publisher,
            "MS" => Side::Subscriber,
            _ => return None,
        };
        let mut chunks = chunks.skip(1).map(|chunk| chunk.replace('%', "/"));
        let (namespace, name) = (chunks.next()?, chunks.next()?);
        let node = format!("{}/{name}", namespace.trim_end_matches('/'));
        let (topic, wire_type, hash) = (chunks.next()?, chunks.next()?, chunks.next()?);
        Some(Self { side, node, topic, wire_type, hash })
    }

    /// Returns the key of its messages.
    fn data_key(&self, domain_id: u32) -> String {
        let Self { topic, wire_type, hash, .. } = self;
        format!("{domain_id}/{}/{wire_type}/{hash}", topic.trim_matches('/'))
    }
}

#[derive(Default)]
struct Known {
    by_token: BTreeMap<String, Seen>,
    /// Keys of the messages of subscribed topics, by topic.
    expected: BTreeMap<String, String>,
}

/// The graph, kept up to date by Zenoh until it is dropped.
pub(super) struct Graph {
    known: Arc<Mutex<Known>>,
    domain_id: u32,
    _subscriber: Subscriber<()>,
}

impl Graph {
    /// Starts to observe the graph. Existing endpoints become known shortly after.
    pub(super) fn watch(session: &Session, domain_id: u32) -> zenoh::Result<Self> {
        let known = Arc::new(Mutex::new(Known::default()));
        let noted = Arc::clone(&known);
        let subscriber = session
            .liveliness()
            .declare_subscriber(format!("@ros2_lv/{domain_id}/**"))
            .history(true)
            .callback(move |sample| note(&mut lock(&noted), domain_id, &sample))
            .wait()?;
        Ok(Self { known, domain_id, _subscriber: subscriber })
    }

    /// Returns the number of publishers or subscribers with that message key.
    pub(super) fn num_on(&self, side: Side, data_key: &str) -> usize {
        let known = lock(&self.known);
        let matches = |seen: &&Seen| seen.side == side && seen.data_key(self.domain_id) == data_key;
        known.by_token.values().filter(matches).count()
    }

    /// From now on, warns of publishers of a topic whose messages do not arrive on this key.
    pub(super) fn expect(&self, topic: &str, data_key: &str) {
        let mut known = lock(&self.known);
        known.expected.insert(topic.to_owned(), data_key.to_owned());
        for seen in known.by_token.values().filter(|seen| seen.topic == topic) {
            warn_of_mismatch(&known.expected, self.domain_id, seen);
        }
    }

    /// Returns all topics, by name and type.
    pub(super) fn topics(&self) -> Vec<GraphTopic> {
        let mut counts = BTreeMap::<_, (usize, usize)>::new();
        for seen in lock(&self.known).by_token.values() {
            let topic = (seen.topic.clone(), ros_type_name(&seen.wire_type));
            let (num_publishers, num_subscribers) = counts.entry(topic).or_default();
            match seen.side {
                Side::Publisher => *num_publishers += 1,
                Side::Subscriber => *num_subscribers += 1,
            }
        }
        let topic = |((name, type_name), (num_publishers, num_subscribers))| GraphTopic {
            name,
            type_name,
            num_publishers,
            num_subscribers,
        };
        counts.into_iter().map(topic).collect()
    }
}

fn lock(known: &Mutex<Known>) -> MutexGuard<'_, Known> {
    known.lock().unwrap_or_else(PoisonError::into_inner)
}

fn note(known: &mut Known, domain_id: u32, sample: &Sample) {
    let token = sample.key_expr().as_str();
    if sample.kind() == SampleKind::Delete {
        known.by_token.remove(token);
    } else if let Some(seen) = Seen::parse(token) {
        warn_of_mismatch(&known.expected, domain_id, &seen);
        known.by_token.insert(token.to_owned(), seen);
    }
}

fn warn_of_mismatch(expected: &BTreeMap<String, String>, domain_id: u32, seen: &Seen) {
    if let Some(text) = mismatch(expected, domain_id, seen) {
        warn!("{text}");
    }
}

/// Returns a warning for a publisher of a subscribed topic with another type or type version.
fn mismatch(expected: &BTreeMap<String, String>, domain_id: u32, seen: &Seen) -> Option<String> {
    let Seen { node, topic, .. } = seen;
    let expected = expected.get(topic).filter(|_| seen.side == Side::Publisher)?;
    let offered = seen.data_key(domain_id);
    (offered != *expected).then(|| {
        format!(
            "{node} publishes {topic} with another type or type version, and its messages do not arrive here: it sends \
             {offered}, but {expected} is expected. Install the same message package on both sides"
        )
    })
}

/// Parses the key of a token.
#[cfg(fuzzing)]
pub(super) fn fuzz(token: &str) {
    if let Some(seen) = Seen::parse(token) {
        drop(seen.data_key(0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOKEN: &str = "@ros2_lv/7/12ab/0/3/MP/%/%cell/camera/%camera%image_raw/\
                         sensor_msgs::msg::dds_::Image_/RIHS01_d3/2::,5:,:,:,,";

    #[test]
    fn a_token_names_node_topic_and_type() {
        let seen = Seen::parse(TOKEN).unwrap();
        assert_eq!(seen.side, Side::Publisher);
        assert_eq!(
            (seen.node.as_str(), seen.topic.as_str()),
            ("/cell/camera", "/camera/image_raw")
        );
        assert_eq!(seen.data_key(7), "7/camera/image_raw/sensor_msgs::msg::dds_::Image_/RIHS01_d3");
        let rootless = TOKEN.replace("%cell", "%");
        assert_eq!(Seen::parse(&rootless).unwrap().node, "/camera");
    }

    #[test]
    fn tokens_of_later_versions_are_parsed() {
        let seen = Seen::parse(TOKEN);
        assert_eq!(Seen::parse(&format!("{TOKEN}/backends:cpu:")), seen);
        assert_eq!(Seen::parse(&TOKEN.replace("2::,5:,:,:,,", "9:x")), seen);
        for other in ["NN", "SS", "SC", "XX"] {
            assert_eq!(Seen::parse(&TOKEN.replace("MP", other)), None);
        }
        for end in 0..TOKEN.len() {
            // Complete only with the hash.
            assert_eq!(Seen::parse(&TOKEN[..end]).is_some(), end > TOKEN.find("/RIHS").unwrap());
        }
    }

    #[test]
    fn publishers_of_another_version_are_reported() {
        let seen = Seen::parse(TOKEN).unwrap();
        let expected = BTreeMap::from([(seen.topic.clone(), seen.data_key(7))]);
        let warning = |token: &str| mismatch(&expected, 7, &Seen::parse(token).unwrap());
        assert_eq!(warning(TOKEN), None);
        let other = TOKEN.replace("RIHS01_d3", "TypeHashNotSupported");
        let text = warning(&other).unwrap();
        assert!(
            text.starts_with("/cell/camera publishes /camera/image_raw with another"),
            "{text}"
        );
        assert!(text.contains("Image_/TypeHashNotSupported, but 7/camera"), "{text}");
        assert_eq!(warning(&other.replace("/MP/", "/MS/")), None);
        assert_eq!(warning(&other.replace("image_raw", "other")), None);
    }
}
