//! The worker of a camera: the one thread that checks and measures every frame and publishes its results.
//!
//! The ledger counts and orders frames, the measurer measures and publishes them; the worker joins the two.

mod axis;
mod chosen_channel;
mod frame;
mod framing;
mod ledger;
mod measurer;
mod missing_stripe;
mod opening;
mod requested_scan;
mod standing;
pub(crate) mod online;

use std::{sync::Arc, time::Instant};

use crate::{
    ros::node_params::ImageTransport,
    scanner::{calibration::Calibration, pipeline::Pipeline},
};

use super::{
    board::Reported,
    clock::system_ns,
    fan_out::CloseOnDrop,
    positions::{
        Positions,
        inbox::Inbox,
        waiting::{Arrival, Held, Now, Waiting},
    },
    publisher::{PublishError, Publisher},
    queue::{Popped, Queue},
    results::Results,
    source::Input,
    static_tf::RecordedTf,
    statistics::{Counts, StageTimes},
    status::{Interval, Load, Reporter, Schedule, State},
    topics::Output,
    unpack::{Picture, Unpacked},
};
use framing::Framing;
use ledger::Ledger;
use measurer::Measurer;
use missing_stripe::Explainer;
use online::Online;
use opening::Opening;
use standing::Standing;

/// Options for the input of a worker.
#[derive(Clone, Debug)]
pub(crate) struct WorkerOptions {
    /// Transport of the images.
    pub(crate) transport: ImageTransport,
    /// Largest decoded image, bytes.
    pub(crate) max_frame_bytes: u64,
    /// True if input images are forwarded with the results.
    pub(crate) sends_images: bool,
}

/// A camera's worker.
pub(crate) struct Worker {
    options: WorkerOptions,
    ledger: Ledger,
    measurer: Measurer,
    reporter: Reporter,
    schedule: Schedule,
    /// Log time of the last frame, nanoseconds since the epoch.
    last_time_ns: i64,
    /// Queue of messages about the axis, on a network.
    inbox: Option<Arc<Inbox>>,
    /// Topics of messages about the axis.
    position_topics: Vec<String>,
    /// Frames that wait for their positions.
    waiting: Waiting,
    /// Descriptions of the camera.
    framing: Framing,
    /// The first frames, which wait for a description.
    opening: Opening,
    /// Scans without a motion.
    standing: Standing,
    /// State that only a camera on a network has.
    online: Option<Online>,
}

impl Worker {
    /// Creates a worker without measured positions, for a replay.
    pub(crate) fn new(
        options: WorkerOptions,
        pipeline: Pipeline,
        results: Results,
        reporter: Reporter,
    ) -> Self {
        Self {
            options,
            ledger: Ledger::default(),
            measurer: Measurer::new(pipeline, results),
            reporter,
            schedule: Schedule::default(),
            last_time_ns: 0,
            inbox: None,
            position_topics: Vec::new(),
            waiting: Waiting::default(),
            framing: Framing::default(),
            opening: Opening::default(),
            standing: Standing::default(),
            online: None,
        }
    }

    /// Adds the state of a camera on a network.
    #[must_use]
    pub(crate) fn with_online(self, online: Online) -> Self {
        Self { online: Some(online), ..self }
    }

    /// Adds measured positions; their messages arrive on `topics`.
    #[must_use]
    pub(crate) fn with_positions(
        mut self,
        positions: Option<Positions>,
        topics: Vec<String>,
    ) -> Self {
        self.measurer.positions = positions;
        Self { position_topics: topics, ..self }
    }

    /// Writes the pose of the laser plane with the results, on the topic after the published ones.
    #[must_use]
    pub(crate) fn with_static_tf(mut self, static_tf: Option<RecordedTf>) -> Self {
        self.measurer.results.set_static_tf(static_tf);
        self
    }

    /// Adds a queue of messages about the axis.
    #[must_use]
    pub(crate) fn with_inbox(self, inbox: Arc<Inbox>) -> Self {
        Self { inbox: Some(inbox), ..self }
    }

    /// The topics of messages about the axis.
    pub(crate) fn position_topics(&self) -> &[String] {
        &self.position_topics
    }

    /// Checks images against `camera_info`: images of another camera are rejected, images of a region of the sensor are
    /// measured as such. Recorded `camera_info` arrives on `topic`, which is one of the position topics.
    #[must_use]
    pub(crate) fn with_camera_info(
        self,
        calibration: Option<Calibration>,
        topic: Option<String>,
    ) -> Self {
        Self { framing: Framing::new(calibration, topic), ..self }
    }

    /// Returns the size of the largest decoded image, bytes; `None` if images are not compressed.
    pub(crate) fn unpacks_bytes(&self) -> Option<u64> {
        let WorkerOptions { transport, max_frame_bytes, .. } = self.options;
        (transport == ImageTransport::Compressed).then_some(max_frame_bytes)
    }

    /// Processes all input, ends the scan and publishes a final report. Buffers of processed messages go to `spare`.
    ///
    /// # Errors
    /// Nothing more can be published.
    pub(crate) fn run(
        mut self,
        input: &Queue<Input>,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(Counts, StageTimes), PublishError> {
        let _closed_at_the_end = CloseOnDrop(input);
        loop {
            match input.pop_counted(self.online.as_ref().map(Online::next_tick)) {
                Popped::Item(item, num_dropped) => {
                    self.apply_changes(spare, out)?;
                    self.take_input(item, num_dropped, spare, out)?;
                }
                Popped::TimedOut => self.apply_changes(spare, out)?,
                Popped::Closed => break,
            }
            self.release_overdue(spare, out)?;
            self.tick(input.len() + self.opening.len() + self.waiting.len(), out)?;
        }
        self.finish(spare, out)?;
        Ok((*self.ledger.counts(), self.measurer.into_stages()))
    }

    /// Processes one input without a queue, for a viewer that seeks in a recording.
    ///
    /// # Errors
    /// Nothing more can be published.
    pub(crate) fn step(
        &mut self,
        item: Input,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        self.take_input(item, 0, spare, out)?;
        self.release_overdue(spare, out)
    }

    /// Measures the waiting frames, ends the scan and publishes a final report.
    ///
    /// # Errors
    /// Nothing more can be published.
    pub(crate) fn finish(
        &mut self,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        self.release(Now::End, spare, out)?;
        self.end_scan(out)?;
        self.count_recorded(out);
        let now_ns = self.report_time_ns();
        let interval = self.schedule.close(now_ns, self.ledger.counts());
        self.report(now_ns, interval, out)
    }

    fn take_input(
        &mut self,
        item: Input,
        num_dropped: u32,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        let arrival = match item {
            Input::Message(message, publisher) => {
                Arrival::Frame(Unpacked { message, publisher, picture: None })
            }
            Input::Ahead(ahead) => match ahead.wait() {
                Some(unpacked) => Arrival::Frame(unpacked),
                None => Arrival::Fault("the thread that decompresses images has ended".to_owned()),
            },
            Input::Fault(what) => Arrival::Fault(what),
            other => return self.take_non_frame(other, spare, out),
        };
        if !self.is_opening() {
            return self.take_in_order(arrival, num_dropped, spare, out);
        }
        let received_ns = arrival.received_ns().unwrap_or(self.last_time_ns);
        let since = Instant::now();
        let held = Held { arrival, num_dropped, stamp_ns: None, received_ns, since };
        self.hold_opening(held, spare, out)
    }

    /// Processes a frame or a fault, or queues it until its position is known.
    fn take_in_order(
        &mut self,
        arrival: Arrival,
        num_dropped: u32,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        if self.measurer.positions.is_some() {
            return self.hold(arrival, num_dropped, spare, out);
        }
        self.ledger.count_dropped(num_dropped);
        self.take_arrival(arrival, spare, out)
    }

    /// Processes an input that is not a frame.
    fn take_non_frame(
        &mut self,
        item: Input,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        match item {
            Input::Position(message) => self.take_position(&message, spare, out),
            Input::Positions => self.drain_inbox(spare, out),
            Input::NewRecording => {
                self.release(Now::End, spare, out)?;
                self.restart_stream(out)?;
                self.reopen();
                Ok(())
            }
            // The reader counts and reports damage; frames never get here.
            Input::Damage(_) | Input::Message(..) | Input::Ahead(_) | Input::Fault(_) => Ok(()),
            Input::Command(command) => {
                self.release_opening(Now::End, spare, out)?;
                self.execute(command, out)
            }
        }
    }

    /// Processes a frame or a fault that need not wait any longer.
    fn take_arrival(
        &mut self,
        arrival: Arrival,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        let Unpacked { message, publisher, picture } = match arrival {
            Arrival::Frame(unpacked) => unpacked,
            Arrival::Fault(what) => {
                self.ledger.count_fault(&what, self.last_time_ns);
                return Ok(());
            }
        };
        self.ledger.note_publisher(publisher);
        self.take(&message, picture.as_ref(), out)?;
        picture.into_iter().for_each(Picture::give_back);
        // If the queue of spare buffers is closed or full, the buffer is freed.
        _ = spare.push(message.data, 0);
        Ok(())
    }

    /// Prepares for input that does not continue the earlier one.
    fn restart_stream(&mut self, out: &mut Publisher<'_>) -> Result<(), PublishError> {
        self.restart_frames(out)?;
        self.measurer.positions.iter_mut().for_each(Positions::restart);
        Ok(())
    }

    /// Starts a session with the frame at `stamp_ns`, with which the stamps begin again. Positions see that by themselves,
    /// and those of this frame may be there.
    fn begin_again(&mut self, stamp_ns: i64, out: &mut Publisher<'_>) -> Result<(), PublishError> {
        self.restart_frames(out)?;
        self.ledger.begin_again(stamp_ns);
        self.reporter.begin_session(self.report_time_ns());
        Ok(())
    }

    /// Prepares for frames that do not continue the earlier ones.
    fn restart_frames(&mut self, out: &mut Publisher<'_>) -> Result<(), PublishError> {
        self.end_scan(out)?;
        self.measurer.explainer = Explainer::default();
        self.ledger.restart();
        self.schedule.restart();
        Ok(())
    }

    /// The time of a report by the clock of the log times, nanoseconds; in a replay, that of the last frame.
    fn report_time_ns(&self) -> i64 {
        // Log times follow the system clock; a simulated clock may stand still.
        self.online.as_ref().map_or(self.last_time_ns, |_| system_ns())
    }

    fn end_scan(&mut self, out: &mut Publisher<'_>) -> Result<(), PublishError> {
        let gap = self.ledger.take_gap();
        let has_slice = self.measurer.end_scan(gap, self.last_time_ns, out)?;
        self.standing.end_scan();
        self.note_interruption();
        self.ledger.count_last_slices(usize::from(has_slice));
        Ok(())
    }

    /// Publishes status and diagnostics; `now_ns` is by the clock of the log times.
    fn report(
        &mut self,
        now_ns: i64,
        interval: Interval,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        let (mut stamp_ns, mut load, mut notes) = (now_ns, Load::default(), Vec::new());
        if let Some(online) = &mut self.online {
            (stamp_ns, load, notes) = (online.now_ns(), online.take_load(), online.notes());
        }
        if let Some(online) = &self.online {
            let rate_hz = interval.rate_hz;
            online.board.write(&Reported { counts: *self.ledger.counts(), rate_hz, load });
        }
        let last_rejection = self.ledger.take_last_rejection();
        notes.extend(self.standing.note(interval));
        notes.extend(missing_stripe::note(interval, self.ledger.counts()));
        let counts = *self.ledger.counts();
        let channel = self.ledger.channel();
        let state = State { counts, interval, load, notes, last_rejection, channel };
        let status = self.reporter.stream_status(stamp_ns, &state);
        out.publish(Output::StreamStatus, now_ns, &status)?;
        let diagnostics = self.reporter.diagnostics(stamp_ns, &state);
        out.publish(Output::Diagnostics, now_ns, &diagnostics)
    }
}
