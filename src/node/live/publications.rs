//! The middleware as a sink: every result goes out on its topic.

use std::sync::Arc;

use crate::{
    node::{
        sink::{Outgoing, Sink, SinkError},
        worker::live::NowNs,
    },
    ros::transport::{Publication, TopicEndpoint, Transport, TransportError},
};

/// A failure is told when it is the first one, and then each time that its number has doubled.
const fn is_told(num_failed: u64) -> bool {
    num_failed.is_power_of_two()
}

/// The publishers of a camera's results, by the number of the topic.
pub(super) struct Publications {
    publications: Vec<Box<dyn Publication>>,
    now_ns: NowNs,
    num_failed: u64,
}

impl Publications {
    /// Makes the publishers.
    pub(super) fn advertise(
        transport: &dyn Transport,
        endpoints: &[TopicEndpoint],
        now_ns: NowNs,
    ) -> Result<Self, TransportError> {
        let publications = endpoints.iter().map(|endpoint| transport.advertise(endpoint));
        Ok(Self { publications: publications.collect::<Result<_, _>>()?, now_ns, num_failed: 0 })
    }
}

impl Sink for Publications {
    /// One message that cannot be sent is no reason to send no more.
    fn write(&mut self, message: &Outgoing) -> Result<(), SinkError> {
        let Some(publication) = self.publications.get_mut(message.topic) else { return Ok(()) };
        if let Err(error) = publication.publish(&Arc::clone(&message.data), (self.now_ns)()) {
            self.num_failed += 1;
            if is_told(self.num_failed) {
                tracing::warn!("a result was not published ({} so far): {error}", self.num_failed);
            }
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<(), SinkError> {
        self.publications.clear();
        Ok(())
    }
}
