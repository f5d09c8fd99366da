//! Encodes results once and sends them to every sink.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use thiserror::Error;

use crate::{
    bag::RawMessage,
    msg::{
        cdr::{self, CdrError},
        schema::Message,
    },
};

use super::{
    fan_out::FanOut,
    queue::Closed,
    sink::{Outgoing, Purpose},
    topics::Output,
};

/// The reason that nothing more can be published.
#[derive(Debug, Error)]
pub(crate) enum PublishError {
    /// A sink has failed, and reports the reason itself.
    #[error("a sink has failed")]
    SinkFailed,
    /// A message cannot be encoded.
    #[error(transparent)]
    Encode(#[from] CdrError),
}

/// Publishes the results of a worker.
pub(crate) struct Publisher<'a> {
    fan_out: &'a FanOut<'a>,
    buffer: Vec<u8>,
    /// Number of messages sent on each topic.
    sequences: Vec<u32>,
    num_bytes: u64,
    encoding: Duration,
}

impl<'a> Publisher<'a> {
    /// Creates a publisher of `num_topics` result topics and the input topics.
    pub(crate) fn new(fan_out: &'a FanOut<'a>, num_topics: usize) -> Self {
        let sequences = vec![0; num_topics];
        Self { fan_out, buffer: Vec::new(), sequences, num_bytes: 0, encoding: Duration::ZERO }
    }

    /// Encodes and sends a result, with the times of its input.
    ///
    /// # Errors
    /// A sink has failed, or the message cannot be encoded.
    pub(crate) fn publish<M: Message>(
        &mut self,
        output: Output,
        time_ns: i64,
        message: &M,
    ) -> Result<(), PublishError> {
        let started = Instant::now();
        cdr::encode(message, &mut self.buffer)?;
        let data = Arc::from(self.buffer.as_slice());
        self.encoding += started.elapsed();
        let (topic, log_time_ns, publish_time_ns) = (output as usize, time_ns, time_ns);
        self.sequences[topic] = self.sequences[topic].wrapping_add(1);
        let sequence = self.sequences[topic];
        self.send(&Outgoing { topic, log_time_ns, publish_time_ns, sequence, data })
    }

    /// Forwards an input message unchanged, with its own sequence number, so that a later replay sees the same gaps. `place`
    /// is the index of its topic among the inputs.
    ///
    /// # Errors
    /// A sink has failed.
    pub(crate) fn forward(
        &mut self,
        message: &RawMessage,
        place: usize,
    ) -> Result<(), PublishError> {
        let &RawMessage { log_time_ns, publish_time_ns, sequence, ref data, .. } = message;
        // The topics of inputs follow the published ones.
        let topic = self.sequences.len() + place;
        let data = Arc::from(data.as_slice());
        self.send(&Outgoing { topic, log_time_ns, publish_time_ns, sequence, data })
    }

    /// Bytes sent so far.
    pub(crate) const fn num_bytes(&self) -> u64 {
        self.num_bytes
    }

    /// Messages that have not reached the sinks of that purpose, counted once per sink.
    pub(crate) fn num_dropped(&self, purpose: Purpose) -> u64 {
        self.fan_out.num_dropped(purpose)
    }

    /// Time spent on encoding since the last call.
    pub(crate) fn take_encoding_time(&mut self) -> Duration {
        std::mem::take(&mut self.encoding)
    }

    fn send(&mut self, message: &Outgoing) -> Result<(), PublishError> {
        self.num_bytes += message.data.len() as u64;
        self.fan_out.send(message).map_err(|Closed(())| PublishError::SinkFailed)
    }
}
