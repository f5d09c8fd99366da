//! The one thread of a camera: it owns the pipeline, judges every frame and publishes what the pipeline says.

use std::time::Instant;

use thiserror::Error;

use crate::{
    bag::RawMessage,
    msg::{
        cdr::{self, CdrError},
        convert::{FrameRejected, compressed, frame},
        sensor_msgs::{CompressedImage, Image},
        std_msgs::Header,
    },
    ros::node_params::ImageTransport,
    scanner::{
        image,
        pipeline::{FrameError, FrameIndex, Pipeline, Stage},
    },
};

use super::{
    order::{Place, Sequence, StampFault, StampOrder, StampStep},
    publisher::{Halt, Publisher},
    queue::{Popped, Queue},
    results::{Measured, Results},
    sink::{CloseOnDrop, Purpose},
    source::Input,
    statistics::{Counts, StageTimes},
    status::{Interval, Reporter, Schedule},
    topics::Output,
};

/// How the worker treats its input.
#[derive(Clone, Debug)]
pub struct WorkerOptions {
    /// How images are packed.
    pub transport: ImageTransport,
    /// Largest decoded image, bytes.
    pub max_frame_bytes: u64,
    /// Whether input images are sent on with the results.
    pub sends_images: bool,
}

/// Why a frame was refused.
#[derive(Debug, Error)]
enum Rejection {
    #[error("malformed: {0}")]
    Message(#[from] CdrError),
    #[error("malformed: {0}")]
    Image(#[from] FrameRejected),
    #[error("malformed: {0}")]
    Params(#[from] FrameError),
    #[error("its stamp is that of the frame before")]
    Duplicate,
    #[error("its stamp lies before that of an earlier frame")]
    OutOfOrder,
}

/// What happened before the next good frame.
#[derive(Clone, Copy, Debug, Default)]
struct Pending {
    missing: u32,
    /// Whether more may be missing than is known.
    is_unknown: bool,
    /// Refused, or dropped by the full queue.
    rejected: u32,
}

/// A camera's worker.
pub struct Worker {
    options: WorkerOptions,
    pipeline: Pipeline,
    results: Results,
    reporter: Reporter,
    schedule: Schedule,
    sequence: Sequence,
    stamps: StampOrder,
    pending: Pending,
    counts: Counts,
    stages: StageTimes,
    /// Pixels of a decoded compressed image.
    pixels: Vec<u8>,
    last_time_ns: i64,
}

impl Worker {
    /// A worker that has seen nothing yet.
    pub fn new(
        options: WorkerOptions,
        pipeline: Pipeline,
        results: Results,
        reporter: Reporter,
    ) -> Self {
        Self {
            options,
            pipeline,
            results,
            reporter,
            schedule: Schedule::default(),
            sequence: Sequence::default(),
            stamps: StampOrder::default(),
            pending: Pending::default(),
            counts: Counts::default(),
            stages: StageTimes::default(),
            pixels: Vec::new(),
            last_time_ns: 0,
        }
    }

    /// Takes all input, ends the scan and reports a last time. Buffers of used messages go to `spare`.
    ///
    /// # Errors
    /// Nothing more can be published.
    pub fn run(
        mut self,
        input: &Queue<Input>,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(Counts, StageTimes), Halt> {
        let _closed_at_the_end = CloseOnDrop(input);
        while let Popped::Item(input, num_dropped) = input.pop_counted(None) {
            match input {
                Input::Message(message) => {
                    self.take_dropped(num_dropped);
                    self.take(&message, out)?;
                    // A closed or full queue of spares: the buffer is simply freed.
                    _ = spare.push(message.data, 0);
                }
                Input::NewRecording => {
                    self.end_scan(out)?;
                    self.stamps = StampOrder::default();
                    self.sequence.restart();
                    self.schedule.restart();
                }
                // Counted and told where it was read.
                Input::Damage(_) => {}
            }
        }
        self.end_scan(out)?;
        let interval = self.schedule.close(self.last_time_ns, &self.counts);
        self.report(interval, out)?;
        Ok((self.counts, self.stages))
    }

    /// Counts frames that a full queue has dropped before the next one.
    fn take_dropped(&mut self, num_dropped: u32) {
        self.counts.received += u64::from(num_dropped);
        self.counts.dropped_overload += u64::from(num_dropped);
        self.pending.rejected = self.pending.rejected.saturating_add(num_dropped);
        self.sequence.skip(num_dropped);
    }

    fn take(&mut self, message: &RawMessage, out: &mut Publisher<'_>) -> Result<(), Halt> {
        self.last_time_ns = message.log_time_ns;
        self.counts.received += 1;
        if self.options.sends_images {
            out.forward(message)?;
        }
        match self.measure(message, out)? {
            Ok(()) => self.counts.processed += 1,
            Err(rejection) => self.reject(&rejection, message),
        }
        self.counts.recorder_bytes = out.num_bytes();
        self.counts.recorder_dropped = out.num_dropped(Purpose::Record);
        match self.schedule.poll(message.log_time_ns, &self.counts) {
            Some(interval) => self.report(interval, out),
            None => Ok(()),
        }
    }

    /// Outer result: whether to go on at all; inner one: whether this frame was good.
    fn measure(
        &mut self,
        message: &RawMessage,
        out: &mut Publisher<'_>,
    ) -> Result<Result<(), Rejection>, Halt> {
        let started = Instant::now();
        let mut pixels = std::mem::take(&mut self.pixels);
        let decoded = decode(message, &self.options, &mut pixels);
        let measured = match decoded {
            Ok((header, image)) => self.measure_image(started, (&header, image), message, out),
            Err(rejection) => {
                self.place(message.sequence);
                Ok(Err(rejection))
            }
        };
        self.pixels = pixels;
        measured
    }

    fn measure_image(
        &mut self,
        started: Instant,
        (header, image): (&Header<'_>, image::Image<'_>),
        message: &RawMessage,
        out: &mut Publisher<'_>,
    ) -> Result<Result<(), Rejection>, Halt> {
        let stamp_ns = header.stamp.to_ns();
        match self.stamps.take(stamp_ns) {
            Ok(StampStep::Forward) => {}
            Ok(StampStep::ClockSetBack) => {
                tracing::warn!(
                    "the camera's clock was set back to {stamp_ns} ns: a new scan begins"
                );
                self.end_scan(out)?;
            }
            Err(fault) => {
                let missing = self.sequence.take_repeated(message.sequence);
                self.miss(missing);
                return Ok(Err(match fault {
                    StampFault::Duplicate => Rejection::Duplicate,
                    StampFault::OutOfOrder => Rejection::OutOfOrder,
                }));
            }
        }
        let place = self.place(message.sequence);
        let index = FrameIndex {
            frame_number: place.frame_number,
            frames_missing: self.pending.missing,
            frames_rejected: self.pending.rejected,
        };

        let mut clock = StageClock { last: started, stages: &mut self.stages };
        let frame = image::Frame { stamp_ns, image };
        let output = match self.pipeline.process(&frame, index, |stage| clock.tick(stage)) {
            Ok(output) => output,
            Err(error) => return Ok(Err(error.into())),
        };
        self.pending = Pending::default();
        self.counts.points += output.centerline.len() as u64;
        self.counts.slices += u64::from(output.slice.is_some());
        let time_ns = message.log_time_ns;
        self.results
            .publish_frame(&Measured { header, image, place, index, output, time_ns }, out)?;
        self.stages.encode.record(out.take_encoding_time());
        Ok(Ok(()))
    }

    /// The place of the next frame, with all that is missing since the last good one.
    fn place(&mut self, sequence: u32) -> Place {
        let place = self.sequence.take(sequence);
        self.miss(place.missing.unwrap_or(0));
        self.pending.is_unknown |= place.missing.is_none();
        Place { missing: (!self.pending.is_unknown).then_some(self.pending.missing), ..place }
    }

    fn miss(&mut self, missing: u32) {
        self.counts.lost_transport += u64::from(missing);
        self.pending.missing = self.pending.missing.saturating_add(missing);
    }

    fn reject(&mut self, rejection: &Rejection, message: &RawMessage) {
        let count = match rejection {
            Rejection::Duplicate => &mut self.counts.duplicate,
            Rejection::OutOfOrder => &mut self.counts.out_of_order,
            _ => &mut self.counts.malformed,
        };
        *count += 1;
        self.pending.rejected = self.pending.rejected.saturating_add(1);
        // One of a kind is enough to act on; the summary counts the rest.
        if *count == 1 {
            let time_ns = message.log_time_ns;
            tracing::warn!(
                "frame rejected (log time {time_ns} ns): {rejection}; further ones of this kind are only counted"
            );
        } else {
            tracing::debug!("frame rejected (log time {} ns): {rejection}", message.log_time_ns);
        }
    }

    fn end_scan(&mut self, out: &mut Publisher<'_>) -> Result<(), Halt> {
        let completed = self.pipeline.finish(self.pending.missing, self.pending.rejected);
        self.pending = Pending::default();
        self.counts.slices += u64::from(completed.slice.is_some());
        self.results.publish_completed(
            (completed.slice, completed.height_map),
            self.last_time_ns,
            out,
        )
    }

    fn report(&self, interval: Interval, out: &mut Publisher<'_>) -> Result<(), Halt> {
        let (now_ns, counts) = (self.last_time_ns, &self.counts);
        let status = self.reporter.stream_status(now_ns, counts, interval);
        out.publish(Output::StreamStatus, now_ns, &status)?;
        let diagnostics = self.reporter.diagnostics(now_ns, counts, interval);
        out.publish(Output::Diagnostics, now_ns, &diagnostics)
    }
}

/// Writes down how long each stage took.
struct StageClock<'a> {
    last: Instant,
    stages: &'a mut StageTimes,
}

impl StageClock<'_> {
    fn tick(&mut self, stage: Stage) {
        let now = Instant::now();
        let histogram = match stage {
            Stage::Decode => &mut self.stages.decode,
            Stage::Extract => &mut self.stages.extract,
            Stage::Triangulate => &mut self.stages.triangulate,
        };
        histogram.record(now - self.last);
        self.last = now;
    }
}

fn decode<'a>(
    message: &'a RawMessage,
    options: &WorkerOptions,
    pixels: &'a mut Vec<u8>,
) -> Result<(Header<'a>, image::Image<'a>), Rejection> {
    match options.transport {
        ImageTransport::Raw => {
            let message: Image<'_> = cdr::decode(&message.data)?;
            let image = frame::image(&message, options.max_frame_bytes)?;
            Ok((message.header, image))
        }
        ImageTransport::Compressed => {
            let message: CompressedImage<'_> = cdr::decode(&message.data)?;
            let image = compressed::image(&message, options.max_frame_bytes, pixels)?;
            Ok((message.header, image))
        }
    }
}
