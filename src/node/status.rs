//! Publishes the counters as `StreamStatus` and `/diagnostics`, once per second of stream time and on change.

use std::borrow::Cow;

use sha2::{Digest, Sha256};

use crate::{
    msg::{
        builtin_interfaces::Time,
        diagnostic_msgs::{DiagnosticArray, DiagnosticStatus, KeyValue},
        laser_profiler_msgs::StreamStatus,
        std_msgs::Header,
        unique_identifier_msgs::Uuid,
    },
    scanner::uuid::uuid_v8,
};

use super::statistics::{Classes, Counts};

const PERIOD_NS: i64 = 1_000_000_000;
/// Time after which further faults are reported. With the half second until a recording is flushed, less than a second
/// passes until a loss is counted on the disk, as long as until the frames around it are there.
const FAULT_PERIOD_NS: i64 = 250_000_000;

/// Identity of the reporting node and camera.
#[derive(Clone, Debug)]
pub(crate) struct Reporter {
    /// Fully qualified name of the node.
    pub(crate) node: String,
    /// The camera's name; empty for the only camera.
    pub(crate) camera: String,
    /// Input topic, fully resolved.
    pub(crate) topic: String,
    /// Capacity of the worker's queue, frames.
    pub(crate) queue_capacity: u32,
    /// Identity of the session.
    pub(crate) session_id: [u8; 16],
}

/// Returns a version 8 UUID of the input and the parameters, so that a repeated replay has the same identity.
pub(crate) fn session_id(topic: &str, parameters_sha256: &str) -> [u8; 16] {
    let digest = Sha256::new()
        .chain_update(topic)
        .chain_update([0])
        .chain_update(parameters_sha256)
        .finalize();
    uuid_v8(&digest.into())
}

/// Decides when a report is due, using only the times of the messages.
#[derive(Debug, Default)]
pub(crate) struct Schedule {
    /// Start of the interval; `None` until its first frame.
    since_ns: Option<i64>,
    /// The counters at its start.
    base: Counts,
    had_faults: bool,
}

/// Rate and state since the last report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Interval {
    /// Frames received per second; 0 before the first interval ends.
    pub(crate) rate_hz: f32,
    /// True if a frame was lost, dropped or rejected in the interval.
    pub(crate) has_faults: bool,
    /// True if at least half of the interval's profiles lie where the one before lies.
    pub(crate) stands: bool,
    /// True if at least half of the interval's frames have no stripe.
    pub(crate) lacks_stripe: bool,
}

impl Schedule {
    /// Returns a report if one is due at `now_ns`: a second after the last one, at once at a fault, or a quarter of a
    /// second after the last one if that reported faults, too. Time that steps back starts a new interval.
    pub(crate) fn poll(&mut self, now_ns: i64, counts: &Counts) -> Option<Interval> {
        let Some(since_ns) = self.since_ns else {
            self.since_ns = Some(now_ns);
            // The interval begins with this frame and counts the frames after it.
            self.base.received = counts.received;
            return None;
        };
        let age_ns = now_ns.checked_sub(since_ns);
        let is_over = |period_ns| age_ns.is_none_or(|age_ns| !(0..period_ns).contains(&age_ns));
        let has_new_fault = faults(counts) > faults(&self.base);
        let is_due = has_new_fault && (!self.had_faults || is_over(FAULT_PERIOD_NS));
        (is_over(PERIOD_NS) || is_due).then(|| self.close(now_ns, counts))
    }

    /// Ends the interval now.
    pub(crate) fn close(&mut self, now_ns: i64, counts: &Counts) -> Interval {
        let since_ns = self.since_ns.unwrap_or(now_ns);
        let seconds = now_ns.saturating_sub(since_ns) as f64 / 1e9;
        let received = (counts.received - self.base.received) as f64;
        let rate_hz = if seconds > 0.0 { (received / seconds) as f32 } else { 0.0 };
        let has_faults = faults(counts) > faults(&self.base);
        let standing = counts.standing - self.base.standing;
        let processed = counts.processed - self.base.processed;
        let stands = standing > 0 && 2 * standing >= processed;
        let without = counts.no_stripe.frames - self.base.no_stripe.frames;
        let lacks_stripe = without > 0 && 2 * without >= processed;
        self.since_ns = Some(now_ns);
        self.base = *counts;
        self.had_faults = has_faults;
        Interval { rate_hz, has_faults, stands, lacks_stripe }
    }

    /// Resets the schedule before another recording; the time in between belongs to no interval.
    pub(crate) fn restart(&mut self) {
        self.since_ns = None;
    }
}

const fn faults(counts: &Counts) -> u64 {
    counts.rejected()
        + counts.dropped_overload
        + counts.lost()
        + counts.recorder_dropped
        + counts.unpublished
        + counts.unlocated
}

/// Load of a camera on a network. A replay has no latency and no queue to report: NaN and 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Load {
    /// Median latency from stamp to result, seconds.
    pub(crate) latency_p50_s: f32,
    /// 99th percentile of the latency, seconds.
    pub(crate) latency_p99_s: f32,
    /// Maximum latency, seconds.
    pub(crate) latency_max_s: f32,
    /// Maximum number of frames in the queue.
    pub(crate) queue_depth: u32,
    /// Frames that have no latency, because their stamps are not of now.
    pub(crate) num_not_of_now: u32,
}

/// Text in place of a latency for stamps of a recording or of a clock that is not set.
pub(crate) const NOT_OF_NOW: &str = "stamps are not of now";

impl Load {
    /// Returns a latency of this load as text, or the reason that there is none.
    fn in_ms(&self, latency_s: f32) -> String {
        match (latency_s.is_finite(), self.num_not_of_now) {
            (true, _) => format!("{:.1}", 1e3 * latency_s),
            (false, 0) => "none".to_owned(),
            (false, _) => NOT_OF_NOW.to_owned(),
        }
    }
}

impl Default for Load {
    fn default() -> Self {
        Self {
            latency_p50_s: f32::NAN,
            latency_p99_s: f32::NAN,
            latency_max_s: f32::NAN,
            queue_depth: 0,
            num_not_of_now: 0,
        }
    }
}

/// A note about the stream from outside the worker, for diagnostics.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Note {
    /// Level, as in `DiagnosticStatus.level`.
    pub(crate) level: u8,
    /// Key in the diagnostics.
    pub(crate) key: &'static str,
    /// Text; also part of the message if the level is above OK.
    pub(crate) text: String,
}

/// Content of a report.
#[derive(Clone, Debug)]
pub(crate) struct State {
    /// The counters.
    pub(crate) counts: Counts,
    /// Changes since the last report.
    pub(crate) interval: Interval,
    /// Load of the camera.
    pub(crate) load: Load,
    /// Notes from outside the worker.
    pub(crate) notes: Vec<Note>,
    /// Reason for the last rejection since the last report.
    pub(crate) last_rejection: Option<String>,
    /// The channel that `channel: auto` stands for; `None` unless it was chosen.
    pub(crate) channel: Option<&'static str>,
}

impl Reporter {
    /// Sets a new session identity after a time discontinuity. Counters continue.
    pub(crate) fn begin_session(&mut self, now_ns: i64) {
        let before = format!("{:?}{now_ns}", self.session_id);
        self.session_id = session_id(&self.topic, &before);
    }

    /// Returns the counters as a message.
    pub(crate) fn stream_status(&self, now_ns: i64, state: &State) -> StreamStatus<'_> {
        let State { counts, interval, load, .. } = state;
        StreamStatus {
            header: header(now_ns),
            session_id: Uuid { uuid: self.session_id },
            topic: Cow::Borrowed(&self.topic),
            frames_received: counts.received,
            frames_processed: counts.processed,
            frames_published: counts.processed,
            lost_upstream: 0,
            lost_transport: counts.lost_transport,
            dropped_overload: counts.dropped_overload,
            rejected_malformed: counts.malformed,
            rejected_duplicate: counts.duplicate,
            rejected_out_of_order: counts.out_of_order,
            recorder_dropped: counts.recorder_dropped,
            recorder_bytes: counts.recorder_bytes,
            rate: interval.rate_hz,
            latency_p50: load.latency_p50_s,
            latency_p99: load.latency_p99_s,
            latency_max: load.latency_max_s,
            queue_depth: load.queue_depth,
            queue_capacity: self.queue_capacity,
        }
    }

    /// Returns a name that distinguishes the camera from other cameras and nodes.
    fn status_name(&self) -> String {
        let node = self.node.trim_start_matches('/');
        match self.camera.as_str() {
            "" => format!("{node}: stream"),
            camera => format!("{node}: {camera} stream"),
        }
    }

    /// Returns the state as text, for people and aggregators.
    pub(crate) fn diagnostics(&self, now_ns: i64, state: &State) -> DiagnosticArray<'_> {
        let (level, message) = state.summary();
        let (counts, load) = (&state.counts, &state.load);
        let values = [
            ("input topic", self.topic.clone()),
            ("rate [Hz]", format!("{:.3}", state.interval.rate_hz)),
            ("latency, median [ms]", load.in_ms(load.latency_p50_s)),
            ("latency, 99th percentile [ms]", load.in_ms(load.latency_p99_s)),
            ("frames with stamps that are not of now", counts.not_of_now.to_string()),
            ("stamps begun again", counts.begun_again.to_string()),
            ("frames received", counts.received.to_string()),
            ("frames processed", counts.processed.to_string()),
            ("frames lost in transport", counts.lost_transport.to_string()),
            ("frames dropped by overload", counts.dropped_overload.to_string()),
            ("frames rejected as malformed", counts.malformed.to_string()),
            ("frames rejected as duplicate", counts.duplicate.to_string()),
            ("frames rejected as out of order", counts.out_of_order.to_string()),
            ("results not published", counts.unpublished.to_string()),
            ("results not recorded", counts.recorder_dropped.to_string()),
            ("slices", counts.slices.to_string()),
            ("frames without their other exposure", counts.unpaired.to_string()),
            ("frames too bright for the threshold", counts.flooded.to_string()),
            ("frames without a stripe", counts.no_stripe.frames.to_string()),
            ("points", counts.points.to_string()),
            ("points saturated", counts.saturated.to_string()),
            ("median sigma from noise [px]", in_px(&counts.noise_px)),
            ("median sigma from texture [px]", in_px(&counts.texture_px)),
            ("points outside the calibrated volume", counts.outside_calibration.to_string()),
            ("frames without a position", counts.unlocated.to_string()),
            ("frames with a doubtful position", counts.doubtful.to_string()),
            ("positions refused", counts.positions_refused.to_string()),
            ("profiles at the place of the one before", counts.standing.to_string()),
        ];
        let value = |(key, value)| KeyValue { key: Cow::Borrowed(key), value: Cow::Owned(value) };
        let chosen = state.channel.iter().map(|text| ("channel auto", (*text).to_owned()));
        let rejection = state.last_rejection.iter().map(|text| ("last rejection", text.clone()));
        let notes = state.notes.iter().map(|note| (note.key, note.text.clone()));
        let status = DiagnosticStatus {
            level,
            name: Cow::Owned(self.status_name()),
            message: Cow::Owned(message),
            hardware_id: Cow::Borrowed(""),
            values: values
                .into_iter()
                .chain(chosen)
                .chain(rejection)
                .chain(notes)
                .map(value)
                .collect(),
        };
        DiagnosticArray { header: header(now_ns), status: vec![status] }
    }
}

impl State {
    /// Returns the worst level and a description of the faults.
    fn summary(&self) -> (u8, String) {
        let faults = (DiagnosticStatus::WARN, "frames were lost, dropped or rejected".to_owned());
        let faults = self.interval.has_faults.then_some(faults);
        let bad = self.notes.iter().filter(|note| note.level > DiagnosticStatus::OK);
        let (levels, texts): (Vec<_>, Vec<_>) =
            faults.into_iter().chain(bad.map(|note| (note.level, note.text.clone()))).unzip();
        match levels.into_iter().max() {
            Some(level) => (level, texts.join("; ")),
            None => (DiagnosticStatus::OK, "every frame measured".to_owned()),
        }
    }
}

/// Returns a median over the frames as text.
fn in_px(figures: &Classes) -> String {
    figures.median().map_or_else(|| "none".to_owned(), |median| format!("{median:.4}"))
}

fn header(now_ns: i64) -> Header<'static> {
    Header { stamp: Time::from_ns(now_ns), frame_id: Cow::Borrowed("") }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn counts(received: u64, malformed: u64) -> Counts {
        Counts { received, malformed, processed: received - malformed, ..Counts::default() }
    }

    #[test]
    fn reports_are_due_every_second_and_at_the_first_fault() {
        let mut schedule = Schedule::default();
        assert_eq!(schedule.poll(0, &counts(1, 0)), None);
        assert_eq!(schedule.poll(999 * MS, &counts(10, 0)), None);
        let report = schedule.poll(1000 * MS, &counts(11, 0)).unwrap();
        assert!((report.rate_hz - 10.0).abs() < 1e-6 && !report.has_faults);
        let report = schedule.poll(1500 * MS, &counts(15, 1)).unwrap();
        assert!(report.has_faults, "at once");
        assert_eq!(schedule.poll(1600 * MS, &counts(16, 2)), None, "already reported");
        assert!(schedule.poll(1750 * MS, &counts(17, 2)).unwrap().has_faults, "the next one");
        assert_eq!(schedule.poll(2490 * MS, &counts(24, 2)), None, "nothing new");
        assert!(schedule.poll(2500 * MS, &counts(25, 3)).unwrap().has_faults, "in this second too");
        assert!(!schedule.poll(3500 * MS, &counts(35, 3)).unwrap().has_faults, "over");
        assert!(schedule.poll(0, &counts(36, 3)).is_some(), "time stepped back");
        schedule.restart();
        assert_eq!(schedule.poll(9000 * MS, &counts(37, 4)), None, "a new interval");
        let report = schedule.poll(10_000 * MS, &counts(42, 4)).unwrap();
        assert!((report.rate_hz - 5.0).abs() < 1e-6 && report.has_faults, "{report:?}");
    }

    #[test]
    fn a_latency_that_is_none_is_not_shown_as_one() {
        let shown = |latency_p50_s, num_not_of_now| {
            let load = Load { latency_p50_s, num_not_of_now, ..Load::default() };
            load.in_ms(load.latency_p50_s)
        };
        assert_eq!(shown(0.0123, 0), "12.3");
        assert_eq!(shown(0.0123, 5), "12.3", "of the other frames");
        assert_eq!(shown(f32::NAN, 5), "stamps are not of now");
        assert_eq!(shown(f32::NAN, 0), "none");
    }

    #[test]
    fn a_session_is_identified_by_its_input_and_parameters() {
        let id = session_id("/image_raw", "abc");
        assert_eq!((id[6] >> 4, id[8] >> 6), (8, 2), "version 8, RFC 9562 variant");
        assert_eq!(id, session_id("/image_raw", "abc"));
        assert_ne!(id, session_id("/image_raw", "abd"));
        assert_ne!(id, session_id("/image", "_rawabc"));
    }
}
