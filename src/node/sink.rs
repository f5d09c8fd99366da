//! The interface for consumers of results: recorder, DDS, Zenoh, viewers.

use std::sync::Arc;

use thiserror::Error;

use super::queue::{Bound, WhenFull};

/// One encoded message. All sinks share the bytes.
#[derive(Clone, Debug)]
pub struct Outgoing {
    /// Index into the list of published topics.
    pub topic: usize,
    /// Time of reception of this result's input, nanoseconds since the epoch.
    pub log_time_ns: i64,
    /// Time of publication, nanoseconds since the epoch.
    pub publish_time_ns: i64,
    /// Sequence number on this topic, from 1; for an input message, its own.
    pub sequence: u32,
    /// CDR bytes with their header.
    pub data: Arc<[u8]>,
}

/// A sink that accepts no more messages.
#[derive(Debug, Error)]
#[error("{sink}: {source}")]
pub struct SinkError {
    /// Name of the sink.
    pub(crate) sink: String,
    /// The reason.
    #[source]
    pub(crate) source: Box<dyn std::error::Error + Send + Sync>,
}

/// A consumer of results.
pub trait Sink: Send {
    /// Writes one message.
    ///
    /// # Errors
    /// The sink accepts no more messages.
    fn write(&mut self, message: &Outgoing) -> Result<(), SinkError>;

    /// Finishes the sink, so that written messages are kept. Called once, even after an error.
    ///
    /// # Errors
    /// The messages written so far may be incomplete.
    fn finish(&mut self) -> Result<(), SinkError>;
}

/// The purpose of a sink; dropped messages are counted by purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// To publish messages.
    Publish,
    /// To record messages.
    Record,
}

/// A sink and how messages reach it.
pub(crate) struct Outlet {
    /// The consumer.
    pub(crate) sink: Box<dyn Sink>,
    /// True if it receives the input images besides the results.
    pub(crate) takes_images: bool,
    /// Its purpose.
    pub(crate) purpose: Purpose,
    /// Its way of delivery.
    pub(crate) way: Way,
    /// True if its failure ends the run. Otherwise the failure is logged, and the other sinks continue.
    pub(crate) is_essential: bool,
}

/// Delivery of messages to a sink.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    /// A direct call by the sender, for a sink that never blocks.
    Direct,
    /// Through a queue to the sink's own thread.
    Queued(Bound, WhenFull),
}

impl Outlet {
    /// Creates the sink of a replay, which waits for it and fails with it.
    pub(crate) fn replay(sink: Box<dyn Sink>) -> Self {
        Self {
            sink,
            takes_images: true,
            purpose: Purpose::Record,
            way: Way::Queued(SINK_BOUND, WhenFull::Wait),
            is_essential: true,
        }
    }
}

/// Bound of a sink's queue: enough for the burst at the end of a slice.
pub(crate) const SINK_BOUND: Bound = Bound { items: 256, bytes: 64 << 20 };
