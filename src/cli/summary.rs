//! The summary of `replay` and `run`.

use std::{collections::BTreeMap, fmt::Write as _};

use serde::Serialize;

use crate::{
    node::{
        histogram::Histogram,
        statistics::{Counts, NoStripes, Summary},
    },
    scanner::diagnosis::Diagnosis,
};

/// Line of a summary if a signal ended the command before its input did.
pub(super) const INTERRUPTED: &str = "interrupted: the rest of the input was not read";

fn frames_per_second(summary: &Summary) -> f64 {
    let seconds = summary.elapsed.as_secs_f64();
    if seconds > 0.0 { summary.counts.processed as f64 / seconds } else { 0.0 }
}

/// The summary of `--json`, with its keys in their published order.
#[derive(Serialize)]
pub(super) struct SummaryJson<'a> {
    frames: Frames,
    points: u64,
    points_saturated: u64,
    outside_calibrated_volume: u64,
    without_stripe: WithoutStripe,
    sigma_px: Sigma,
    slices: u64,
    /// Frames by the channel that `channel: auto` stands for; `None` if it was not chosen.
    #[serde(skip_serializing_if = "Option::is_none")]
    channel_auto: Option<BTreeMap<&'static str, u64>>,
    /// Profiles that lie where the one before lies; `None` if there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    standing: Option<u64>,
    /// `None` if positions are not measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    positions: Option<Positions>,
    seconds: f64,
    frames_per_second: f64,
    stages_ms: Stages,
    /// Path of the results bag; `None` if nothing was recorded.
    output: Option<&'a str>,
    /// Entries that only a live node has; `None` if there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    live: Option<Live<'a>>,
}

/// Losses and oddities of a live node.
#[derive(Debug, Default, PartialEq, Eq, Serialize)]
struct Live<'a> {
    /// Messages that should be in a recording and are not.
    not_recorded: u64,
    /// Results that were not published.
    not_published: u64,
    recordings_failed: u64,
    /// Reason of the first failed recording.
    first_failure: Option<&'a str>,
    /// Frames without a latency.
    stamps_not_of_now: u64,
    /// Times that the stamps began again.
    begun_again: u64,
}

impl<'a> Live<'a> {
    fn of(Summary { counts, recordings_failed, .. }: &'a Summary) -> Self {
        Self {
            not_recorded: counts.recorder_dropped,
            not_published: counts.unpublished,
            recordings_failed: recordings_failed.num,
            first_failure: recordings_failed.first.as_deref(),
            stamps_not_of_now: counts.not_of_now,
            begun_again: counts.begun_again,
        }
    }
}

/// Frames without a stripe.
#[derive(Serialize)]
struct WithoutStripe {
    frames: u64,
    /// Number of those that were examined for the reason.
    examined: u64,
    reasons: Vec<LikelyReason>,
}

#[derive(Serialize)]
struct LikelyReason {
    reason: &'static str,
    frames: u64,
    text: String,
}

/// Medians over the frames, pixels; `None` without points.
#[derive(Serialize)]
struct Sigma {
    noise: Option<f64>,
    texture: Option<f64>,
}

impl WithoutStripe {
    fn of(counted: &NoStripes) -> Self {
        let reason = |(diagnosis, frames): (Diagnosis, u64)| LikelyReason {
            reason: diagnosis.reason.name(),
            frames,
            text: diagnosis.to_string(),
        };
        Self {
            frames: counted.frames,
            examined: counted.num_examined(),
            reasons: counted.reasons().into_iter().map(reason).collect(),
        }
    }
}

#[derive(Serialize)]
struct Frames {
    received: u64,
    processed: u64,
    rejected: u64,
    dropped: u64,
    lost: u64,
}

/// Frames by the state of their position.
#[derive(Serialize)]
struct Positions {
    known: u64,
    doubtful: u64,
    unknown: u64,
    refused: u64,
}

#[derive(Serialize)]
struct Stages {
    decode: Percentiles,
    extract: Percentiles,
    triangulate: Percentiles,
    encode: Percentiles,
}

/// Percentiles of the duration of a stage, milliseconds.
#[derive(Serialize)]
struct Percentiles {
    p50: f64,
    p99: f64,
}

impl<'a> SummaryJson<'a> {
    pub(super) fn of(summary: &'a Summary, output: Option<&'a str>) -> Self {
        let Summary { counts, stages, .. } = summary;
        let of = |times: &Histogram| Percentiles {
            p50: times.percentile_ms(0.50),
            p99: times.percentile_ms(0.99),
        };
        Self {
            frames: Frames {
                received: counts.received,
                processed: counts.processed,
                rejected: counts.rejected(),
                dropped: counts.dropped_overload,
                lost: counts.lost(),
            },
            points: counts.points,
            points_saturated: counts.saturated,
            outside_calibrated_volume: counts.outside_calibration,
            without_stripe: WithoutStripe::of(&counts.no_stripe),
            sigma_px: Sigma {
                noise: counts.noise_px.median(),
                texture: counts.texture_px.median(),
            },
            slices: counts.slices,
            channel_auto: Some(counts.chosen.named().collect())
                .filter(|map: &BTreeMap<_, _>| !map.is_empty()),
            standing: (counts.standing > 0).then_some(counts.standing),
            positions: positions(counts),
            seconds: summary.elapsed.as_secs_f64(),
            frames_per_second: frames_per_second(summary),
            stages_ms: Stages {
                decode: of(&stages.decode),
                extract: of(&stages.extract),
                triangulate: of(&stages.triangulate),
                encode: of(&stages.encode),
            },
            output,
            live: Some(Live::of(summary)).filter(|live| *live != Live::default()),
        }
    }
}

fn positions(counts: &Counts) -> Option<Positions> {
    let &Counts { located, unlocated, doubtful, positions_refused, .. } = counts;
    (located + unlocated > 0).then_some(Positions {
        known: located,
        doubtful,
        unknown: unlocated,
        refused: positions_refused,
    })
}

/// Returns the summary as text.
pub(super) fn text(summary: &Summary) -> String {
    let counts = &summary.counts;
    let mut out = String::new();
    // Writing to a string cannot fail.
    _ = writeln!(
        out,
        "{} frames: {} processed, {} rejected ({} malformed, {} duplicate, {} out of order), {} dropped; {} lost in transport",
        counts.received,
        counts.processed,
        counts.rejected(),
        counts.malformed,
        counts.duplicate,
        counts.out_of_order,
        counts.dropped_overload,
        counts.lost(),
    );
    if summary.num_damaged > 0 {
        _ = writeln!(out, "damaged places skipped in the input: {}", summary.num_damaged);
    }
    write_live(&mut out, &Live::of(summary));
    if counts.unpaired > 0 {
        _ = writeln!(out, "frames without their other exposure: {}", counts.unpaired);
    }
    if counts.flooded > 0 {
        _ = writeln!(out, "frames too bright for extraction.segment_threshold: {}", counts.flooded);
    }
    if counts.outside_calibration > 0 {
        _ = writeln!(out, "points outside the calibrated volume: {}", counts.outside_calibration);
    }
    if let Some(Positions { known, doubtful, unknown, refused }) = positions(counts) {
        _ = writeln!(
            out,
            "positions: known for {known} frames, {doubtful} of them in doubt; {unknown} frames without a position are not in the \
             scan; {refused} samples rejected"
        );
    }
    if counts.standing > 0 {
        _ = writeln!(
            out,
            "profiles that lie where the one before lies: {} of {}; a scan of such profiles is no surface (see motion.source)",
            counts.standing, counts.processed
        );
    }
    if summary.was_interrupted {
        _ = writeln!(out, "{INTERRUPTED}");
    }
    write_stripes(&mut out, counts);
    for (channel, frames) in counts.chosen.named() {
        _ = writeln!(out, "channel auto: {channel} in {frames} frames");
    }
    _ = writeln!(
        out,
        "{} points, {:.1} % of them saturated; {} slices",
        counts.points,
        100.0 * counts.saturated as f64 / counts.points.max(1) as f64,
        counts.slices
    );
    _ = writeln!(
        out,
        "{:.2} s, {:.1} frames/s; p50 (p99) in ms:",
        summary.elapsed.as_secs_f64(),
        frames_per_second(summary)
    );
    for (name, times) in summary.stages.named() {
        let (p50, p99) = (times.percentile_ms(0.50), times.percentile_ms(0.99));
        _ = writeln!(out, "  {name:<12}{p50:.3} ({p99:.3})");
    }
    out
}

/// Writes what a live node lost besides frames.
fn write_live(out: &mut String, live: &Live<'_>) {
    if let Some(reason) = live.first_failure {
        _ = writeln!(out, "recordings failed: {}; the first: {reason}", live.recordings_failed);
    }
    for (num, what) in [
        (live.not_recorded, "messages that should be recorded and are not"),
        (live.not_published, "results that were not published"),
        (live.stamps_not_of_now, "frames whose stamps are not of now, without a latency"),
        (live.begun_again, "times that the stamps began again, as in a recording in a loop"),
    ] {
        if num > 0 {
            _ = writeln!(out, "{what}: {num}");
        }
    }
}

/// Writes the frames without a stripe with their likely reasons, and the shares of the uncertainty.
fn write_stripes(out: &mut String, counts: &Counts) {
    let without = &counts.no_stripe;
    if without.frames > 0 {
        _ = writeln!(out, "frames without a stripe: {} of {}", without.frames, counts.processed);
    }
    for (diagnosis, frames) in without.reasons() {
        let examined = without.num_examined();
        _ = writeln!(out, "  likely reason in {frames} of {examined} examined: {diagnosis}");
    }
    if let (Some(noise), Some(texture)) = (counts.noise_px.median(), counts.texture_px.median()) {
        _ = writeln!(out, "sigma, median: {noise:.3} px from noise, {texture:.3} px from texture");
    }
    if 2 * counts.saturated > counts.points {
        let has_chosen = counts.chosen.named().next().is_some();
        // Without a choice, images are grey or the parameter names the channel.
        let remedy = if has_chosen { ", or set channel to a colour that clips less" } else { "" };
        _ = writeln!(out, "most points are saturated: shorten the exposure{remedy}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::statistics::{Failures, StageTimes};

    #[test]
    fn the_summary_has_the_published_keys_in_their_order_and_adds_up() {
        let counts = Counts {
            received: 10,
            processed: 4,
            dropped_overload: 3,
            malformed: 1,
            duplicate: 1,
            out_of_order: 1,
            lost_transport: 5,
            points: 60,
            saturated: 15,
            slices: 2,
            ..Counts::default()
        };
        let stages = StageTimes::default();
        let elapsed = std::time::Duration::from_secs(2);
        let summary = Summary { counts, stages, elapsed, ..Summary::default() };
        let json = serde_json::to_string(&SummaryJson::of(&summary, Some("out"))).unwrap();
        let zero = r#"{"p50":0.0,"p99":0.0}"#;
        let expected = format!(
            "{}{}",
            r#"{"frames":{"received":10,"processed":4,"rejected":3,"dropped":3,"lost":5},"points":60,"points_saturated":15,"outside_calibrated_volume":0,"without_stripe":{"frames":0,"examined":0,"reasons":[]},"sigma_px":{"noise":null,"texture":null},"slices":2,"#,
            format_args!(
                r#""seconds":2.0,"frames_per_second":2.0,"stages_ms":{{"decode":{zero},"extract":{zero},"triangulate":{zero},"encode":{zero}}},"output":"out"}}"#
            )
        );
        assert_eq!(json, expected);
    }

    #[test]
    fn a_failed_recording_is_named_with_what_is_missing() {
        let counts = Counts { recorder_dropped: 7, ..Counts::default() };
        let recordings_failed = Failures { num: 1, first: Some("the disk is full".into()) };
        let summary = Summary { counts, recordings_failed, ..Summary::default() };
        assert!(!summary.is_complete());
        let text = text(&summary);
        for line in ["recordings failed: 1; the first: the disk is full\n", "and are not: 7\n"] {
            assert!(text.contains(line), "{text}");
        }
        let json = serde_json::to_value(SummaryJson::of(&summary, None)).unwrap();
        assert_eq!(json["live"]["not_recorded"], 7);
        assert_eq!(json["live"]["first_failure"], "the disk is full");
        for key in keys(&json["live"]) {
            assert!(crate::cli::run::HELP.contains(&key), "{key}");
        }
    }

    /// Every key of an object, and of the objects in it.
    fn keys(value: &serde_json::Value) -> Vec<String> {
        match value {
            serde_json::Value::Object(entries) => entries
                .iter()
                .flat_map(|(key, value)| [vec![key.clone()], keys(value)].concat())
                .collect(),
            serde_json::Value::Array(values) => values.iter().flat_map(keys).collect(),
            _ => Vec::new(),
        }
    }

    #[test]
    fn the_help_of_replay_names_every_key() {
        let counts = Counts { located: 1, standing: 1, ..Counts::default() };
        let summary = Summary { counts, ..Summary::default() };
        let json = serde_json::to_value(SummaryJson::of(&summary, None)).unwrap();
        let (_, help) = crate::cli::replay::HELP.split_once("--json prints").unwrap();
        let words: Vec<_> =
            help.split(|letter: char| !letter.is_alphanumeric() && letter != '_').collect();
        let keys = keys(&json);
        assert!(keys.iter().any(|key| key == "positions"), "{keys:?}");
        for key in keys {
            assert!(words.contains(&key.as_str()), "{key}");
        }
    }
}
