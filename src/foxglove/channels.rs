//! Topics that viewers can subscribe to. Messages without subscribers are not sent.

use std::{
    collections::{BTreeMap, VecDeque},
    sync::{
        Arc, Mutex, Weak,
        atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering},
    },
};

use super::{
    ViewError,
    outbox::TopicMessage,
    protocol::{AdvertisedChannel, Reply, Subscription},
    viewers::{Viewer, Viewers, lock},
};

/// Bytes of all messages that are kept for late viewers. Beyond it the oldest of a topic are not kept.
const MAX_KEPT_BYTES: usize = 64 << 20;

/// Description of a topic for viewers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ChannelDescription {
    /// Absolute name.
    pub(crate) name: String,
    /// Full name of the type, for example `sensor_msgs/msg/Image`.
    pub(crate) type_name: String,
    /// Definition of the type and its dependencies in the `ros2msg` format.
    pub(crate) schema: Vec<u8>,
    /// Number of last messages that late viewers receive; 0 for a stream, 1 or more for a latched topic.
    pub(crate) num_kept: usize,
}

/// A topic that is served. Dropping it removes it from viewers.
pub(crate) struct Channel {
    id: u64,
    topic: ChannelDescription,
    subscribers: Mutex<Vec<(u32, Arc<Viewer>)>>,
    num_subscribers: AtomicUsize,
    kept: Mutex<VecDeque<(u64, Arc<[u8]>)>>,
    was_loss_reported: AtomicBool,
    shared: Arc<Shared>,
}

/// State shared by all topics.
#[derive(Default)]
struct Shared {
    viewers: Arc<Viewers>,
    /// Number of messages sent.
    num_sent: AtomicU64,
    num_kept_bytes: AtomicUsize,
}

impl Channel {
    /// True if a viewer is subscribed.
    pub(crate) fn is_wanted(&self) -> bool {
        self.num_subscribers.load(Ordering::Relaxed) > 0
    }

    /// Sends CDR bytes to the subscribed viewers and keeps them for late ones. `time_ns` is the log time, nanoseconds
    /// since the epoch.
    pub(crate) fn send(&self, data: &Arc<[u8]>, time_ns: i64) {
        let time_ns = time_of(time_ns);
        self.keep(data, time_ns);
        self.log(data, time_ns);
    }

    /// Like [`send`](Self::send), but keeps nothing for late viewers.
    pub(crate) fn send_once(&self, data: &[u8], time_ns: i64) {
        if self.is_wanted() {
            self.log(&Arc::from(data), time_of(time_ns));
        }
    }

    fn keep(&self, data: &Arc<[u8]>, time_ns: u64) {
        if self.topic.num_kept == 0 {
            return;
        }
        let kept_bytes = &self.shared.num_kept_bytes;
        let mut kept = lock(&self.kept);
        kept_bytes.fetch_add(data.len(), Ordering::Relaxed);
        kept.push_back((time_ns, Arc::clone(data)));
        while kept.len() > self.topic.num_kept
            || kept_bytes.load(Ordering::Relaxed) > MAX_KEPT_BYTES
        {
            let Some((_, oldest)) = kept.pop_front() else { break };
            kept_bytes.fetch_sub(oldest.len(), Ordering::Relaxed);
        }
        let is_lost = kept.is_empty();
        drop(kept);
        if is_lost && !self.was_loss_reported.swap(true, Ordering::Relaxed) {
            tracing::warn!(
                "--view: {}: the last message is not kept for viewers that subscribe later: all topics together may keep \
                 {} MiB",
                self.topic.name,
                MAX_KEPT_BYTES >> 20
            );
        }
    }

    fn log(&self, data: &Arc<[u8]>, time_ns: u64) {
        for (subscription, viewer) in &*lock(&self.subscribers) {
            self.send_to(viewer, *subscription, time_ns, data);
        }
    }

    fn send_to(&self, viewer: &Viewer, subscription: u32, time_ns: u64, data: &Arc<[u8]>) {
        self.shared.num_sent.fetch_add(1, Ordering::Relaxed);
        let data = Arc::clone(data);
        viewer.outbox.push_topic(TopicMessage { subscription, time_ns, data });
    }

    fn add(&self, subscription: u32, viewer: &Arc<Viewer>) {
        let mut subscribers = lock(&self.subscribers);
        for (time_ns, data) in &*lock(&self.kept) {
            self.send_to(viewer, subscription, *time_ns, data);
        }
        subscribers.push((subscription, Arc::clone(viewer)));
        self.num_subscribers.store(subscribers.len(), Ordering::Relaxed);
    }

    fn remove(&self, viewer: &Viewer) {
        let mut subscribers = lock(&self.subscribers);
        subscribers.retain(|(_, other)| other.id != viewer.id);
        self.num_subscribers.store(subscribers.len(), Ordering::Relaxed);
    }

    fn advertised(&self) -> AdvertisedChannel<'_> {
        AdvertisedChannel {
            id: self.id,
            topic: &self.topic.name,
            encoding: "cdr",
            schema_name: &self.topic.type_name,
            schema_encoding: "ros2msg",
            // Checked when the topic was opened.
            schema: str::from_utf8(&self.topic.schema).unwrap_or_default(),
        }
    }
}

impl Drop for Channel {
    fn drop(&mut self) {
        let bytes: usize = lock(&self.kept).iter().map(|(_, data)| data.len()).sum();
        self.shared.num_kept_bytes.fetch_sub(bytes, Ordering::Relaxed);
        for (subscription, viewer) in &*lock(&self.subscribers) {
            lock(&viewer.subscriptions).remove(subscription);
        }
        self.shared.viewers.tell(&Reply::Unadvertise { channel_ids: &[self.id] });
    }
}

/// Converts a time to the viewers' unsigned form; times before 1970 become 0.
fn time_of(time_ns: i64) -> u64 {
    u64::try_from(time_ns).unwrap_or(0)
}

/// All topics that are served.
pub(super) struct Channels {
    state: Mutex<Served>,
    shared: Arc<Shared>,
}

#[derive(Default)]
struct Served {
    by_id: BTreeMap<u64, Weak<Channel>>,
    num_opened: u64,
}

impl Channels {
    pub(super) fn new(viewers: Arc<Viewers>) -> Self {
        let shared = Arc::new(Shared { viewers, ..Shared::default() });
        Self { state: Mutex::default(), shared }
    }

    /// Serves a topic. Publishers of the same topic share its channel, for example all cameras on `/diagnostics`.
    pub(super) fn open(&self, topic: ChannelDescription) -> Result<Arc<Channel>, ViewError> {
        if str::from_utf8(&topic.schema).is_err() {
            return Err(ViewError::Schema(topic.name));
        }
        let mut state = lock(&self.state);
        state.by_id.retain(|_, channel| channel.strong_count() > 0);
        let mut served = state.by_id.values().filter_map(Weak::upgrade);
        if let Some(channel) = served.find(|channel| channel.topic == topic) {
            return Ok(channel);
        }
        state.num_opened += 1;
        let channel = Arc::new(Channel {
            id: state.num_opened,
            topic,
            subscribers: Mutex::default(),
            num_subscribers: AtomicUsize::new(0),
            kept: Mutex::default(),
            was_loss_reported: AtomicBool::new(false),
            shared: Arc::clone(&self.shared),
        });
        state.by_id.insert(channel.id, Arc::downgrade(&channel));
        self.shared.viewers.tell(&Reply::Advertise { channels: vec![channel.advertised()] });
        drop(state);
        Ok(channel)
    }

    /// Lets a viewer in with `admit`, and tells it every topic once.
    pub(super) fn introduce(&self, admit: impl FnOnce() -> Arc<Viewer>) -> Arc<Viewer> {
        // A topic is opened either before, and told here, or after, and told to all.
        let state = lock(&self.state);
        let viewer = admit();
        for channel in state.by_id.values().filter_map(Weak::upgrade) {
            viewer.tell(&Reply::Advertise { channels: vec![channel.advertised()] });
        }
        drop(state);
        viewer
    }

    /// Subscribes a viewer to a topic and sends it the kept messages. Returns the topic's name.
    ///
    /// # Errors
    /// There is no such topic, or it is subscribed already.
    pub(super) fn subscribe(
        &self,
        viewer: &Arc<Viewer>,
        Subscription { id, channel_id }: Subscription,
    ) -> Result<String, String> {
        let channel = self.get(channel_id).ok_or(format!("there is no topic {channel_id}"))?;
        {
            let mut subscriptions = lock(&viewer.subscriptions);
            if subscriptions.contains_key(&id) || subscriptions.values().any(|it| *it == channel_id)
            {
                let name = &channel.topic.name;
                return Err(format!("subscription {id} to {name}: there is one already"));
            }
            subscriptions.insert(id, channel_id);
        }
        channel.add(id, viewer);
        Ok(channel.topic.name.clone())
    }

    /// Ends a subscription. Nothing happens if there is none of this number.
    pub(super) fn unsubscribe(&self, viewer: &Viewer, id: u32) {
        // Unlocked before the topics are locked: a topic that closes meanwhile locks the subscriptions.
        let channel_id = lock(&viewer.subscriptions).remove(&id);
        if let Some(channel) = channel_id.and_then(|id| self.get(id)) {
            channel.remove(viewer);
        }
    }

    /// Ends all subscriptions of a viewer.
    pub(super) fn leave(&self, viewer: &Viewer) {
        let ids: Vec<_> = lock(&viewer.subscriptions).keys().copied().collect();
        for id in ids {
            self.unsubscribe(viewer, id);
        }
    }

    /// Number of messages sent to viewers so far.
    pub(super) fn num_sent(&self) -> u64 {
        self.shared.num_sent.load(Ordering::Relaxed)
    }

    fn get(&self, id: u64) -> Option<Arc<Channel>> {
        lock(&self.state).by_id.get(&id).and_then(Weak::upgrade)
    }
}

#[cfg(test)]
mod tests {
    use super::{super::access::Rights, *};

    fn topic(name: &str) -> ChannelDescription {
        ChannelDescription {
            name: name.to_owned(),
            type_name: "std_msgs/msg/String".to_owned(),
            schema: b"string data".to_vec(),
            num_kept: 2,
        }
    }

    #[test]
    fn publishers_of_one_topic_share_a_channel_until_the_last_is_dropped() {
        let channels = Channels::new(Arc::default());
        let first = channels.open(topic("/a")).unwrap();
        let second = channels.open(topic("/a")).unwrap();
        assert!(Arc::ptr_eq(&first, &second));
        assert!(!Arc::ptr_eq(&first, &channels.open(topic("/b")).unwrap()));
        let id = first.id;
        drop((first, second));
        assert_ne!(channels.open(topic("/a")).unwrap().id, id, "it was closed");
    }

    #[test]
    fn the_last_messages_are_kept_and_none_is_sent_without_subscribers() {
        let channels = Channels::new(Arc::default());
        let channel = channels.open(topic("/a")).unwrap();
        for number in 1..=3 {
            channel.send(&Arc::from([number]), i64::from(number));
        }
        let kept: Vec<_> =
            lock(&channel.kept).iter().map(|(time, data)| (*time, data[0])).collect();
        assert_eq!(kept, [(2, 2), (3, 3)]);
        assert!(!channel.is_wanted());
        assert_eq!(channels.num_sent(), 0);
    }

    #[test]
    fn kept_messages_of_all_topics_take_bounded_memory() {
        let channels = Channels::new(Arc::default());
        let large: Arc<[u8]> = vec![0; 1 << 20].into();
        let opened: Vec<_> = (0..100).map(|n| channels.open(topic(&format!("/{n}")))).collect();
        for channel in opened.iter().flatten().chain(opened.iter().flatten()) {
            channel.send(&large, 1);
        }
        let kept = || channels.shared.num_kept_bytes.load(Ordering::Relaxed);
        assert!(kept() <= MAX_KEPT_BYTES && kept() > MAX_KEPT_BYTES / 2, "{}", kept());
        let reported =
            opened.iter().flatten().filter(|it| it.was_loss_reported.load(Ordering::Relaxed));
        assert_eq!(reported.count(), 100 - (MAX_KEPT_BYTES >> 20), "those that keep nothing");
        drop(opened);
        assert_eq!(kept(), 0);
    }

    #[test]
    fn a_viewer_subscribes_once_and_leaves_nothing_behind() {
        let viewers = Arc::new(Viewers::default());
        let channels = Channels::new(Arc::clone(&viewers));
        let channel = channels.open(topic("/a")).unwrap();
        let viewer = channels.introduce(|| viewers.add(Rights::Look));
        let wish = Subscription { id: 1, channel_id: channel.id };
        assert_eq!(channels.subscribe(&viewer, wish).unwrap(), "/a");
        for again in [wish, Subscription { id: 2, ..wish }, Subscription { id: 3, channel_id: 9 }] {
            assert!(channels.subscribe(&viewer, again).is_err(), "{again:?}");
        }
        assert!(channel.is_wanted());
        channels.leave(&viewer);
        assert!(!channel.is_wanted() && lock(&viewer.subscriptions).is_empty());
        channels.subscribe(&viewer, wish).unwrap();
        drop(channel);
        assert!(lock(&viewer.subscriptions).is_empty(), "the topic is gone");
    }
}
