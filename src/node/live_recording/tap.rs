//! The entry point of every message to the recorder. It never blocks, neither on a disk nor on a command.

use std::{sync::Arc, time::Instant};

use crate::{bag::Topic, node::sink::Outgoing};

use super::{params::RecordingParams, ring::Ring, session::Session};

/// The content of one bag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub(super) enum Stream {
    /// Results that the node publishes.
    Results,
    /// The raw images: other sizes, another compression, another disk's worth of bytes.
    Images,
}

impl Stream {
    pub(super) const ALL: [Self; 2] = [Self::Results, Self::Images];

    /// The end of its bags' names.
    pub(super) const fn suffix(self) -> &'static str {
        match self {
            Self::Results => "",
            Self::Images => "_images",
        }
    }
}

/// A message and its place in a bag.
#[derive(Clone, Debug)]
pub(super) struct Tapped {
    pub(super) stream: Stream,
    /// Place of its topic in the bag's list.
    pub(super) place: usize,
    pub(super) message: Outgoing,
}

/// Messages for a snapshot, of all streams.
pub(super) struct SnapshotMessages {
    /// Sent in the last seconds, in order.
    pub(super) recent: Vec<Tapped>,
    /// Last messages of latched topics that were sent before those.
    pub(super) earlier_latched: Vec<Tapped>,
}

/// Latched messages, the last seconds, and the recordings that are on.
pub(super) struct Tap {
    lines: [Line; 2],
    ring: Ring,
    keeps_images: bool,
}

struct Line {
    is_latched: Vec<bool>,
    /// By topic; of latched ones the last.
    latched: Vec<Option<Tapped>>,
    session: Option<Arc<Session>>,
}

impl Tap {
    /// A tap for the topics of each stream.
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
        self.ring.set_bounds(params.snapshot_seconds, params.snapshot_bytes);
    }

    /// Passes a message on that is sent now.
    pub(super) fn take(&mut self, now: Instant, tapped: Tapped) {
        let line = &mut self.lines[tapped.stream as usize];
        if line.is_latched[tapped.place] {
            line.latched[tapped.place] = Some(tapped.clone());
        }
        if line.session.as_ref().is_some_and(|session| session.push(tapped.clone()).is_err()) {
            line.session = None;
        }
        if tapped.stream == Stream::Results || self.keeps_images {
            self.ring.push(now, tapped);
        }
    }

    /// Lets a recording have what comes from now on. Returns the latched messages that were sent before.
    pub(super) fn begin(&mut self, stream: Stream, session: Arc<Session>) -> Vec<Tapped> {
        let line = &mut self.lines[stream as usize];
        line.session = Some(session);
        line.latched.iter().flatten().cloned().collect()
    }

    /// Lets a recording have nothing more.
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
