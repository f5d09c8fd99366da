//! Status of a live node: one updated line per camera on a terminal, periodic log lines elsewhere.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    io::{self, IsTerminal},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use indicatif::{BinaryBytes, ProgressBar, ProgressStyle};

use super::terminal;
use crate::node::{
    live::report::{CameraReport, Watcher},
    statistics::Counts,
    status::NOT_OF_NOW,
    stop::Stop,
};

/// Period of log lines without a terminal.
const LOG_PERIOD: Duration = Duration::from_secs(10);

/// Period of reading the cameras' reports.
const LOOK_PERIOD: Duration = Duration::from_millis(500);

/// Shows the status of the cameras until it is dropped.
pub(super) struct StatusShow {
    end: Stop,
    thread: Option<JoinHandle<()>>,
}

impl StatusShow {
    /// Starts a thread that reads the cameras' reports.
    ///
    /// # Errors
    /// The system cannot create a thread.
    pub(super) fn start(watcher: Watcher) -> io::Result<Self> {
        let end = Stop::default();
        let ended = end.clone();
        let show = move || {
            let mut lines = StatusLines::new();
            while !ended.wait(LOOK_PERIOD) {
                lines.show(&watcher.reports(), Instant::now());
            }
        };
        let thread = thread::Builder::new().name("status".to_owned()).spawn(show)?;
        Ok(Self { end, thread: Some(thread) })
    }
}

impl Drop for StatusShow {
    fn drop(&mut self) {
        self.end.raise();
        if let Some(thread) = self.thread.take() {
            // The thread clears its lines when it ends; a panic has been reported.
            drop(thread.join());
        }
    }
}

/// The lines of all cameras.
struct StatusLines {
    is_terminal: bool,
    lines: BTreeMap<String, Line>,
}

/// The line of a camera.
struct Line {
    bar: ProgressBar,
    /// Time of the last report, and bytes that the recorder had written then.
    before: (Instant, u64),
    /// Time of the last log line.
    logged: Instant,
    /// Recording rate, bytes per second.
    recorder_rate: f64,
}

impl StatusLines {
    /// Starts without lines; the first reports add them.
    fn new() -> Self {
        Self { is_terminal: io::stderr().is_terminal(), lines: BTreeMap::new() }
    }

    /// Shows the reports of the cameras.
    fn show(&mut self, reports: &[CameraReport], now: Instant) {
        for report in reports {
            let bytes = report.reported.counts.recorder_bytes;
            let line = self.lines.entry(report.camera.clone()).or_insert_with(|| Line {
                bar: bar(),
                before: (now, bytes),
                logged: now,
                recorder_rate: 0.0,
            });
            line.note_bytes(bytes, now);
            let is_due = now.duration_since(line.logged) >= LOG_PERIOD;
            if self.is_terminal {
                line.bar.set_message(text(report, line.recorder_rate));
            } else if is_due {
                line.logged = now;
                tracing::info!("{}", text(report, line.recorder_rate));
            }
        }
    }
}

impl Drop for StatusLines {
    fn drop(&mut self) {
        self.lines.values().for_each(|line| line.bar.finish_and_clear());
    }
}

impl Line {
    /// Updates the rate over at least a second, because the recorder's count changes every half second.
    fn note_bytes(&mut self, bytes: u64, now: Instant) {
        let (since, base) = self.before;
        let seconds = now.duration_since(since).as_secs_f64();
        if seconds >= 1.0 {
            self.recorder_rate = bytes.saturating_sub(base) as f64 / seconds;
            self.before = (now, bytes);
        }
    }
}

fn bar() -> ProgressBar {
    let bar = ProgressBar::new_spinner();
    terminal::show(match ProgressStyle::with_template("{wide_msg}") {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    })
}

/// Formats a camera's line: name, rate, latency, losses by cause, recorder.
fn text(report: &CameraReport, recorder_rate: f64) -> String {
    let mut out = String::new();
    if !report.camera.is_empty() {
        _ = write!(out, "{}: ", report.camera);
    }
    _ = write!(out, "{:.1} frames/s", report.reported.rate_hz);
    let load = &report.reported.load;
    if load.latency_p50_s.is_finite() {
        let [p50, p99] = [load.latency_p50_s, load.latency_p99_s].map(|seconds| 1e3 * seconds);
        _ = write!(out, ", latency p50 {p50:.1} p99 {p99:.1} ms");
    } else if load.num_not_of_now > 0 {
        _ = write!(out, ", {NOT_OF_NOW}");
    }
    _ = write!(
        out,
        ", {} measured, {}",
        report.reported.counts.processed,
        losses(&report.reported.counts)
    );
    let standing = report.reported.counts.standing;
    if standing > 0 {
        _ = write!(out, ", {standing} profiles without motion");
    }
    let without = &report.reported.counts.no_stripe;
    if without.frames > 0 {
        _ = write!(out, ", {} without a stripe", without.frames);
        if let Some((diagnosis, _)) = without.likely() {
            _ = write!(out, " (likely: {diagnosis})");
        }
    }
    if report.is_recording {
        _ = write!(out, ", recording {}/s", BinaryBytes(recorder_rate as u64));
        if let Some(free_bytes) = report.free_bytes {
            _ = write!(out, ", {} free", BinaryBytes(free_bytes));
        }
    }
    out
}

/// Returns every cause of loss with its count.
fn losses(counts: &Counts) -> String {
    let causes = [
        (counts.dropped_overload, "dropped: too slow"),
        (counts.lost_transport, "lost in transport"),
        (counts.malformed, "malformed"),
        (counts.duplicate, "duplicate"),
        (counts.out_of_order, "out of order"),
        (counts.unlocated, "without position"),
        (counts.unpublished, "results not sent"),
        (counts.recorder_dropped, "not recorded"),
    ];
    let losses: Vec<String> = causes
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, cause)| format!("{count} {cause}"))
        .collect();
    if losses.is_empty() { "none lost".to_owned() } else { losses.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::{board::Reported, status::Load};

    fn report() -> CameraReport {
        CameraReport {
            camera: "left".to_owned(),
            reported: Reported {
                counts: Counts { received: 25, processed: 20, ..Counts::default() },
                rate_hz: 21.96,
                load: Load::default(),
            },
            is_recording: false,
            free_bytes: None,
        }
    }

    #[test]
    fn a_line_shows_rate_latency_losses_and_recorder() {
        assert_eq!(text(&report(), 0.0), "left: 22.0 frames/s, 20 measured, none lost");
        let mut old = report();
        old.reported.load.num_not_of_now = 3;
        let line = "left: 22.0 frames/s, stamps are not of now, 20 measured, none lost";
        assert_eq!(text(&old, 0.0), line);
        let load = Load { latency_p50_s: 0.0091, latency_p99_s: 0.0138, ..Load::default() };
        let counts = Counts {
            processed: 20,
            dropped_overload: 3,
            malformed: 2,
            recorder_dropped: 1,
            ..Counts::default()
        };
        let busy = CameraReport {
            camera: String::new(),
            reported: Reported { counts, rate_hz: 21.96, load },
            is_recording: true,
            free_bytes: Some(3 << 30),
        };
        assert_eq!(
            text(&busy, 117_000_000.0),
            "22.0 frames/s, latency p50 9.1 p99 13.8 ms, 20 measured, 3 dropped: too slow, 2 malformed, \
             1 not recorded, recording 111.58 MiB/s, 3.00 GiB free"
        );
    }

    #[test]
    fn the_recording_rate_covers_at_least_a_second() {
        let start = Instant::now();
        let mut line = Line { bar: bar(), before: (start, 100), logged: start, recorder_rate: 0.0 };
        line.note_bytes(600, start + Duration::from_millis(500));
        assert!(line.recorder_rate.abs() < 1e-9, "too early");
        line.note_bytes(1100, start + Duration::from_secs(2));
        assert!((line.recorder_rate - 500.0).abs() < 1e-9, "{}", line.recorder_rate);
        line.note_bytes(50, start + Duration::from_secs(4));
        assert!(line.recorder_rate.abs() < 1e-9, "a new recording counts from 0");
    }
}
