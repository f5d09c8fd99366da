//! Receives messages on the loopback and waits for them.

use std::{
    sync::{Arc, Condvar, Mutex},
    thread,
    time::{Duration, Instant},
};

use serde::Deserialize;

use crate::{
    msg::{cdr, schema::Message},
    ros::transport::OnArrival,
};

/// Timeout, long enough for slow machines.
const TIMEOUT: Duration = Duration::from_mins(1);

/// A received message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Received {
    pub(super) topic: String,
    pub(super) data: Vec<u8>,
}

impl Received {
    pub(super) fn decode<'de, M: Message + Deserialize<'de>>(&'de self) -> M {
        cdr::decode(&self.data).unwrap()
    }
}

/// Stores received messages in order.
#[derive(Clone, Default)]
pub(super) struct Listener(Arc<(Mutex<Vec<Received>>, Condvar)>);

impl Listener {
    pub(super) fn on_arrival(&self, topic: &str) -> OnArrival {
        let (kept, topic) = (Arc::clone(&self.0), topic.to_owned());
        Box::new(move |arrival| {
            let data = arrival.unwrap().data;
            kept.0.lock().unwrap().push(Received { topic: topic.clone(), data });
            kept.1.notify_all();
        })
    }

    /// Waits until the received messages meet a condition.
    pub(super) fn wait(
        &self,
        what: &str,
        mut is_so: impl FnMut(&[Received]) -> bool,
    ) -> Vec<Received> {
        let guard = self.0.0.lock().unwrap();
        let (guard, timeout) =
            self.0.1.wait_timeout_while(guard, TIMEOUT, |messages| !is_so(messages)).unwrap();
        assert!(!timeout.timed_out(), "timeout: {what}; received {} messages", guard.len());
        guard.clone()
    }

    /// Waits for that many messages of a topic, and returns them.
    pub(super) fn wait_for(&self, topic: &str, num: usize) -> Vec<Received> {
        let messages = self.wait(&format!("{num} of {topic}"), |messages| {
            messages.iter().filter(|message| message.topic == topic).count() >= num
        });
        messages.into_iter().filter(|message| message.topic == topic).collect()
    }

    /// Waits for a message from which a value can be found, trying the last one first.
    pub(super) fn wait_until<T>(
        &self,
        what: &str,
        topic: &str,
        mut read: impl FnMut(&Received) -> Option<T>,
    ) -> T {
        let mut found = None;
        self.wait(what, |messages| {
            let of_topic = messages.iter().rev().filter(|message| message.topic == topic);
            found = of_topic.take(1).find_map(&mut read);
            found.is_some()
        });
        found.unwrap()
    }

    /// Returns the messages received on a topic so far.
    pub(super) fn received(&self, topic: &str) -> Vec<Received> {
        let messages = self.0.0.lock().unwrap();
        messages.iter().filter(|message| message.topic == topic).cloned().collect()
    }
}

/// Waits until a condition that another thread causes is true.
pub(super) fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let deadline = Instant::now() + TIMEOUT;
    while !is_so() {
        assert!(Instant::now() < deadline, "timeout: {what}");
        thread::sleep(Duration::from_millis(2));
    }
}
