//! Selects messages and converts records into messages.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::RawMessage;
use super::channels::Channels;
use super::format::MessageHeader;

/// Selection of the messages to read.
#[derive(Clone, Debug, Default)]
pub struct Filter {
    topics: Option<BTreeSet<String>>,
    /// Earlier messages are skipped, nanoseconds since the epoch.
    start_time: u64,
}

impl Filter {
    /// Selects every topic.
    pub fn all() -> Self {
        Self::default()
    }

    /// Selects these topics. Chunks without them are skipped if the index lists the channels of each chunk.
    pub fn topics<Name: Into<String>>(names: impl IntoIterator<Item = Name>) -> Self {
        Self { topics: Some(names.into_iter().map(Into::into).collect()), start_time: 0 }
    }

    /// Selects only messages received at `start_ns` or later, nanoseconds since the epoch. Chunks that end earlier are
    /// not opened.
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

/// Messages of one chunk that are taken. A chunk of 80 MB may hold two million without content, and each takes more
/// memory than bytes in the file.
pub(super) const MAX_CHUNK_MESSAGES: usize = 1 << 20;

/// Selects messages and reuses buffers for them.
pub(super) struct Taker<'a> {
    pub(super) channels: &'a Channels,
    pub(super) filter: &'a Filter,
    pub(super) spare: &'a mut Vec<Vec<u8>>,
}

impl Taker<'_> {
    /// Returns the message in a record's body and its channel if the filter selects it.
    ///
    /// # Errors
    /// The message record is malformed; the text describes the fault.
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

    /// Returns a message with that header if the filter selects it. Its data is the old content of the buffer.
    ///
    /// # Errors
    /// The message record is malformed; the text describes the fault.
    pub(super) fn empty(&mut self, header: &MessageHeader) -> Result<Option<RawMessage>, String> {
        let Some(topic) = self.channels.get(header.channel) else {
            let channel = header.channel;
            return Err(format!("messages on channel {channel}, which is not defined"));
        };
        if header.log_time < self.filter.start_time || !self.filter.takes(&topic.name) {
            return Ok(None);
        }
        let time_ns = |time: u64| {
            i64::try_from(time)
                .map_err(|_beyond| format!("{}: a time is after the year 2262", topic.name))
        };
        Ok(Some(RawMessage {
            topic: Arc::clone(topic),
            log_time_ns: time_ns(header.log_time)?,
            publish_time_ns: time_ns(header.publish_time)?,
            sequence: header.sequence,
            data: self.spare.pop().unwrap_or_default(),
            file: None,
        }))
    }
}
