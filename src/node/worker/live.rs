//! What only a live camera has: commands, parameters that change, time that passes without frames, latency.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use super::Worker;
use crate::node::{
    camera_info::ImageHeader,
    clock::system_ns,
    command::{Answer, Command, Mailbox, Reply, ScanRequest, Settings},
    histogram::Histogram,
    publisher::{Halt, Publisher},
    status::{Load, Note},
};

/// How often a worker without frames looks up: reports and new parameters wait no longer.
const TICK: Duration = Duration::from_millis(100);

/// Tells the time, nanoseconds since the epoch: the system's, or that of a simulation.
pub type NowNs = Arc<dyn Fn() -> i64 + Send + Sync>;
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

/// Looks at every image that is measured.
pub type Observe = Box<dyn FnMut(&ImageHeader<'_>) + Send>;

/// The live side of a worker.
pub struct Live {
    settings: Arc<Mailbox<Settings>>,
    now_ns: NowNs,
    survey: Survey,
    observe: Observe,
    next_tick: Instant,
    latency: Histogram,
    queue_depth: u32,
    /// Length at which the open scan ends, metres; 0: when it is stopped.
    length_m: f64,
    /// Who waits for the identity of the scan that has begun.
    starting: Option<Reply>,
}

impl Live {
    /// A live side that takes new settings from the mailbox.
    pub fn new(
        settings: Arc<Mailbox<Settings>>,
        now_ns: NowNs,
        survey: Survey,
        observe: Observe,
    ) -> Self {
        Self {
            settings,
            now_ns,
            survey,
            observe,
            next_tick: Instant::now() + TICK,
            latency: Histogram::default(),
            queue_depth: 0,
            length_m: 0.0,
            starting: None,
        }
    }

    pub(super) const fn next_tick(&self) -> Instant {
        self.next_tick
    }

    pub(super) fn surroundings(&self) -> Surroundings {
        (self.survey)()
    }

    pub(super) fn now_ns(&self) -> i64 {
        (self.now_ns)()
    }

    pub(super) fn observe(&mut self, image: &ImageHeader<'_>) {
        (self.observe)(image);
    }

    /// From the stamp to the result. A stamp of the future, by a clock that runs ahead, tells nothing.
    pub(super) fn note_latency(&mut self, stamp_ns: i64) {
        if let Ok(nanos) = u64::try_from((self.now_ns)().saturating_sub(stamp_ns)) {
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
    /// Measures by new parameters from the next frame on. A scan that cannot go on under them ends first.
    pub(super) fn apply_settings(&mut self, out: &mut Publisher<'_>) -> Result<(), Halt> {
        let Some(settings) = self.live.as_ref().and_then(|live| live.settings.take()) else {
            return Ok(());
        };
        if self.pipeline.must_end_for(&settings.params) {
            self.end_scan(out)?;
        }
        self.pipeline.reconfigure(settings.params);
        self.results.reconfigure(&settings.params, &settings.parameters_sha256);
        self.options.max_frame_bytes = settings.max_frame_bytes;
        self.options.sends_images = settings.sends_images;
        Ok(())
    }

    pub(super) fn obey(&mut self, command: Command, out: &mut Publisher<'_>) -> Result<(), Halt> {
        let scan_id = self.pipeline.scan_id();
        match command {
            Command::StartScan(request, reply) => {
                self.end_scan(out)?;
                self.pipeline.set_scanning(true);
                self.set_scan(request, Some(reply));
            }
            Command::StopScan(reply) => {
                self.stop_scan(out)?;
                answer(&reply, scan_id.map_or("no scan was open", |_| "scan ended"), scan_id);
            }
            Command::Reset(reply) => {
                self.pipeline.discard();
                self.pipeline.set_scanning(true);
                self.set_scan(ScanRequest::default(), None);
                answer(&reply, scan_id.map_or("no scan was open", |_| "scan discarded"), scan_id);
            }
        }
        Ok(())
    }

    fn stop_scan(&mut self, out: &mut Publisher<'_>) -> Result<(), Halt> {
        self.end_scan(out)?;
        self.pipeline.set_scanning(false);
        self.set_scan(ScanRequest::default(), None);
        Ok(())
    }

    fn set_scan(&mut self, request: ScanRequest, starting: Option<Reply>) {
        self.results.set_part_id(request.part_id);
        if let Some(live) = &mut self.live {
            live.length_m = request.length_m;
            live.starting = starting;
        }
    }

    /// Answers whoever started the scan, and ends one that has its length.
    pub(super) fn after_frame(&mut self, out: &mut Publisher<'_>) -> Result<(), Halt> {
        let Some(live) = &mut self.live else { return Ok(()) };
        let Some(scan_id) = self.pipeline.scan_id() else { return Ok(()) };
        if let Some(reply) = live.starting.take() {
            answer(&reply, "scan begun", Some(scan_id));
        }
        if live.length_m > 0.0 && self.last_position_m.abs() >= live.length_m {
            tracing::info!("the scan has its length of {} m: it ends", live.length_m);
            return self.stop_scan(out);
        }
        Ok(())
    }

    /// Lets time pass: a camera that sends nothing is reported too.
    pub(super) fn tick(&mut self, queue_depth: usize, out: &mut Publisher<'_>) -> Result<(), Halt> {
        let Some(live) = &mut self.live else { return Ok(()) };
        live.queue_depth = live.queue_depth.max(queue_depth as u32);
        if Instant::now() < live.next_tick {
            return Ok(());
        }
        live.next_tick = Instant::now() + TICK;
        // The clock by which images are received: that of a simulation may stand still.
        let now_ns = system_ns();
        match self.schedule.poll(now_ns, &self.counts) {
            Some(interval) => self.report(now_ns, interval, out),
            None => Ok(()),
        }
    }
}

fn answer(reply: &Reply, message: &str, scan_id: Option<[u8; 16]>) {
    // Whoever asked may have given up waiting.
    drop(reply.try_send(Answer { success: true, message: message.to_owned(), scan_id }));
}
