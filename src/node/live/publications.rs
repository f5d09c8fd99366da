//! The middleware as a sink: publishes every result on its topic.

use crate::{
    node::{
        clock::system_ns,
        sink::{Outgoing, Sink, SinkError},
    },
    ros::transport::{Publication, TopicEndpoint, Transport, TransportError},
};

/// Failures are logged when their number is a power of two.
const fn is_logged(num_failed: u64) -> bool {
    num_failed.is_power_of_two()
}

/// The publishers of a camera's results, by the number of the topic.
pub(super) struct Publications {
    publications: Vec<Box<dyn Publication>>,
    num_failed: u64,
}

impl Publications {
    /// Creates the publishers.
    pub(super) fn advertise(
        transport: &dyn Transport,
        endpoints: &[TopicEndpoint],
    ) -> Result<Self, TransportError> {
        let publications = endpoints.iter().map(|endpoint| transport.advertise(endpoint));
        Ok(Self { publications: publications.collect::<Result<_, _>>()?, num_failed: 0 })
    }
}

impl Sink for Publications {
    /// A message that cannot be sent does not end the sink.
    fn write(&mut self, message: &Outgoing) -> Result<(), SinkError> {
        let Some(publication) = self.publications.get_mut(message.topic) else { return Ok(()) };
        // The system time, even in a simulation, as in every ROS middleware.
        if let Err(error) = publication.publish(&message.data, system_ns()) {
            self.num_failed += 1;
            if is_logged(self.num_failed) {
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
