//! The queue of messages to a viewer, bounded in bytes. A slow viewer loses the oldest messages of topics; one that does
//! not even take the answers to its requests is disconnected. Nobody else waits for it.

use std::{
    collections::VecDeque,
    mem::size_of,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use tokio::sync::Notify;
use tokio_tungstenite::tungstenite::Message;

use super::protocol::{MESSAGE_HEADER_BYTES, message_header};

/// Bytes of topics that may wait for one viewer: three images of 2592 × 2048 pixels. Those of other messages are counted
/// by themselves, with the same limit. A single message may be larger.
pub(super) const MAX_WAITING_BYTES: usize = 16 << 20;

/// A topic's message. Viewers share its bytes.
#[derive(Clone, Debug)]
pub(super) struct TopicMessage {
    /// The viewer's number of the topic.
    pub(super) subscription: u32,
    /// Log time, nanoseconds since the epoch.
    pub(super) time_ns: u64,
    /// CDR bytes.
    pub(super) data: Arc<[u8]>,
}

impl TopicMessage {
    fn into_message(self) -> Message {
        let mut bytes = Vec::with_capacity(MESSAGE_HEADER_BYTES + self.data.len());
        bytes.extend(message_header(self.subscription, self.time_ns));
        bytes.extend_from_slice(&self.data);
        Message::binary(bytes)
    }
}

/// Messages that wait for a viewer.
#[derive(Default)]
pub(super) struct Outbox {
    waiting: Mutex<Waiting>,
    changed: Notify,
}

#[derive(Default)]
struct Waiting {
    /// Messages of topics, which may be lost, by the number in which they were added.
    topics: VecDeque<(u64, TopicMessage)>,
    /// All others.
    others: VecDeque<(u64, Message)>,
    topic_bytes: usize,
    other_bytes: usize,
    num_added: u64,
    is_closed: bool,
}

impl Waiting {
    /// Adds a topic's message. The oldest are lost until it fits.
    fn add_topic(&mut self, message: TopicMessage) {
        let size_bytes = cost(message.data.len());
        while !fits(self.topic_bytes, size_bytes) {
            let Some((_, lost)) = self.topics.pop_front() else { break };
            self.topic_bytes -= cost(lost.data.len());
        }
        self.topic_bytes += size_bytes;
        self.num_added += 1;
        self.topics.push_back((self.num_added, message));
    }

    /// Adds another message; false if it does not fit.
    fn add_other(&mut self, message: Message) -> bool {
        let size_bytes = cost(message.len());
        let has_room = fits(self.other_bytes, size_bytes);
        if has_room {
            self.other_bytes += size_bytes;
            self.num_added += 1;
            self.others.push_back((self.num_added, message));
        }
        has_room
    }

    fn pop(&mut self) -> Option<Message> {
        let is_topic = match (self.topics.front(), self.others.front()) {
            (Some((topic, _)), Some((other, _))) => topic < other,
            (topic, _) => topic.is_some(),
        };
        if is_topic {
            let (_, message) = self.topics.pop_front()?;
            self.topic_bytes -= cost(message.data.len());
            Some(message.into_message())
        } else {
            let (_, message) = self.others.pop_front()?;
            self.other_bytes -= cost(message.len());
            Some(message)
        }
    }
}

/// True if a message of this size may wait besides those that wait.
const fn fits(waiting_bytes: usize, size_bytes: usize) -> bool {
    waiting_bytes == 0 || waiting_bytes.saturating_add(size_bytes) <= MAX_WAITING_BYTES
}

/// Memory that a waiting message takes, bytes.
const fn cost(payload_bytes: usize) -> usize {
    payload_bytes + MESSAGE_HEADER_BYTES + 2 * size_of::<(u64, TopicMessage)>()
}

impl Outbox {
    /// Adds a topic's message. Older ones are lost if there is no room.
    pub(super) fn push_topic(&self, message: TopicMessage) {
        let mut waiting = self.lock();
        if !waiting.is_closed {
            waiting.add_topic(message);
        }
        drop(waiting);
        self.changed.notify_one();
    }

    /// Adds a message that must not be lost. Closes the outbox if there is no room.
    pub(super) fn push(&self, message: Message) {
        let mut waiting = self.lock();
        if waiting.is_closed {
            return;
        }
        if !waiting.add_other(message) {
            tracing::info!("a viewer takes no messages: it is disconnected");
            *waiting = Waiting { is_closed: true, ..Waiting::default() };
        }
        drop(waiting);
        self.changed.notify_one();
    }

    /// Takes nothing more. What waits is still sent.
    pub(super) fn close(&self) {
        self.lock().is_closed = true;
        self.changed.notify_one();
    }

    /// Waits for the next message; `None` after the last.
    pub(super) async fn next(&self) -> Option<Message> {
        loop {
            {
                let mut waiting = self.lock();
                if let Some(message) = waiting.pop() {
                    return Some(message);
                }
                if waiting.is_closed {
                    return None;
                }
            }
            self.changed.notified().await;
        }
    }

    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topic(time_ns: u64, size_bytes: usize) -> TopicMessage {
        TopicMessage { subscription: 1, time_ns, data: vec![0; size_bytes].into() }
    }

    fn drained(outbox: &Outbox) -> Vec<Message> {
        let mut waiting = outbox.lock();
        std::iter::from_fn(|| waiting.pop()).collect()
    }

    #[test]
    fn the_order_is_kept_between_topics_and_answers() {
        let outbox = Outbox::default();
        outbox.push(Message::text("1"));
        outbox.push_topic(topic(2, 0));
        outbox.push(Message::text("3"));
        outbox.push_topic(topic(4, 0));
        let kinds: Vec<_> = drained(&outbox).iter().map(Message::is_text).collect();
        assert_eq!(kinds, [true, false, true, false]);
        let waiting = outbox.lock();
        assert_eq!((waiting.topic_bytes, waiting.other_bytes), (0, 0));
    }

    #[test]
    fn a_viewer_that_reads_nothing_takes_bounded_memory_and_keeps_the_newest() {
        let outbox = Outbox::default();
        outbox.push(Message::text("kept"));
        for number in 0..1000 {
            outbox.push_topic(topic(number, 1 << 20));
            assert!(outbox.lock().topic_bytes <= MAX_WAITING_BYTES);
        }
        // Small messages cost more than their payload.
        for number in 1000..1_000_000 {
            outbox.push_topic(topic(number, 0));
        }
        let waiting = outbox.lock();
        assert!(waiting.topic_bytes <= MAX_WAITING_BYTES);
        assert!(waiting.topics.len() < MAX_WAITING_BYTES / MESSAGE_HEADER_BYTES);
        assert_eq!(waiting.topics.back().unwrap().1.time_ns, 999_999);
        assert_eq!(waiting.others.len(), 1);
    }

    #[test]
    fn a_message_larger_than_the_limit_is_sent_whatever_other_messages_wait() {
        let outbox = Outbox::default();
        outbox.push(Message::text("before"));
        outbox.push_topic(topic(1, 10));
        outbox.push_topic(topic(2, MAX_WAITING_BYTES + 1));
        outbox.push(Message::text("after"));
        let sizes: Vec<_> = drained(&outbox).iter().map(Message::len).collect();
        assert_eq!(sizes, [6, MESSAGE_HEADER_BYTES + MAX_WAITING_BYTES + 1, 5]);
    }

    #[test]
    fn a_viewer_that_takes_no_answers_is_disconnected() {
        let outbox = Outbox::default();
        let answer = "x".repeat(1 << 20);
        for _ in 0..100 {
            outbox.push(Message::text(answer.clone()));
        }
        let waiting = outbox.lock();
        assert!(waiting.is_closed && waiting.other_bytes == 0 && waiting.others.is_empty());
    }
}
