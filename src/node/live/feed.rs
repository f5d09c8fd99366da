//! Converts messages from the middleware to the worker's input.

use std::sync::Arc;

use crate::{
    bag::{RawMessage, Topic},
    node::{
        positions::inbox::Inbox,
        queue::Queue,
        source::{Input, PublisherId},
    },
    ros::transport::{Arrival, OnArrival},
};

/// Pushes every arrival to the queue, which drops the oldest if the worker is too slow.
pub(super) fn on_image(queue: Arc<Queue<Input>>, topic: Arc<Topic>) -> OnArrival {
    let mut ids = PublisherIds::default();
    Box::new(move |arrival| {
        let (item, num_bytes) = match arrival {
            Ok(arrival) => {
                let num_bytes = arrival.data.len();
                let writer = ids.of(arrival.publisher);
                (Input::Message(message(arrival, &topic), writer), num_bytes)
            }
            Err(fault) => (Input::Fault(fault.to_string()), 0),
        };
        // A closed queue: the camera has ended.
        drop(queue.push(item, num_bytes));
    })
}

/// Puts every message into the inbox of the worker. A failed arrival counts as a lost message and leaves a gap.
pub(super) fn on_position(
    inbox: Arc<Inbox>,
    queue: Arc<Queue<Input>>,
    topic: Arc<Topic>,
) -> OnArrival {
    Box::new(move |arrival| match arrival {
        Ok(arrival) => inbox.put(message(arrival, &topic), &queue),
        Err(fault) => tracing::debug!("{}: {fault}", topic.name),
    })
}

fn message(arrival: Arrival, topic: &Arc<Topic>) -> RawMessage {
    let Arrival { data, sequence, source_time_ns, receive_time_ns, .. } = arrival;
    RawMessage {
        topic: Arc::clone(topic),
        log_time_ns: receive_time_ns,
        publish_time_ns: if source_time_ns == 0 { receive_time_ns } else { source_time_ns },
        // Recordings store the low half of the counter, which is enough to detect gaps.
        sequence: sequence.map_or(0, |sequence| sequence as u32),
        data,
        file: None,
    }
}

/// Assigns a new number at every change of publisher, so gaps cannot be detected while two publishers alternate.
#[derive(Default)]
struct PublisherIds {
    last: Option<[u8; 16]>,
    current: PublisherId,
}

impl PublisherIds {
    fn of(&mut self, publisher: [u8; 16]) -> PublisherId {
        if self.last.is_some_and(|last| last != publisher) {
            self.current = PublisherId(self.current.0.wrapping_add(1));
        }
        self.last = Some(publisher);
        self.current
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        msg::{qos::QosProfile, schema::Message, sensor_msgs::Image},
        node::queue::{Bound, WhenFull},
        ros::transport::Fault,
    };

    #[test]
    fn messages_of_another_publisher_have_another_id() {
        let queue = Arc::new(Queue::new(Bound { items: 8, bytes: 100 }, WhenFull::DropOldest));
        let topic = Topic::new("/image_raw", Image::TYPE, QosProfile::best_effort(5));
        let mut feed = on_image(Arc::clone(&queue), Arc::new(topic));
        let arrival = |publisher, sequence, source_time_ns| Arrival {
            data: vec![0; 10],
            publisher: [publisher; 16],
            sequence,
            source_time_ns,
            receive_time_ns: 9,
        };
        feed(Ok(arrival(1, Some((7 << 32) + 5), 8)));
        feed(Ok(arrival(1, None, 0)));
        feed(Ok(arrival(2, Some(1), 8)));
        feed(Err(Fault::Foreign("odd".into())));
        queue.close();
        let mut seen = Vec::new();
        while let Some(input) = queue.pop() {
            seen.push(match input {
                Input::Message(message, publisher) => {
                    (message.sequence, message.publish_time_ns, publisher.0)
                }
                Input::Fault(what) => (what.len() as u32, 0, 0),
                other => unreachable!("{other:?}"),
            });
        }
        assert_eq!(seen, [(5, 8, 0), (0, 9, 0), (1, 8, 1), (3, 0, 0)]);
    }
}
