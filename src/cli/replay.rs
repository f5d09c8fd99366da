//! `laser_profiler replay`: recordings through the node, offline and deterministic.

use std::{
    fmt::Write as _,
    io::{self, IsTerminal, Write},
    path::PathBuf,
};

use anyhow::{Context, anyhow};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use super::{Outcome, Usage, interrupt};
use crate::{
    node::{
        histogram::Histogram,
        replay::{Replay, ReplayError, ReplayRequest},
        statistics::Summary,
        stop::Stop,
    },
    ros::{arguments::RosArguments, node_params::ImageTransport},
};

const HELP: &str = "\
Examples:
  laser_profiler replay my_recording -o results
      takes the recording's only image topic, raw or compressed, with the default parameters
  laser_profiler replay day1 day2.mcap -o results --params-file rig.yaml --force
      one after another, into one results bag
  laser_profiler replay my_recording -o results --ros-args -r image_raw:=/left/image_raw -p stripe_direction:=vertical
      the named topic; a vertical stripe
  laser_profiler replay my_recording -o results --json | jq .frames

The results are a rosbag2 directory with ~/centerline and ~/annotations for every frame and, with a calibration_file,
~/profile, ~/points, ~/points_dense, ~/slice_info and ~/height_map. The same recording and parameters give the same bytes.

--json prints one object:
  frames: {received, processed, rejected, dropped, lost}; received = processed + rejected + dropped,
  points (of all centrelines), slices, seconds, frames_per_second,
  stages_ms: {decode, extract, triangulate, encode: each {p50, p99}}, output";

/// Replays recordings through the node, as fast as possible, into a bag of results.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub struct ReplayArgs {
    /// rosbag2 directories or .mcap files, replayed one after another.
    #[arg(required = true, value_name = "BAG")]
    pub bags: Vec<PathBuf>,
    /// Directory of the results' bag.
    #[arg(short, long, value_name = "OUT")]
    pub output: PathBuf,
    /// ROS 2 parameter file; several are applied in order, before those of --ros-args.
    #[arg(long, value_name = "FILE")]
    pub params_file: Vec<PathBuf>,
    /// Camera whose images are replayed, where the parameter `cameras` names several; needed when the recording has the images
    /// of more than one.
    #[arg(long, value_name = "NAME")]
    pub camera: Option<String>,
    /// Times the speed of the recording, instead of as fast as possible.
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    pub rate: Option<f64>,
    /// Print a machine-readable summary on standard output.
    #[arg(long)]
    pub json: bool,
    /// Replace an existing results bag.
    #[arg(long)]
    pub force: bool,
    /// Store the input images beside the results.
    #[arg(long)]
    pub with_images: bool,
}

/// Replays and prints the summary on `out`.
///
/// # Errors
/// [`Usage`] when the request cannot be followed, else whatever cannot be read or written.
pub fn run(args: ReplayArgs, ros: RosArguments, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let stop = Stop::default();
    interrupt::raise_on_signal(stop.clone()).context("cannot wait for signals")?;
    let json = args.json;
    let output = args.output.clone();
    let summary = replay(request(args, ros), &stop)?;
    let text = if json {
        format!("{}\n", serde_json::to_string(&Told::of(&summary, &output.to_string_lossy()))?)
    } else {
        summary_text(&summary, &output.to_string_lossy())
    };
    super::quiet_pipe(out.write_all(text.as_bytes())).context("standard output")?;
    Ok(if summary.is_complete() { Outcome::Done } else { Outcome::DataLost })
}

/// Replays with a progress bar when standard error is a terminal.
///
/// # Errors
/// [`Usage`] when the request cannot be followed, else whatever cannot be read or written.
pub fn replay(request: ReplayRequest, stop: &Stop) -> anyhow::Result<Summary> {
    let told = |error: ReplayError| {
        if error.is_usage() { Usage(error.to_string()).into() } else { anyhow!(error) }
    };
    let replay = Replay::prepare(request).map_err(told)?;
    let topic = replay.image_topic().clone();
    let lossy = match topic.transport {
        ImageTransport::Raw => "",
        ImageTransport::Compressed => {
            " (compressed; JPEG would move centrelines by some hundredths of a pixel)"
        }
    };
    tracing::info!("taking images from {}{lossy}", topic.name);
    let bar = progress_bar(replay.num_messages());
    let summary = replay.run(stop, &mut |num_messages| bar.set_position(num_messages));
    bar.finish_and_clear();
    let summary = summary.map_err(told)?;
    if summary.counts.received == 0 && !summary.was_interrupted {
        return Err(anyhow!("no frame could be read from {}", topic.name));
    }
    Ok(summary)
}

fn request(args: ReplayArgs, mut ros: RosArguments) -> ReplayRequest {
    ros.parameter_files.splice(0..0, args.params_file);
    ReplayRequest {
        bags: args.bags,
        output: args.output,
        rate: args.rate,
        force: args.force,
        with_images: args.with_images,
        camera: args.camera,
        ros,
    }
}

fn progress_bar(num_messages: Option<u64>) -> ProgressBar {
    if !io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let template = "{bar:40} {pos}/{len} frames, {per_sec}, {eta} left";
    match (num_messages, ProgressStyle::with_template(template)) {
        (Some(len), Ok(style)) => ProgressBar::new(len).with_style(style),
        _ => ProgressBar::new_spinner(),
    }
}

fn frames_per_second(summary: &Summary) -> f64 {
    let seconds = summary.elapsed.as_secs_f64();
    if seconds > 0.0 { summary.counts.processed as f64 / seconds } else { 0.0 }
}

/// The summary of `--json`, with its keys in their published order.
#[derive(Serialize)]
struct Told<'a> {
    frames: Frames,
    points: u64,
    slices: u64,
    seconds: f64,
    frames_per_second: f64,
    stages_ms: Stages,
    output: &'a str,
}

#[derive(Serialize)]
struct Frames {
    received: u64,
    processed: u64,
    rejected: u64,
    dropped: u64,
    lost: u64,
}

#[derive(Serialize)]
struct Stages {
    decode: Percentiles,
    extract: Percentiles,
    triangulate: Percentiles,
    encode: Percentiles,
}

/// Milliseconds.
#[derive(Serialize)]
struct Percentiles {
    p50: f64,
    p99: f64,
}

impl<'a> Told<'a> {
    fn of(summary: &Summary, output: &'a str) -> Self {
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
            slices: counts.slices,
            seconds: summary.elapsed.as_secs_f64(),
            frames_per_second: frames_per_second(summary),
            stages_ms: Stages {
                decode: of(&stages.decode),
                extract: of(&stages.extract),
                triangulate: of(&stages.triangulate),
                encode: of(&stages.encode),
            },
            output,
        }
    }
}

fn summary_text(summary: &Summary, output: &str) -> String {
    let counts = &summary.counts;
    let mut out = String::new();
    // Writing to a string cannot fail.
    _ = writeln!(
        out,
        "{} frames: {} processed, {} rejected ({} malformed, {} duplicate, {} out of order), {} dropped; {} more never arrived",
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
        _ = writeln!(
            out,
            "damaged places in the input that were passed over: {}",
            summary.num_damaged
        );
    }
    if summary.was_interrupted {
        _ = writeln!(out, "interrupted: the rest of the input was not read");
    }
    _ = writeln!(out, "{} points, {} slices", counts.points, counts.slices);
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
    _ = writeln!(out, "results: {output}");
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bag::{RecordOptions, Recorder, Topic},
        msg::{qos::QosProfile, schema::Message, sensor_msgs::Image},
        node::statistics::{Counts, StageTimes},
    };

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
            slices: 2,
            ..Counts::default()
        };
        let stages = StageTimes::default();
        let elapsed = std::time::Duration::from_secs(2);
        let summary = Summary { counts, stages, elapsed, ..Summary::default() };
        let json = serde_json::to_string(&Told::of(&summary, "out")).unwrap();
        let zero = r#"{"p50":0.0,"p99":0.0}"#;
        let expected = format!(
            "{}{}",
            r#"{"frames":{"received":10,"processed":4,"rejected":3,"dropped":3,"lost":5},"points":60,"slices":2,"#,
            format_args!(
                r#""seconds":2.0,"frames_per_second":2.0,"stages_ms":{{"decode":{zero},"extract":{zero},"triangulate":{zero},"encode":{zero}}},"output":"out"}}"#
            )
        );
        assert_eq!(json, expected);
    }

    fn args(bag: &str, output: &str) -> ReplayArgs {
        ReplayArgs {
            bags: vec![bag.into()],
            output: output.into(),
            params_file: vec!["own.yaml".into()],
            camera: None,
            rate: None,
            json: false,
            force: true,
            with_images: false,
        }
    }

    #[test]
    fn the_own_parameter_files_come_before_those_of_ros() {
        let ros =
            RosArguments { parameter_files: vec!["ros.yaml".into()], ..RosArguments::default() };
        let request = request(args("bag", "out"), ros);
        assert_eq!(request.ros.parameter_files, [PathBuf::from("own.yaml"), "ros.yaml".into()]);
        assert!(request.force && !request.with_images);
    }

    #[test]
    fn a_recording_without_frames_is_a_failure() {
        let place = tempfile::tempdir().unwrap();
        let bag = place.path().join("empty");
        let mut recorder = Recorder::create(&bag, &RecordOptions::default()).unwrap();
        let topic = Topic::new("/image_raw", Image::TYPE, QosProfile::reliable(10));
        recorder.add_topic(&topic).unwrap();
        recorder.finish().unwrap();
        let output = place.path().join("out");
        let request = ReplayRequest { bags: vec![bag], output, ..ReplayRequest::default() };
        let error = replay(request, &Stop::default()).unwrap_err();
        assert_eq!(error.to_string(), "no frame could be read from /image_raw");
    }
}
