//! What only a live camera has: commands, parameters that change, time that passes without frames, latency.

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

/// How often a worker without frames looks up: reports and new parameters wait no longer.
const TICK: Duration = Duration::from_millis(100);

/// What others know of the camera's state.
#[derive(Clone, Debug, Default)]
pub struct Surroundings {
    /// In words.
    pub notes: Vec<Note>,
    /// Messages that did not reach a bag.
    pub recorder_dropped: u64,
    /// Bytes in the bags.
    pub recorder_bytes: u64,
}

/// Asks them, once a report.
pub type Survey = Arc<dyn Fn() -> Surroundings + Send + Sync>;

/// Looks at every image that is measured, and says what is known of its camera.
pub type Observe = Box<dyn FnMut(&ImageHeader<'_>) -> CameraMatch + Send>;

/// The live side of a worker.
pub struct Online {
    settings: Arc<Mailbox<Settings>>,
    clock: RosClock,
    /// Breaks in the clock's time that the session before this one ended with.
    num_breaks: u64,
    survey: Survey,
    observe: Observe,
    /// Where reports are left.
    pub(super) board: Board,
    next_tick: Instant,
    latency: Histogram,
    queue_depth: u32,
    /// Length at which the open scan ends, metres; 0: when it is stopped.
    length_m: f64,
    /// Scans that were asked for, which makes their identities differ.
    num_asked: u64,
    /// Who waits for everything to be measured.
    drain_reply: Option<Reply>,
}

impl Online {
    /// A live side that takes new settings from the mailbox.
    pub fn new(
        settings: Arc<Mailbox<Settings>>,
        clock: RosClock,
        survey: Survey,
        observe: Observe,
    ) -> Self {
        Self {
            settings,
            num_breaks: clock.num_breaks(),
            clock,
            survey,
            observe,
            board: Board::default(),
            next_tick: Instant::now() + TICK,
            latency: Histogram::default(),
            queue_depth: 0,
            length_m: 0.0,
            num_asked: 0,
            drain_reply: None,
        }
    }

    /// Leaves reports on `board`.
    #[must_use]
    pub fn with_board(self, board: Board) -> Self {
        Self { board, ..self }
    }

    pub(super) const fn next_tick(&self) -> Instant {
        self.next_tick
    }

    /// Whether somebody waits for everything to be measured.
    pub(super) const fn is_draining(&self) -> bool {
        self.drain_reply.is_some()
    }

    pub(super) fn surroundings(&self) -> Surroundings {
        (self.survey)()
    }

    pub(super) fn now_ns(&self) -> i64 {
        self.clock.now_ns()
    }

    /// Whether time has not gone on since the last call.
    fn has_time_broken(&mut self) -> bool {
        let num_breaks = self.clock.num_breaks();
        std::mem::replace(&mut self.num_breaks, num_breaks) != num_breaks
    }

    pub(super) fn observe(&mut self, image: &ImageHeader<'_>) -> CameraMatch {
        (self.observe)(image)
    }

    /// From the stamp to the result. A stamp of the future, by a clock that runs ahead, tells nothing.
    pub(super) fn note_latency(&mut self, stamp_ns: i64) {
        if let Ok(nanos) = u64::try_from(self.now_ns().saturating_sub(stamp_ns)) {
            self.latency.record(Duration::from_nanos(nanos));
        }
    }

    /// How busy the camera was since the last call.
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
    /// Between two frames: takes new settings, and notices when time does not go on.
    pub(super) fn apply_changes(
        &mut self,
        spare: &Queue<Vec<u8>>,
        out: &mut Publisher<'_>,
    ) -> Result<(), PublishError> {
        self.apply_settings(spare, out)?;
        if self.online.as_mut().is_some_and(Online::has_time_broken) {
            self.release(Now::End, spare, out)?;
            tracing::warn!("{}: time did not go on: a new session begins", self.reporter.topic);
            self.begin_session(out)?;
        }
        Ok(())
    }

    /// Measures by new parameters from the next frame on. A scan that cannot go on under them ends first.
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

    /// Counters go on, but what comes next has another identity.
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
        if !self.measurer.pipeline.is_calibrated() {
            let message = "without a calibration there is no scan: set calibration_file".to_owned();
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

    /// Known before the first frame: a camera may be triggered by the motion that waits for this answer.
    fn next_scan_id(&mut self) -> Option<[u8; 16]> {
        let online = self.online.as_mut()?;
        online.num_asked += 1;
        let asked = format!("{:?} {} {}", self.reporter.session_id, online.num_asked, system_ns());
        Some(status::session_id(&self.reporter.topic, &asked))
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

    /// Ends a scan that has the length that was asked for.
    pub(super) fn end_at_length(&mut self, out: &mut Publisher<'_>) -> Result<(), PublishError> {
        let length_m = self.online.as_ref().map_or(0.0, |online| online.length_m);
        let is_open = self.measurer.pipeline.scan_id().is_some();
        if length_m > 0.0 && is_open && self.measurer.travelled >= length_m {
            tracing::info!("the scan has its length of {length_m} m: it ends");
            return self.stop_scan(out);
        }
        Ok(())
    }

    /// Lets time pass: a camera that sends nothing is reported too.
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
            answer(&reply, "everything is measured", None);
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
    // Whoever asked may have given up waiting.
    drop(reply.try_send(Answer { success: true, message: message.to_owned(), scan_id }));
}
