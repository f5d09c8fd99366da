//! A queue of messages about the axis, separate from the images, so that a fast encoder does not displace them.

use std::{
    sync::atomic::{AtomicBool, Ordering},
    time::Instant,
};

use crate::{
    bag::RawMessage,
    node::{
        queue::{Bound, Popped, Queue, WhenFull},
        source::Input,
    },
};

/// Bound of the queue: several seconds of a fast encoder.
const BOUND: Bound = Bound { items: 4096, bytes: 16 << 20 };

/// A bounded queue of messages about an axis; drops the oldest.
pub(crate) struct Inbox {
    messages: Queue<RawMessage>,
    /// True if the worker has been notified of waiting messages.
    is_announced: AtomicBool,
}

impl Default for Inbox {
    fn default() -> Self {
        Self {
            messages: Queue::new(BOUND, WhenFull::DropOldest),
            is_announced: AtomicBool::new(false),
        }
    }
}

impl Inbox {
    /// Queues a message, and notifies the worker through `input` unless that was done already.
    pub(crate) fn put(&self, message: RawMessage, input: &Queue<Input>) {
        let num_bytes = message.data.len();
        // The queue is never closed.
        drop(self.messages.push(message, num_bytes));
        let is_new = !self.is_announced.swap(true, Ordering::AcqRel);
        // The queue of commands is full: the next message tries again.
        if is_new && input.push_urgent(Input::Positions).is_err() {
            self.is_announced.store(false, Ordering::Release);
        }
    }

    /// Acknowledges the notification: the next message notifies again. Call before the messages are taken.
    pub(crate) fn acknowledge(&self) {
        self.is_announced.store(false, Ordering::Release);
    }

    /// Returns the next message and the number of messages dropped before it.
    pub(crate) fn next(&self) -> Option<(RawMessage, u32)> {
        match self.messages.pop_counted(Some(Instant::now())) {
            Popped::Item(message, num_dropped) => Some((message, num_dropped)),
            Popped::TimedOut | Popped::Closed => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::{
        bag::Topic,
        msg::{qos::QosProfile, schema::Message, sensor_msgs::JointState},
    };

    #[test]
    fn the_worker_is_notified_once_for_many_messages() {
        let topic = Topic::new("/joint_states", JointState::TYPE, QosProfile::best_effort(5));
        let topic = Arc::new(topic);
        let message = |sequence| RawMessage {
            topic: Arc::clone(&topic),
            log_time_ns: 0,
            publish_time_ns: 0,
            sequence,
            data: vec![0; 10],
            file: None,
        };
        let input = Queue::new(Bound { items: 1, bytes: 100 }, WhenFull::DropOldest);
        input.push(Input::Fault("an image".into()), 100).unwrap();
        let inbox = Inbox::default();
        for number in 0..BOUND.items as u32 + 3 {
            inbox.put(message(number), &input);
        }
        assert!(matches!(input.pop(), Some(Input::Positions)));
        assert!(matches!(input.pop(), Some(Input::Fault(_))), "the image is still there");
        inbox.acknowledge();
        let first = inbox.next().map(|(message, num_dropped)| (message.sequence, num_dropped));
        assert_eq!(first, Some((3, 3)));
        assert_eq!(std::iter::from_fn(|| inbox.next()).count(), BOUND.items - 1);
        inbox.put(message(9), &input);
        input.close();
        assert!(matches!(input.pop(), Some(Input::Positions)) && input.pop().is_none());
    }
}
