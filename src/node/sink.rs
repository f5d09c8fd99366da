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
    /// The reason.
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
    /// The messages written so far may be incomplete.
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

/// The purpose of a sink; dropped messages are counted by purpose.
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
    /// Its purpose.
    pub purpose: Purpose,
    /// Its way of delivery.
    pub way: Way,
    /// True if the run ends with it. Otherwise its end is logged, and the other sinks continue.
    pub is_essential: bool,
}

/// Delivery of messages to a sink.
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

/// Bound of a sink's queue: enough for the burst at the end of a slice.
pub const SINK_BOUND: Bound = Bound { items: 256, bytes: 64 << 20 };

impl Takes {
    /// True if it includes results.
    pub const fn has_results(self) -> bool {
        !matches!(self, Self::Images)
    }

    /// True if it includes input images.
    pub const fn has_images(self) -> bool {
        !matches!(self, Self::Results)
    }
}
