//! Where results go: the seam at which a recorder, DDS, Zenoh or a viewer is plugged in.

use std::sync::Arc;

use thiserror::Error;

use super::queue::{Bound, WhenFull};

/// One encoded message on its way out. All sinks share the bytes.
#[derive(Clone, Debug)]
pub struct Outgoing {
    /// Index into the list of published topics.
    pub topic: usize,
    /// When the input of this result was received, nanoseconds since the epoch.
    pub log_time_ns: i64,
    /// When it was sent, nanoseconds since the epoch.
    pub publish_time_ns: i64,
    /// Counter of this topic, from 1; of an input message its own.
    pub sequence: u32,
    /// CDR bytes with their header.
    pub data: Arc<[u8]>,
}

/// A sink that can take no more.
#[derive(Debug, Error)]
#[error("{sink}: {source}")]
pub struct SinkError {
    /// Which sink.
    pub sink: String,
    /// Why.
    #[source]
    pub source: Box<dyn std::error::Error + Send + Sync>,
}

/// A consumer of results.
pub trait Sink: Send {
    /// Takes one message.
    ///
    /// # Errors
    /// Nothing more can be taken.
    fn write(&mut self, message: &Outgoing) -> Result<(), SinkError>;

    /// Ends; called once, even after an error, so that what was taken is kept.
    ///
    /// # Errors
    /// What was taken may be incomplete.
    fn finish(&mut self) -> Result<(), SinkError>;
}

/// Which messages a sink gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Takes {
    /// Results.
    Results,
    /// Input images.
    Images,
    /// Both.
    All,
}

/// What a sink is for: what full queues drop is counted by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// To reach others now.
    Publish,
    /// To be kept.
    Record,
}

/// A sink and how messages reach it.
pub struct Outlet {
    /// The consumer.
    pub sink: Box<dyn Sink>,
    /// Which messages it gets.
    pub takes: Takes,
    /// What it is for.
    pub purpose: Purpose,
    /// How they get there.
    pub way: Way,
    /// Whether the run ends with it. If not, its end is told, and the others go on.
    pub is_essential: bool,
}

/// How messages reach a sink.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// The sender calls it: for a sink that never waits.
    Direct,
    /// Through a queue, to a thread of its own.
    Queued(Bound, WhenFull),
}

impl Outlet {
    /// The sink of a replay, which waits for it and ends with it.
    pub fn replay(sink: Box<dyn Sink>) -> Self {
        Self {
            sink,
            takes: Takes::All,
            purpose: Purpose::Record,
            way: Way::Queued(SINK_BOUND, WhenFull::Wait),
            is_essential: true,
        }
    }
}

/// What a sink's queue may hold: enough for the burst at the end of a slice.
pub const SINK_BOUND: Bound = Bound { items: 256, bytes: 64 << 20 };

impl Takes {
    /// Whether it includes results.
    pub const fn has_results(self) -> bool {
        !matches!(self, Self::Images)
    }

    /// Whether it includes input images.
    pub const fn has_images(self) -> bool {
        !matches!(self, Self::Results)
    }
}
