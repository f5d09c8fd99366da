//! Reads a recording for the player: from any time on, with a preview of the next message.

use std::{collections::BTreeMap, sync::Arc};

use crate::{
    bag::{BagReader, Filter, Messages, RawMessage},
    foxglove::{Channel, Server, ViewError},
    msg::{
        schema::Message,
        sensor_msgs::{CompressedImage, Image},
    },
};

use super::{Images, serve_recorded};

/// Maximum number of latched messages that are served before playback.
const MAX_LATCHED: usize = 1000;
/// Maximum number of damaged places that are logged individually.
const MAX_REPORTED: u64 = 10;
/// Initial length of the search for the last image, nanoseconds before the end.
const LOOK_BACK_NS: i64 = 1_000_000_000;

/// Messages in order of time; the next one can be inspected.
pub(super) struct Reader {
    messages: Messages,
    next: Option<RawMessage>,
    num_damaged: u64,
}

impl Reader {
    /// Reads the messages of those topics from a log time on.
    pub(super) fn new(bag: &BagReader, topics: &[String], from_ns: i64) -> Self {
        let messages = bag.messages(&Filter::topics(topics).from(from_ns));
        let mut reader = Self { messages, next: None, num_damaged: 0 };
        reader.advance();
        reader
    }

    /// Returns the next message without taking it.
    pub(super) const fn peek(&self) -> Option<&RawMessage> {
        self.next.as_ref()
    }

    /// Takes the next message.
    pub(super) fn take(&mut self) -> Option<RawMessage> {
        let taken = self.next.take();
        self.advance();
        taken
    }

    fn advance(&mut self) {
        self.next = None;
        for message in &mut self.messages {
            match message {
                Ok(message) => {
                    self.next = Some(message);
                    return;
                }
                Err(error) => {
                    self.num_damaged += 1;
                    if self.num_damaged <= MAX_REPORTED {
                        tracing::warn!("{error}");
                    }
                }
            }
        }
    }
}

/// Log time of the last message of those topics, nanoseconds since the epoch; `None` if there is none.
pub(super) fn last_time_ns(bag: &BagReader, topics: &[String]) -> Option<i64> {
    let (start_ns, end_ns) = bag.time_range_ns()?.into_inner();
    let mut look_back_ns = LOOK_BACK_NS;
    loop {
        let from_ns = end_ns.saturating_sub(look_back_ns).max(start_ns);
        let found = bag.messages(&Filter::topics(topics).from(from_ns));
        let last_ns = found.filter_map(Result::ok).map(|message| message.log_time_ns).last();
        if last_ns.is_some() || from_ns == start_ns {
            return last_ns;
        }
        look_back_ns = look_back_ns.saturating_mul(4);
    }
}

/// Channels of the topics that are shown as recorded: all except the measured images and the recomputed results.
pub(super) struct Passed(BTreeMap<String, Arc<Channel>>);

impl Passed {
    /// Serves the topics of a recording for which `own` is false; images only if `images` allows them.
    pub(super) fn open(
        server: &Server,
        bag: &BagReader,
        images: Images,
        own: impl Fn(&str) -> bool,
    ) -> Result<Self, ViewError> {
        let mut passed = BTreeMap::new();
        for topic in bag.topics() {
            let is_image =
                [Image::TYPE.name, CompressedImage::TYPE.name].contains(&topic.type_name.as_str());
            let is_shown = !own(&topic.name) && (!is_image || images != Images::None);
            // Topics of the same name differ in type or QoS: the first is shown.
            if is_shown && topic.require_cdr().is_ok() && !passed.contains_key(&topic.name) {
                passed.insert(topic.name.clone(), serve_recorded(server, topic)?);
            }
        }
        let passed = Self(passed);
        if bag.is_indexed() {
            passed.begin_with_latched(bag);
        }
        Ok(passed)
    }

    /// Serves the first latched messages of the recording, which apply to every later time.
    fn begin_with_latched(&self, bag: &BagReader) {
        let latched = bag.topics().iter().filter(|topic| topic.is_latched());
        let names: Vec<_> = latched
            .map(|topic| topic.name.clone())
            .filter(|name| self.0.contains_key(name))
            .collect();
        if names.is_empty() {
            return;
        }
        let messages = bag.messages(&Filter::topics(names)).filter_map(Result::ok);
        messages.take(MAX_LATCHED).for_each(|message| self.pass(&message));
    }

    /// Names of the topics.
    pub(super) fn topics(&self) -> impl Iterator<Item = &String> {
        self.0.keys()
    }

    /// Sends a message to its viewers if its topic is shown as recorded.
    pub(super) fn pass(&self, message: &RawMessage) {
        let Some(channel) = self.0.get(&message.topic.name) else { return };
        if message.topic.is_latched() {
            channel.send(&Arc::from(message.data.as_slice()), message.log_time_ns);
        } else {
            channel.send_once(&message.data, message.log_time_ns);
        }
    }
}
