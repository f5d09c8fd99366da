//! The one thread of a camera: it owns the pipeline, judges every frame and publishes what the pipeline says.

mod axis;
mod frame;
mod framing;
pub mod live;

use std::sync::Arc;

use crate::{
    ros::node_params::ImageTransport,
    scanner::{axis::AxisTravel, calibration::Calibration, pipeline::Pipeline},
};

use super::{
    board::Reported,
    clock::system_ns,
    fan_out::CloseOnDrop,
    order::{Sequence, StampOrder},
    positions::{
        Positions,
        inbox::Inbox,
        waiting::{Held, Now, Waiter, Waiting},
    },
    publisher::{Halt, Publisher},
    queue::{Popped, Queue},
    results::Results,
    sink::Purpose,
    source::{Input, Writer},
    statistics::{Counts, StageTimes},
    status::{Interval, Load, Reporter, Schedule, State},
    topics::Output,
    unpack::{Picture, Unpacked},
};
use framing::Framing;
use live::Live;

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
    /// Distance of the last measured frame from the first of its scan.
    travelled: Option<AxisTravel>,
    /// Where frames were taken, when that is measured.
    positions: Option<Positions>,
    /// Where messages about that wait, live.
    inbox: Option<Arc<Inbox>>,
    /// Topics that they come on.
    position_topics: Vec<String>,
    /// Frames that wait for their positions.
    waiting: Waiting,
    last_writer: Writer,
    /// Why the last frame was refused, until it is reported.
    last_rejection: Option<String>,
    /// What is known of the camera.
    framing: Framing,
    /// What only a live camera has.
    live: Option<Live>,
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
            travelled: None,
            positions: None,
            inbox: None,
            position_topics: Vec::new(),
            waiting: Waiting::default(),
            last_writer: Writer::default(),
            last_rejection: None,
            framing: Framing::default(),
            live: None,
        }
    }

    /// Makes it the worker of a live camera.
    #[must_use]
    pub fn with_live(self, live: Live) -> Self {
        Self { live: Some(live), ..self }
    }

    /// Makes it ask where frames were taken; messages about that come on `topics`.
    #[must_use]
    pub fn with_positions(self, positions: Option<Positions>, topics: Vec<String>) -> Self {
        Self { positions, position_topics: topics, ..self }
    }

    /// Makes it look there for messages about the axis.
    #[must_use]
    pub fn with_inbox(self, inbox: Arc<Inbox>) -> Self {
        Self { inbox: Some(inbox), ..self }
    }

    /// The topics of messages about the axis.
    pub fn position_topics(&self) -> &[String] {
        &self.position_topics
    }

    /// Makes it refuse images of another camera than the calibrated one, and measure those of a part of its sensor as such;
    /// recorded descriptions of the camera come on `topic`, one of those of the positions.
    #[must_use]
    pub fn with_camera_info(self, calibration: Option<Calibration>, topic: Option<String>) -> Self {
        Self { framing: Framing::new(calibration, topic), ..self }
    }

    /// The largest picture that it takes, bytes, where its images are compressed.
    pub fn unpacks_bytes(&self) -> Option<u64> {
        let WorkerOptions { transport, max_frame_bytes, .. } = self.options;
        (transport == ImageTransport::Compressed).then_some(max_frame_bytes)
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
        loop {
            match input.pop_counted(self.live.as_ref().map(Live::next_tick)) {
                Popped::Item(item, num_dropped) => {
                    self.look_up(spare, out)?;
                    self.take_input(item, num_dropped, spare, out)?;
                }
                Popped::TimedOut => self.look_up(spare, out)?,
                Popped::Closed => break,
            }
            self.let_go(spare, out)?;
            self.tick(input.len() + self.waiting.len(), out)?;
        }
        self.finish(spare, out)?;
        Ok((self.counts, self.stages))
    }

    /// Takes one input at once, for who has no queue: a viewer that jumps about in a recording.
    ///
    /// # Errors
    /// Nothing more can be published.
    pub fn step(
        &mut self,
        item: Input,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), Halt> {
        self.take_input(item, 0, spare, out)?;
        self.let_go(spare, out)
    }

    /// Measures what still waits, ends the scan and reports a last time.
    ///
    /// # Errors
    /// Nothing more can be published.
    pub fn finish(&mut self, spare: &Queue<Vec<u8>>, out: &mut Publisher<'_>) -> Result<(), Halt> {
        self.release(Now::End, spare, out)?;
        self.end_scan(out)?;
        let now_ns = self.report_time_ns();
        let interval = self.schedule.close(now_ns, &self.counts);
        self.report(now_ns, interval, out)
    }

    fn take_input(
        &mut self,
        item: Input,
        num_dropped: u32,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), Halt> {
        let waiter = match item {
            Input::Message(message, writer) => {
                Waiter::Frame(Unpacked { message, writer, picture: None })
            }
            Input::Ahead(ahead) => match ahead.wait() {
                Some(unpacked) => Waiter::Frame(unpacked),
                None => Waiter::Fault("the thread that unpacks images is gone".to_owned()),
            },
            Input::Fault(what) => Waiter::Fault(what),
            other => return self.take_other(other, spare, out),
        };
        if self.positions.is_some() {
            return self.hold(waiter, num_dropped, spare, out);
        }
        self.take_dropped(num_dropped);
        self.take_waiter(waiter, spare, out)
    }

    /// What is no frame.
    fn take_other(
        &mut self,
        item: Input,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), Halt> {
        match item {
            Input::Position(message) => self.take_position(&message, spare, out),
            Input::Positions => self.open_inbox(spare, out),
            Input::NewRecording => {
                self.release(Now::End, spare, out)?;
                self.begin_anew(out)
            }
            // Counted and told where it was read; and frames are not taken here.
            Input::Damage(_) | Input::Message(..) | Input::Ahead(_) | Input::Fault(_) => Ok(()),
            Input::Command(command) => self.obey(command, out),
        }
    }

    /// Takes what has come, or need not wait any longer.
    fn take_waiter(
        &mut self,
        waiter: Waiter,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), Halt> {
        let Unpacked { message, writer, picture } = match waiter {
            Waiter::Frame(unpacked) => unpacked,
            Waiter::Fault(what) => {
                self.take_fault(&what);
                return Ok(());
            }
        };
        if writer != self.last_writer {
            self.last_writer = writer;
            self.sequence.restart();
        }
        self.take(&message, picture.as_ref(), out)?;
        picture.into_iter().for_each(Picture::give_back);
        // A closed or full queue of spares: the buffer is simply freed.
        _ = spare.push(message.data, 0);
        Ok(())
    }

    /// What comes next does not go on from what came before.
    fn begin_anew(&mut self, out: &mut Publisher<'_>) -> Result<(), Halt> {
        self.end_scan(out)?;
        self.positions.iter_mut().for_each(Positions::restart);
        self.stamps = StampOrder::default();
        self.sequence.restart();
        self.schedule.restart();
        Ok(())
    }

    /// The time by the clock of the log times: of a recording that of its last message.
    fn report_time_ns(&self) -> i64 {
        // A simulation's clock may stand still, and frames are received by the machine's.
        self.live.as_ref().map_or(self.last_time_ns, |_| system_ns())
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

    /// Says how the stream is doing; `now_ns` is when by the clock of the log times.
    fn report(
        &mut self,
        now_ns: i64,
        interval: Interval,
        out: &mut Publisher<'_>,
    ) -> Result<(), Halt> {
        let (mut stamp_ns, mut load, mut notes) = (now_ns, Load::default(), Vec::new());
        if let Some(live) = &mut self.live {
            let surroundings = live.surroundings();
            self.counts.recorder_dropped =
                out.num_dropped(Purpose::Record) + surroundings.recorder_dropped;
            self.counts.recorder_bytes = surroundings.recorder_bytes;
            (stamp_ns, load, notes) = (live.now_ns(), live.take_load(), surroundings.notes);
        }
        if let Some(live) = &self.live {
            let rate_hz = interval.rate_hz;
            live.board.write(Reported { counts: self.counts, rate_hz, load });
        }
        let last_rejection = self.last_rejection.take();
        let state = State { counts: self.counts, interval, load, notes, last_rejection };
        let status = self.reporter.stream_status(stamp_ns, &state);
        out.publish(Output::StreamStatus, now_ns, &status)?;
        let diagnostics = self.reporter.diagnostics(stamp_ns, &state);
        out.publish(Output::Diagnostics, now_ns, &diagnostics)
    }
}
