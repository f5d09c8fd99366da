//! Positions in the worker: frames wait for samples of the axis, and samples release them.

use std::time::Instant;

use super::{Arrival, Held, Now, Worker, WorkerOptions};
use crate::{
    bag::RawMessage,
    msg::{
        cdr,
        sensor_msgs::{CompressedImage, Image},
        std_msgs::Header,
    },
    node::{
        publisher::{PublishError, Publisher},
        queue::Queue,
    },
    ros::node_params::ImageTransport,
};

impl Worker {
    /// Queues a frame until its position is known.
    pub(super) fn hold(
        &mut self,
        arrival: Arrival,
        num_dropped: u32,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        let received_ns = arrival.received_ns().unwrap_or(self.last_time_ns);
        let mut stamp_ns = None;
        if let Arrival::Frame(frame) = &arrival
            && let Some(header) = header(&frame.message, &self.options)
            && let Some(positions) = &mut self.measurer.positions
        {
            positions.set_camera_frame(&header.frame_id);
            stamp_ns = Some(header.stamp.to_ns());
        }
        let since = Instant::now();
        self.waiting.push(Held { arrival, num_dropped, stamp_ns, received_ns, since });
        self.release(Now::Received(received_ns), spare, out)
    }

    /// Measures the frames that need not or cannot wait any longer.
    pub(super) fn release(
        &mut self,
        now: Now,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        self.release_opening(now, spare, out)?;
        loop {
            let Some(positions) = &self.measurer.positions else { return Ok(()) };
            let Some(held) = self.waiting.next(positions, now) else { return Ok(()) };
            self.ledger.count_dropped(held.num_dropped);
            self.take_arrival(held.arrival, spare, out)?;
        }
    }

    /// Measures frames whose wait has timed out, or all of them while draining. Only used live.
    pub(super) fn release_overdue(
        &mut self,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        match &self.online {
            Some(online) if online.is_draining() => self.release(Now::End, spare, out),
            Some(_) => self.release(Now::Tick(Instant::now()), spare, out),
            None => Ok(()),
        }
    }

    /// Processes a message about the axis.
    pub(super) fn take_position(
        &mut self,
        message: &RawMessage,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        if self.options.sends_images {
            let place = self.position_topics.iter().position(|name| *name == message.topic.name);
            // The topics of positions follow the image topic.
            out.forward(message, 1 + place.unwrap_or(0))?;
        }
        if self.framing.topic.as_ref() == Some(&message.topic.name) {
            self.framing.take(message);
            return self.release_opening(Now::Received(message.log_time_ns), spare, out);
        }
        self.release_opening(Now::Received(message.log_time_ns), spare, out)?;
        let Some(positions) = &mut self.measurer.positions else { return Ok(()) };
        positions.take(message);
        self.ledger.set_positions_refused(positions.num_refused());
        self.release(Now::Received(message.log_time_ns), spare, out)
    }

    /// Processes the messages about the axis that have arrived.
    pub(super) fn drain_inbox(
        &mut self,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        let Some(inbox) = self.inbox.clone() else { return Ok(()) };
        inbox.acknowledge();
        while let Some((message, num_dropped)) = inbox.next() {
            if let Some(positions) = &mut self.measurer.positions {
                positions
                    .count_lost(num_dropped.into(), "they arrive faster than frames are measured");
            }
            self.take_position(&message, spare, out)?;
        }
        Ok(())
    }
}

/// The header of an image message; `None` if it cannot be decoded.
fn header<'a>(message: &'a RawMessage, options: &WorkerOptions) -> Option<Header<'a>> {
    match options.transport {
        ImageTransport::Raw => {
            cdr::decode::<Image<'_>>(&message.data).ok().map(|image| image.header)
        }
        ImageTransport::Compressed => {
            cdr::decode::<CompressedImage<'_>>(&message.data).ok().map(|image| image.header)
        }
    }
}
