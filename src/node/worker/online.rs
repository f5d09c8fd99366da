//! State that only a live camera has: commands, changing parameters, reports without frames, latency.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use super::{Now, Worker};
use crate::node::{
    board::Board,
    camera_info::{CameraMatch, ImageHeader},
    clock::{RosClock, system_ns},
    command::{Answer, Command, Mailbox, Reply, ScanRequest, Settings},
    histogram::Histogram,
    publisher::{PublishError, Publisher},
    queue::Queue,
    status::{self, Load, Note},
};

/// Period at which a worker without frames checks for due reports and new parameters.
const TICK: Duration = Duration::from_millis(100);

/// The state of a camera outside its worker.
#[derive(Clone, Debug, Default)]
pub(crate) struct Surroundings {
    /// Notes for the diagnostics.
    pub(crate) notes: Vec<Note>,
    /// Messages that the recorders dropped.
    pub(crate) recorder_dropped: u64,
    /// Bytes in the bags.
    pub(crate) recorder_bytes: u64,
}

/// Returns the surroundings; called once per report.
pub(crate) type Survey = Arc<dyn Fn() -> Surroundings + Send + Sync>;

/// The descriptions of a camera on a network.
pub(crate) trait Describe: Send {
    /// Observes a measured image and returns the description of its camera.
    fn observe(&self, image: &ImageHeader<'_>) -> CameraMatch;

    /// True if a description has arrived.
    fn is_described(&self) -> bool;
}

/// The part of a worker that only a live camera has.
pub(crate) struct Online {
    settings: Arc<Mailbox<Settings>>,
    clock: RosClock,
    /// Number of the clock's time discontinuities at the start of this session.
    num_breaks: u64,
    survey: Survey,
    describe: Box<dyn Describe>,
    /// Board for the last report.
    pub(super) board: Board,
    next_tick: Instant,
    latency: Histogram,
    queue_depth: u32,
    /// Length at which the open scan ends, metres; `None`: it ends when stopped.
    length_m: Option<f64>,
    /// Number of requested scans, which makes their identities differ.
    num_requested: u64,
    /// Reply to a request to drain, until all frames are measured.
    drain_reply: Option<Reply>,
}

impl Online {
    /// Takes new settings from the mailbox.
    pub(crate) fn new(
        settings: Arc<Mailbox<Settings>>,
        clock: RosClock,
        survey: Survey,
        describe: Box<dyn Describe>,
    ) -> Self {
        Self {
            settings,
            num_breaks: clock.num_breaks(),
            clock,
            survey,
            describe,
            board: Board::default(),
            next_tick: Instant::now() + TICK,
            latency: Histogram::default(),
            queue_depth: 0,
            length_m: None,
            num_requested: 0,
            drain_reply: None,
        }
    }

    /// Writes reports to `board`.
    #[must_use]
    pub(crate) fn with_board(self, board: Board) -> Self {
        Self { board, ..self }
    }

    pub(super) const fn next_tick(&self) -> Instant {
        self.next_tick
    }

    /// True while a request to drain is open.
    pub(super) const fn is_draining(&self) -> bool {
        self.drain_reply.is_some()
    }

    pub(super) fn surroundings(&self) -> Surroundings {
        (self.survey)()
    }

    pub(super) fn now_ns(&self) -> i64 {
        self.clock.now_ns()
    }

    /// True if time was set back or its source changed since the last call.
    fn has_time_broken(&mut self) -> bool {
        let num_breaks = self.clock.num_breaks();
        std::mem::replace(&mut self.num_breaks, num_breaks) != num_breaks
    }

    pub(super) fn observe(&self, image: &ImageHeader<'_>) -> CameraMatch {
        self.describe.observe(image)
    }

    pub(super) fn is_described(&self) -> bool {
        self.describe.is_described()
    }

    /// Records the latency from stamp to result. Ignores stamps in the future, which come from a clock that runs ahead.
    pub(super) fn note_latency(&mut self, stamp_ns: i64) {
        if let Ok(nanos) = u64::try_from(self.now_ns().saturating_sub(stamp_ns)) {
            self.latency.record(Duration::from_nanos(nanos));
        }
    }

    /// The load of the camera since the last call.
    pub(super) fn take_load(&mut self) -> Load {
        let queue_depth = std::mem::take(&mut self.queue_depth);
        if self.latency.is_empty() {
            return Load { queue_depth, ..Load::default() };
        }
        let seconds = |share| (self.latency.percentile_ms(share) / 1e3) as f32;
        let load = Load {
            latency_p50_s: seconds(0.50),
            latency_p99_s: seconds(0.99),
            latency_max_s: seconds(1.0),
            queue_depth,
        };
        self.latency.clear();
        load
    }
}

impl Worker {
    /// Called between two frames: applies new settings and starts a new session after a time discontinuity.
    pub(super) fn apply_changes(
        &mut self,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        self.apply_settings(spare, out)?;
        if self.online.as_mut().is_some_and(Online::has_time_broken) {
            self.release(Now::End, spare, out)?;
            tracing::warn!(
                "{}: time was set back or its source changed: starting a new session",
                self.reporter.topic
            );
            self.begin_session(out)?;
        }
        Ok(())
    }

    /// Applies new parameters from the next frame on. Ends a scan that cannot continue under them.
    fn apply_settings(
        &mut self,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        let Some(settings) = self.online.as_ref().and_then(|online| online.settings.take()) else {
            return Ok(());
        };
        self.release(Now::End, spare, out)?;
        self.measurer.reconfigure_positions(&settings.params.motion);
        if self.measurer.pipeline.must_end_for(&settings.params) {
            self.end_scan(out)?;
        }
        self.measurer.pipeline.reconfigure(settings.params);
        self.measurer.results.reconfigure(&settings.params, &settings.parameters_sha256);
        self.options.sends_images = settings.sends_images;
        Ok(())
    }

    /// Starts a session with a new identity. Counters continue.
    fn begin_session(&mut self, out: &mut Publisher<'_>) -> Result<(), PublishError> {
        self.restart_stream(out)?;
        self.reporter.begin_session(system_ns());
        Ok(())
    }

    pub(super) fn execute(
        &mut self,
        command: Command,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        let scan_id = self.measurer.pipeline.scan_id();
        match command {
            Command::StartScan(request, reply) => self.start_scan(request, &reply, out)?,
            Command::StopScan(reply) => {
                self.stop_scan(out)?;
                answer(&reply, scan_id.map_or("no scan was open", |_| "scan ended"), scan_id);
            }
            Command::Reset(reply) => {
                self.measurer.pipeline.discard();
                self.ledger.take_gap();
                self.measurer.pipeline.start_scanning();
                self.set_scan(ScanRequest::default());
                answer(&reply, scan_id.map_or("no scan was open", |_| "scan discarded"), scan_id);
            }
            Command::Drain(reply) => {
                if let Some(online) = &mut self.online {
                    online.drain_reply = Some(reply);
                }
            }
        }
        Ok(())
    }

    fn start_scan(
        &mut self,
        request: ScanRequest,
        reply: &Reply,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        if let Err(message) = self.check_scan(&request) {
            drop(reply.try_send(Answer { success: false, message, scan_id: None }));
            return Ok(());
        }
        self.end_scan(out)?;
        let scan_id = self.next_scan_id();
        self.measurer.pipeline.start_scanning();
        self.measurer.pipeline.set_next_scan_id(scan_id);
        self.set_scan(request);
        answer(reply, "the scan begins with the next frame", scan_id);
        Ok(())
    }

    /// `Err`: the reason to refuse the request.
    fn check_scan(&self, request: &ScanRequest) -> Result<(), String> {
        if !self.measurer.pipeline.is_calibrated() {
            return Err("a scan needs a calibration: set calibration_file".to_owned());
        }
        match request.length_m {
            Some(length_m) if self.measurer.pipeline.travels_by_angle() => Err(format!(
                "length is {length_m} m, but the axis is revolute and turns by an angle: set length to 0 and end the scan \
                 with ~/stop_scan, or limit its frames with scan.max_profiles"
            )),
            _ => Ok(()),
        }
    }

    /// The identity is chosen before the first frame: the caller may wait for the answer before it starts the motion.
    fn next_scan_id(&mut self) -> Option<[u8; 16]> {
        let online = self.online.as_mut()?;
        online.num_requested += 1;
        let seed =
            format!("{:?} {} {}", self.reporter.session_id, online.num_requested, system_ns());
        Some(status::session_id(&self.reporter.topic, &seed))
    }

    fn stop_scan(&mut self, out: &mut Publisher<'_>) -> Result<(), PublishError> {
        self.end_scan(out)?;
        self.measurer.pipeline.stop_scanning();
        self.set_scan(ScanRequest::default());
        Ok(())
    }

    fn set_scan(&mut self, request: ScanRequest) {
        self.measurer.results.set_part_id(request.part_id);
        if let Some(online) = &mut self.online {
            online.length_m = request.length_m;
        }
    }

    /// Ends a scan that has reached the requested length.
    pub(super) fn end_at_length(&mut self, out: &mut Publisher<'_>) -> Result<(), PublishError> {
        let length_m = self.online.as_ref().and_then(|online| online.length_m);
        let is_open = self.measurer.pipeline.scan_id().is_some();
        match (length_m, self.measurer.travelled) {
            (Some(length_m), Some(travelled)) if is_open && travelled.reaches_m(length_m) => {
                tracing::info!("the scan ends at its length of {length_m} m");
                self.stop_scan(out)
            }
            _ => Ok(()),
        }
    }

    /// Reports on schedule even without frames, and answers a request to drain when the queue is empty.
    pub(super) fn tick(
        &mut self,
        queue_depth: usize,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        let Some(online) = &mut self.online else { return Ok(()) };
        online.queue_depth = online.queue_depth.max(queue_depth as u32);
        let drained = if queue_depth == 0 { online.drain_reply.take() } else { None };
        let is_due = Instant::now() >= online.next_tick;
        if is_due {
            online.next_tick = Instant::now() + TICK;
        }
        if let Some(reply) = drained {
            self.begin_session(out)?;
            answer(&reply, "all queued frames are measured", None);
        }
        if !is_due {
            return Ok(());
        }
        let now_ns = self.report_time_ns();
        match self.schedule.poll(now_ns, self.ledger.counts()) {
            Some(interval) => self.report(now_ns, interval, out),
            None => Ok(()),
        }
    }
}

fn answer(reply: &Reply, message: &str, scan_id: Option<[u8; 16]>) {
    // The caller may have timed out.
    drop(reply.try_send(Answer { success: true, message: message.to_owned(), scan_id }));
}
