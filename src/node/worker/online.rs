//! State that only a live camera has: commands, changing parameters, reports without frames, latency.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use super::{Now, Worker, missing_stripe::Explainer, requested_scan::RequestedScan};
use crate::node::{
    board::Board,
    camera_info::{CameraMatch, ImageHeader},
    clock::{RosClock, system_ns},
    command::{Answer, Command, Mailbox, Reply, ScanRequest, Settings},
    histogram::Histogram,
    publisher::{PublishError, Publisher},
    queue::Queue,
    scan_watch::ScanEnd,
    sink::Purpose,
    status::{Load, Note},
};

/// Period at which a worker without frames checks for due reports and new parameters.
const TICK: Duration = Duration::from_millis(100);

/// Longest latency, nanoseconds: a stamp further from now, before or after, is that of a recording, or of a clock that is
/// not set. No queue here holds a frame for as long.
const MAX_LATENCY_NS: u64 = 60_000_000_000;

/// Relation of a stamp to the present.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stamped {
    /// It gives a latency, unless it lies in the near future.
    OfNow,
    /// It gives none.
    NotOfNow,
}

/// Counters of a camera's recorders.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Recorded {
    /// Messages that they dropped.
    pub(crate) dropped: u64,
    /// Bytes in the bags.
    pub(crate) bytes: u64,
}

/// Looks at the state of a camera outside its worker.
pub(crate) trait Survey: Send {
    /// Returns notes for the diagnostics; called once per report.
    fn notes(&self) -> Vec<Note>;

    /// Returns what the recorders have done; called ten times a second.
    fn recorded(&self) -> Recorded;
}

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
    survey: Box<dyn Survey>,
    describe: Box<dyn Describe>,
    /// Board for the last report.
    pub(super) board: Board,
    next_tick: Instant,
    latency: Histogram,
    /// Frames since the last report that have no latency.
    num_not_of_now: u32,
    queue_depth: u32,
    /// The requested scan; `None` if it ends when stopped and nobody waits for it.
    pub(super) scan: Option<RequestedScan>,
    /// Number of requested scans, which makes their identities differ.
    pub(super) num_requested: u64,
    /// Reply to a request to drain, until all frames are measured.
    drain_reply: Option<Reply>,
}

impl Online {
    /// Takes new settings from the mailbox.
    pub(crate) fn new(
        settings: Arc<Mailbox<Settings>>,
        clock: RosClock,
        survey: Box<dyn Survey>,
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
            num_not_of_now: 0,
            queue_depth: 0,
            scan: None,
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

    pub(super) fn notes(&self) -> Vec<Note> {
        self.survey.notes()
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

    /// Records the latency from stamp to result. Ignores stamps in the future, which come from a clock that runs ahead,
    /// and stamps that are not of now.
    pub(super) fn note_latency(&mut self, stamp_ns: i64) -> Stamped {
        let now_ns = self.now_ns();
        if now_ns.abs_diff(stamp_ns) > MAX_LATENCY_NS {
            self.num_not_of_now = self.num_not_of_now.saturating_add(1);
            return Stamped::NotOfNow;
        }
        if let Ok(nanos) = u64::try_from(now_ns - stamp_ns) {
            self.latency.record(Duration::from_nanos(nanos));
        }
        Stamped::OfNow
    }

    /// The load of the camera since the last call.
    pub(super) fn take_load(&mut self) -> Load {
        let queue_depth = std::mem::take(&mut self.queue_depth);
        let num_not_of_now = std::mem::take(&mut self.num_not_of_now);
        if self.latency.is_empty() {
            return Load { queue_depth, num_not_of_now, ..Load::default() };
        }
        let seconds = |share| (self.latency.percentile_ms(share) / 1e3) as f32;
        let load = Load {
            latency_p50_s: seconds(0.50),
            latency_p99_s: seconds(0.99),
            latency_max_s: seconds(1.0),
            queue_depth,
            num_not_of_now,
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
        self.measurer.explainer = Explainer::default();
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
                self.stop_scan(ScanEnd::Stopped, out)?;
                answer(&reply, scan_id.map_or("no scan was open", |_| "scan ended"), scan_id);
            }
            Command::Reset(reply) => {
                self.give_up_scan(ScanEnd::Discarded);
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

    /// Counts what the recorders of a camera on a network have done.
    pub(super) fn count_recorded(&mut self, out: &Publisher<'_>) {
        if let Some(online) = &self.online {
            let Recorded { dropped, bytes } = online.survey.recorded();
            self.ledger.set_recorded(bytes, out.num_dropped(Purpose::Record) + dropped);
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
        self.end_at_limit(out)?;
        if let Some(reply) = drained {
            // Publishes the last slice of a scan before it ends for whoever waits for it.
            self.begin_session(out)?;
            self.abort_watched_scan();
            answer(&reply, "all queued frames are measured", None);
        }
        if !is_due {
            return Ok(());
        }
        self.count_recorded(out);
        let now_ns = self.report_time_ns();
        match self.schedule.poll(now_ns, self.ledger.counts()) {
            Some(interval) => self.report(now_ns, interval, out),
            None => Ok(()),
        }
    }
}

pub(super) fn answer(reply: &Reply, message: &str, scan_id: Option<[u8; 16]>) {
    // The caller may have timed out.
    drop(reply.try_send(Answer { success: true, message: message.to_owned(), scan_id }));
}
