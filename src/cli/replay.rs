//! `laser_profiler replay`: recordings through the node, offline and deterministic.

use std::{io::Write, path::PathBuf};

use anyhow::Context;

use super::{
    Outcome, interrupt, output,
    picture_args::PictureArgs,
    replaying::replay,
    summary::{self, SummaryJson},
    view::{self, ReplayViewArgs},
};
use crate::{
    node::{replay::ReplayRequest, stop::Stop},
    ros::arguments::RosArguments,
};

pub(super) const HELP: &str = "\
Examples:
  laser_profiler replay my_recording -o results
      uses the recording's only image topic, raw or compressed, and the default parameters
  laser_profiler replay day1 day2.mcap -o results --params-file rig.yaml --force
      one after another, into one results bag
  laser_profiler replay my_recording -o results --ros-args -r image_raw:=/left/image_raw -p stripe_direction:=vertical
      the named topic; a vertical stripe
  laser_profiler replay both -o results --ros-args -p 'cameras:=[left, right]'
      every camera that was recorded, side by side, into results/left and results/right
  laser_profiler replay my_recording -o results --json | jq .frames
  laser_profiler replay pictures -o results --frame-rate 50 --params-file rig.yaml
  laser_profiler replay 'scan/*.png' -o results --positions positions.csv --params-file rig.yaml
      pictures in natural order (img2 before img10); docs/pictures.md has the whole way from pictures to a height map
  laser_profiler replay my_recording --view --params-file rig.yaml
      writes nothing: play, seek and change parameters in Foxglove; the paused frame is measured again at once

The results are a rosbag2 directory with ~/centerline and ~/annotations for every frame and, with a calibration_file,
~/profile, ~/points, ~/points_dense, ~/slice_info and ~/height_map. The same recording and parameters give the same bytes.

--json prints one object:
  frames: {received, processed, rejected, dropped, lost}; received = processed + rejected + dropped,
  points (of all centrelines), points_saturated (of them, with a sample at full scale), outside_calibrated_volume,
  without_stripe: {frames, examined, reasons: [{reason, frames, text}]} (some of the frames are examined for the likely reason),
  sigma_px: {noise, texture} (medians over the frames; null without points), slices,
  channel_auto (frames by the channel that `channel: auto` chose; missing for grey images), standing (profiles that lie where the one before lies; missing if there are none),
  positions: {known, doubtful (of these), unknown, refused} (frames by their position, and samples that were rejected; missing without positions),
  seconds, frames_per_second,
  stages_ms: {decode, extract, triangulate, encode: each {p50, p99}}, output";

/// Replays recordings through the node, as fast as possible, into a bag of results.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct ReplayArgs {
    /// rosbag2 directories, .mcap or .mcap.zstd files, folders of pictures, pictures (PNG, JPEG, TIFF, BMP, PGM), quoted
    /// patterns or videos, replayed one after another. Single pictures are one series, in natural order.
    #[arg(required = true, value_name = "BAG|PICTURES")]
    pub(crate) bags: Vec<PathBuf>,
    #[command(flatten)]
    pictures: PictureArgs,
    /// Directory of the results bag; with several cameras, the directory of their bags.
    #[arg(short, long, value_name = "OUT", required_unless_present = "view")]
    pub(crate) output: Option<PathBuf>,
    /// ROS 2 parameter file; several are applied in order, before those of --ros-args.
    #[arg(long, value_name = "FILE")]
    pub(crate) params_file: Vec<PathBuf>,
    /// Replay only this one of the parameter `cameras`. Default: every camera whose images are recorded.
    #[arg(long, value_name = "NAME")]
    pub(crate) camera: Option<String>,
    /// Playback speed as a multiple of the recording's. Default: as fast as possible.
    #[arg(long, value_name = "R", allow_negative_numbers = true)]
    pub(crate) rate: Option<f64>,
    /// Print a machine-readable summary on standard output.
    #[arg(long)]
    pub(crate) json: bool,
    /// Replace an existing results bag.
    #[arg(long)]
    pub(crate) force: bool,
    /// Store the input images beside the results.
    #[arg(long)]
    pub(crate) with_images: bool,
    /// Options of the live view.
    #[command(flatten)]
    pub(crate) view: ReplayViewArgs,
}

/// Replays and prints the summary on `out`.
///
/// # Errors
/// [`Usage`](super::Usage) for wrong usage; otherwise a file that cannot be read or written.
pub(crate) fn run(
    args: ReplayArgs,
    ros: RosArguments,
    out: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let stop = Stop::default();
    interrupt::raise_on_signal(stop.clone()).context("cannot wait for signals")?;
    let view = args.view.clone();
    let form = if args.json { Form::Json } else { Form::Text };
    let has_output = args.output.is_some();
    let request = request(args, ros);
    let mut write =
        || if has_output { write(&request, form, &stop, out) } else { Ok(Outcome::Done) };
    if view.view.view.is_none() {
        return write();
    }
    view::replay(&view, request.clone(), &stop, &mut write)
}

/// Format of the summary.
#[derive(Clone, Copy)]
enum Form {
    Text,
    Json,
}

/// Writes the results and prints the summary.
fn write(
    request: &ReplayRequest,
    form: Form,
    stop: &Stop,
    out: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let output = request.output.to_string_lossy();
    let summary = replay(request.clone(), stop)?;
    let text = match form {
        Form::Json => {
            format!("{}\n", serde_json::to_string(&SummaryJson::of(&summary, Some(&output)))?)
        }
        Form::Text => format!("{}results: {output}\n", summary::text(&summary)),
    };
    output::print(out, &text)?;
    Ok(if summary.is_complete() { Outcome::Done } else { Outcome::DataLost })
}

fn request(args: ReplayArgs, mut ros: RosArguments) -> ReplayRequest {
    ros.parameter_files.splice(0..0, args.params_file);
    ReplayRequest {
        bags: args.bags,
        pictures: args.pictures.options(),
        output: args.output.unwrap_or_default(),
        rate: args.rate,
        force: args.force,
        with_images: args.with_images,
        camera: args.camera,
        ros,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(bag: &str, output: &str) -> ReplayArgs {
        ReplayArgs {
            bags: vec![bag.into()],
            pictures: PictureArgs::default(),
            output: Some(output.into()),
            params_file: vec!["own.yaml".into()],
            camera: None,
            rate: None,
            json: false,
            force: true,
            with_images: false,
            view: ReplayViewArgs::default(),
        }
    }

    #[test]
    fn own_parameter_files_come_before_those_of_ros_args() {
        let ros =
            RosArguments { parameter_files: vec!["ros.yaml".into()], ..RosArguments::default() };
        let request = request(args("bag", "out"), ros);
        assert_eq!(request.ros.parameter_files, [PathBuf::from("own.yaml"), "ros.yaml".into()]);
        assert!(request.force && !request.with_images);
    }
}
