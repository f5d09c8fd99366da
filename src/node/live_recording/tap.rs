//! The entry point of every message to the recorder. It waits neither for a disk nor for a command.

use std::{sync::Arc, time::Instant};

use crate::{bag::Topic, node::sink::Outgoing};

use super::{params::RecordingParams, ring::Ring, session::Session};

/// Kind of bag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub(super) enum Stream {
    /// Results that the node publishes.
    Results,
    /// The raw images, which differ in size and compression.
    Images,
}

impl Stream {
    pub(super) const ALL: [Self; 2] = [Self::Results, Self::Images];

    /// Suffix of the bag names.
    pub(super) const fn suffix(self) -> &'static str {
        match self {
            Self::Results => "",
            Self::Images => "_images",
        }
    }
}

/// A message and its topic within a bag.
#[derive(Clone, Debug)]
pub(super) struct Tapped {
    pub(super) stream: Stream,
    /// Index of its topic in the bag's list.
    pub(super) place: usize,
    pub(super) message: Outgoing,
}

/// Messages for a snapshot, of all streams.
pub(super) struct SnapshotMessages {
    /// Messages of the last seconds, in order.
    pub(super) recent: Vec<Tapped>,
    /// Last messages of the latched topics without a recent message.
    pub(super) earlier_latched: Vec<Tapped>,
}

/// Latched messages, the last seconds, and the running recordings.
pub(super) struct Tap {
    lines: [Line; 2],
    ring: Ring,
    keeps_images: bool,
}

struct Line {
    is_latched: Vec<bool>,
    /// Last message of each latched topic, by topic.
    latched: Vec<Option<Tapped>>,
    session: Option<Arc<Session>>,
}

impl Tap {
    /// Returns a tap for the topics of each stream.
    pub(super) fn new(topics: [&[Topic]; 2]) -> Self {
        let line = |topics: &[Topic]| Line {
            is_latched: topics.iter().map(Topic::is_latched).collect(),
            latched: vec![None; topics.len()],
            session: None,
        };
        Self { lines: topics.map(line), ring: Ring::default(), keeps_images: false }
    }

    pub(super) fn set_params(&mut self, params: &RecordingParams) {
        self.keeps_images = params.images;
        self.ring.set_bounds(params.snapshot_seconds.unwrap_or(0), params.snapshot_bytes);
    }

    /// Passes on a message sent at `now`.
    pub(super) fn take(&mut self, now: Instant, tapped: Tapped) {
        let line = &mut self.lines[tapped.stream as usize];
        if line.is_latched[tapped.place] {
            line.latched[tapped.place] = Some(tapped.clone());
        }
        if let Some(session) = &line.session
            && session.push(tapped.clone()).is_err()
        {
            // It has failed; only a command ends it here.
            session.count_dropped(1);
        }
        if tapped.stream == Stream::Results || self.keeps_images {
            self.ring.push(now, tapped);
        }
    }

    /// Passes all further messages to a recording. Returns the latched messages sent before.
    pub(super) fn begin(&mut self, stream: Stream, session: Arc<Session>) -> Vec<Tapped> {
        let line = &mut self.lines[stream as usize];
        line.session = Some(session);
        line.latched.iter().flatten().cloned().collect()
    }

    /// Stops passing messages to the recording of a stream and returns it.
    pub(super) fn end(&mut self, stream: Stream) -> Option<Arc<Session>> {
        self.lines[stream as usize].session.take()
    }

    /// Returns the messages for a snapshot, `None` if snapshots are off.
    pub(super) fn snapshot(&mut self, now: Instant) -> Option<SnapshotMessages> {
        if self.ring.is_off() {
            return None;
        }
        let recent = self.ring.messages(now);
        let is_recent = |latched: &Tapped| {
            recent
                .iter()
                .any(|tapped| (tapped.stream, tapped.place) == (latched.stream, latched.place))
        };
        let latched = self.lines.iter().flat_map(|line| line.latched.iter().flatten());
        let earlier_latched = latched.filter(|latched| !is_recent(latched)).cloned().collect();
        Some(SnapshotMessages { recent, earlier_latched })
    }
}
