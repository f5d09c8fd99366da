//! A recording as the player reads it: from any time on, with a look at what comes next.

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

/// Messages of latched topics that are looked for before anything is shown.
const MAX_LATCHED: usize = 1000;
/// Maximum number of damaged places that are logged individually.
const MAX_TOLD: u64 = 10;
/// Initial distance of the search for the last image, nanoseconds.
const LOOK_BACK_NS: i64 = 1_000_000_000;

/// Messages in order of time, the next one in sight.
pub(super) struct Reader {
    messages: Messages,
    next: Option<RawMessage>,
    num_damaged: u64,
}

impl Reader {
    /// The messages of those topics from a time on.
    pub(super) fn new(bag: &BagReader, topics: &[String], from_ns: i64) -> Self {
        let messages = bag.messages(&Filter::topics(topics).from(from_ns));
        let mut reader = Self { messages, next: None, num_damaged: 0 };
        reader.advance();
        reader
    }

    /// The next message.
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
                    if self.num_damaged <= MAX_TOLD {
                        tracing::warn!("{error}");
                    }
                }
            }
        }
    }
}

/// Log time of the last message of those topics; `None`: there is none.
pub(super) fn last_time_ns(bag: &BagReader, topics: &[String]) -> Option<i64> {
    let (start_ns, end_ns) = bag.time_range_ns()?;
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

/// Topics shown as recorded: all except the measured images and the recomputed results.
pub(super) struct Passed(BTreeMap<String, Arc<Channel>>);

impl Passed {
    /// Serves the topics of a recording that are not among `own`. Images are shown as they are where that is wanted.
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
            // Two of one name differ in type or QoS: the first is shown.
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

    /// Latched messages from the beginning apply to every later time.
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

    /// The topics.
    pub(super) fn topics(&self) -> impl Iterator<Item = &String> {
        self.0.keys()
    }

    /// Shows a message if a viewer has subscribed to it.
    pub(super) fn pass(&self, message: &RawMessage) {
        let Some(channel) = self.0.get(&message.topic.name) else { return };
        if message.topic.is_latched() {
            channel.send(&Arc::from(message.data.as_slice()), message.log_time_ns);
        } else {
            channel.send_once(&message.data, message.log_time_ns);
        }
    }
}
