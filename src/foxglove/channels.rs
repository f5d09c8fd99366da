//! Topics that viewers can subscribe to. Messages without subscribers are not sent.

use std::{
    collections::{BTreeMap, VecDeque},
    sync::{
        Arc, Mutex, MutexGuard, PoisonError, Weak,
        atomic::{AtomicU64, Ordering},
    },
};

use foxglove::{ChannelBuilder, Context, PartialMetadata, RawChannel, Schema, SinkId};

use super::ViewError;

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
    raw: Arc<RawChannel>,
    topic: ChannelDescription,
    kept: Mutex<VecDeque<(u64, Arc<[u8]>)>>,
    /// Number of messages sent on all channels.
    num_sent: Arc<AtomicU64>,
}

impl Channel {
    /// True if a viewer is subscribed.
    pub(crate) fn is_wanted(&self) -> bool {
        self.raw.has_sinks()
    }

    /// Sends CDR bytes to the subscribed viewers and keeps them for late ones. `time_ns` is the log time, nanoseconds
    /// since the epoch.
    pub(crate) fn send(&self, data: &Arc<[u8]>, time_ns: i64) {
        let time = time_of(time_ns);
        if self.topic.num_kept > 0 {
            let mut kept = self.kept();
            if kept.len() == self.topic.num_kept {
                kept.pop_front();
            }
            kept.push_back((time, Arc::clone(data)));
        }
        if self.is_wanted() {
            self.log(data, time, None);
        }
    }

    /// Like [`send`](Self::send), but keeps nothing for late viewers.
    pub(crate) fn send_once(&self, data: &[u8], time_ns: i64) {
        if self.is_wanted() {
            self.log(data, time_of(time_ns), None);
        }
    }

    fn resend(&self, viewer: Option<SinkId>) {
        for (time, data) in self.kept().iter() {
            self.log(data, *time, viewer);
        }
    }

    fn log(&self, data: &[u8], time: u64, viewer: Option<SinkId>) {
        self.num_sent.fetch_add(1, Ordering::Relaxed);
        self.raw.log_with_meta_to_sink(data, PartialMetadata::with_log_time(time), viewer);
    }

    fn kept(&self) -> MutexGuard<'_, VecDeque<(u64, Arc<[u8]>)>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Channel {
    fn drop(&mut self) {
        self.raw.close();
    }
}

/// Converts a time to the viewers' unsigned form; times before 1970 become 0.
fn time_of(time_ns: i64) -> u64 {
    u64::try_from(time_ns).unwrap_or(0)
}

/// All topics that are served.
pub(super) struct Channels {
    pub(super) context: Arc<Context>,
    by_id: Mutex<BTreeMap<u64, Weak<Channel>>>,
    num_sent: Arc<AtomicU64>,
}

impl Channels {
    pub(super) fn new() -> Self {
        Self { context: Context::new(), by_id: Mutex::default(), num_sent: Arc::default() }
    }

    /// Serves a topic. Publishers of the same topic share its channel, for example all cameras on `/diagnostics`.
    pub(super) fn open(&self, topic: ChannelDescription) -> Result<Arc<Channel>, ViewError> {
        let mut by_id = self.lock();
        by_id.retain(|_, channel| channel.strong_count() > 0);
        let mut served = by_id.values().filter_map(Weak::upgrade);
        if let Some(channel) = served.find(|channel| channel.topic == topic) {
            return Ok(channel);
        }
        let schema = Schema::new(topic.type_name.as_str(), "ros2msg", topic.schema.clone());
        let raw = ChannelBuilder::new(topic.name.as_str())
            .context(&self.context)
            .message_encoding("cdr")
            .schema(schema)
            .build_raw()?;
        let id = u64::from(raw.id());
        let (kept, num_sent) = (Mutex::default(), Arc::clone(&self.num_sent));
        let channel = Arc::new(Channel { raw, topic, kept, num_sent });
        by_id.insert(id, Arc::downgrade(&channel));
        Ok(channel)
    }

    /// Sends the kept messages to a new subscriber.
    pub(super) fn resend(&self, id: u64, viewer: Option<SinkId>) {
        let channel = self.lock().get(&id).and_then(Weak::upgrade);
        if let Some(channel) = channel {
            channel.resend(viewer);
        }
    }

    /// Number of messages sent to viewers so far.
    pub(super) fn num_sent(&self) -> u64 {
        self.num_sent.load(Ordering::Relaxed)
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<u64, Weak<Channel>>> {
        self.by_id.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let channels = Channels::new();
        let first = channels.open(topic("/a")).unwrap();
        let second = channels.open(topic("/a")).unwrap();
        assert!(Arc::ptr_eq(&first, &second));
        assert!(!Arc::ptr_eq(&first, &channels.open(topic("/b")).unwrap()));
        let id = first.raw.id();
        drop((first, second));
        assert_ne!(channels.open(topic("/a")).unwrap().raw.id(), id, "it was closed");
    }

    #[test]
    fn the_last_messages_are_kept_and_none_is_sent_without_subscribers() {
        let channels = Channels::new();
        let channel = channels.open(topic("/a")).unwrap();
        for number in 1..=3 {
            channel.send(&Arc::from([number]), i64::from(number));
        }
        let kept: Vec<_> = channel.kept().iter().map(|(time, data)| (*time, data[0])).collect();
        assert_eq!(kept, [(2, 2), (3, 3)]);
        assert!(!channel.is_wanted());
        assert_eq!(channels.num_sent(), 0);
    }
}
