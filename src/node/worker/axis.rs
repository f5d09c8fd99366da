//! The worker's part in finding out where frames were taken: lets them wait for samples, and samples come to them.

use std::time::Instant;

use super::{Held, Now, Positions, Waiter, Worker, WorkerOptions};
use crate::{
    bag::RawMessage,
    msg::{
        cdr,
        sensor_msgs::{CompressedImage, Image},
        std_msgs::Header,
    },
    node::{
        publisher::{Halt, Publisher},
        queue::Queue,
    },
    ros::node_params::ImageTransport,
    scanner::{
        axis::RawPosition,
        motion::{Position, doubt},
        params::Params,
    },
};

impl Worker {
    /// Lets a frame wait behind the others until its position is known.
    pub(super) fn hold(
        &mut self,
        waiter: Waiter,
        num_dropped: u32,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), Halt> {
        let (mut stamp_ns, mut received_ns) = (None, self.last_time_ns);
        if let Waiter::Frame(frame) = &waiter {
            received_ns = frame.message.log_time_ns;
            if let (Some(header), Some(positions)) =
                (header(&frame.message, &self.options), &mut self.positions)
            {
                positions.see_frame(&header.frame_id);
                stamp_ns = Some(header.stamp.to_ns());
            }
        }
        let since = Instant::now();
        self.waiting.push(Held { waiter, num_dropped, stamp_ns, received_ns, since });
        self.release(Now::Received(received_ns), spare, out)
    }

    /// Measures those that have waited long enough.
    pub(super) fn release(
        &mut self,
        now: Now,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), Halt> {
        loop {
            let Some(positions) = &self.positions else { return Ok(()) };
            let Some(held) = self.waiting.next(positions, now) else { return Ok(()) };
            self.take_dropped(held.num_dropped);
            self.take_waiter(held.waiter, spare, out)?;
        }
    }

    /// Live, frames wait no longer than they may, though nothing comes; and not for what will not come.
    pub(super) fn let_go(
        &mut self,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), Halt> {
        match &self.live {
            Some(live) if live.is_resting() => self.release(Now::End, spare, out),
            Some(_) => self.release(Now::Tick(Instant::now()), spare, out),
            None => Ok(()),
        }
    }

    /// Takes a message about the axis.
    pub(super) fn take_position(
        &mut self,
        message: &RawMessage,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), Halt> {
        if self.options.sends_images {
            let place = self.position_topics.iter().position(|name| *name == message.topic.name);
            // Behind the images.
            out.forward(message, 1 + place.unwrap_or(0))?;
        }
        if self.framing.topic.as_ref() == Some(&message.topic.name) {
            self.framing.take(message);
            return Ok(());
        }
        let Some(positions) = &mut self.positions else { return Ok(()) };
        positions.take(message);
        self.counts.positions_refused = positions.num_refused();
        self.release(Now::Received(message.log_time_ns), spare, out)
    }

    /// Takes the messages about the axis that have arrived.
    pub(super) fn open_inbox(
        &mut self,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), Halt> {
        let Some(inbox) = self.inbox.clone() else { return Ok(()) };
        inbox.open();
        while let Some((message, num_dropped)) = inbox.next() {
            if let Some(positions) = &mut self.positions {
                positions.lose(num_dropped.into(), "they come faster than frames are measured");
            }
            self.take_position(&message, spare, out)?;
        }
        Ok(())
    }

    /// Where a frame was taken. `None`: nobody knows.
    pub(super) fn locate(
        &mut self,
        frame_number: u64,
        (stamp_ns, received_ns): (i64, i64),
    ) -> Option<Position> {
        match &mut self.positions {
            None => self.pipeline.expected_position(frame_number, stamp_ns),
            Some(positions) => positions.at(stamp_ns, received_ns),
        }
    }

    /// Counts what is known of a frame's position, and tells the first one in doubt.
    pub(super) fn count_position(&mut self, stamp_ns: i64, position: Option<Position>) {
        if self.positions.is_some() {
            self.counts.located += u64::from(position.is_some());
            self.counts.unlocated += u64::from(position.is_none());
        }
        let Some(Position { doubts, value: RawPosition(value), .. }) =
            position.filter(|position| position.doubts != 0)
        else {
            return;
        };
        self.counts.doubtful += 1;
        if self.counts.doubtful == 1 {
            tracing::warn!(
                "the position {value} of the frame of {stamp_ns} ns is in doubt: {}; its slice will be DEGRADED; further ones \
                 are only counted",
                in_words(doubts)
            );
        }
    }

    /// Goes by other parameters: what waited was taken under the old ones.
    pub(super) fn move_by(
        &mut self,
        params: &Params,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), Halt> {
        self.release(Now::End, spare, out)?;
        self.positions.iter_mut().for_each(|positions: &mut Positions| {
            positions.reconfigure(&params.motion);
        });
        Ok(())
    }
}

fn in_words(doubts: u8) -> String {
    let words = [
        (doubt::GAP, "the samples about it lie further apart than motion.max_step"),
        (doubt::REVERSED, "the axis moved against the scan direction"),
        (doubt::STALE, "the samples about it lie further apart in time than motion.max_gap"),
        (doubt::EXTRAPOLATED, "no sample behind it came in time"),
    ];
    let said = words.iter().filter(|(bit, _)| doubts & bit != 0).map(|(_, text)| *text);
    said.collect::<Vec<_>>().join(", ")
}

/// The header of an image message; `None`: it has none that can be read.
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
