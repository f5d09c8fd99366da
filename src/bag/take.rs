//! Selects messages and converts records into them.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::RawMessage;
use super::channels::Channels;
use super::format::MessageHeader;

/// Selection of the messages to read.
#[derive(Clone, Debug, Default)]
pub struct Filter {
    topics: Option<BTreeSet<String>>,
    /// Earlier messages are passed over.
    start_time: u64,
}

impl Filter {
    /// Every topic.
    pub fn all() -> Self {
        Self::default()
    }

    /// These topics. Chunks without them are skipped if the index lists their channels.
    pub fn topics<Name: Into<String>>(names: impl IntoIterator<Item = Name>) -> Self {
        Self { topics: Some(names.into_iter().map(Into::into).collect()), start_time: 0 }
    }

    /// Only messages received at that time or later, nanoseconds since the epoch. Chunks that end before are not opened.
    #[must_use]
    pub(crate) fn from(self, start_ns: i64) -> Self {
        Self { start_time: u64::try_from(start_ns).unwrap_or(0), ..self }
    }

    pub(super) const fn start_time(&self) -> u64 {
        self.start_time
    }

    pub(super) fn takes(&self, topic: &str) -> bool {
        self.topics.as_ref().is_none_or(|topics| topics.contains(topic))
    }
}

/// Selects messages and reuses buffers for them.
pub(super) struct Taker<'a> {
    pub(super) channels: &'a Channels,
    pub(super) filter: &'a Filter,
    pub(super) spare: &'a mut Vec<Vec<u8>>,
}

impl Taker<'_> {
    /// The message in a record's body with its channel, when the filter takes it.
    ///
    /// # Errors
    /// A malformed message record; the text describes the fault.
    pub(super) fn take(&mut self, body: &[u8]) -> Result<Option<(u16, RawMessage)>, String> {
        let Some((header, data)) = MessageHeader::split(body) else {
            return Err("a message record shorter than its header".into());
        };
        let message = self.empty(&header)?;
        Ok(message.map(|mut message| {
            message.data.clear();
            message.data.extend_from_slice(data);
            (header.channel, message)
        }))
    }

    /// A message with that header, when the filter takes it. Its data is whatever the buffer held before.
    ///
    /// # Errors
    /// A malformed message record; the text describes the fault.
    pub(super) fn empty(&mut self, header: &MessageHeader) -> Result<Option<RawMessage>, String> {
        let Some(topic) = self.channels.get(header.channel) else {
            let channel = header.channel;
            return Err(format!("messages on channel {channel}, which no record describes"));
        };
        if header.log_time < self.filter.start_time || !self.filter.takes(&topic.name) {
            return Ok(None);
        }
        let time_ns = |time: u64| {
            i64::try_from(time)
                .map_err(|_beyond| format!("{}: a time beyond the year 2262", topic.name))
        };
        Ok(Some(RawMessage {
            topic: Arc::clone(topic),
            log_time_ns: time_ns(header.log_time)?,
            publish_time_ns: time_ns(header.publish_time)?,
            sequence: header.sequence,
            data: self.spare.pop().unwrap_or_default(),
        }))
    }
}
