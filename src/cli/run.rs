//! `laser_profiler run`: the live node.

use std::{fmt::Write as _, io::Write, path::PathBuf};

use anyhow::Context;
use serde::Serialize;

use super::{
    Outcome, Usage, interrupt,
    live_run::{classified, measure},
    output,
    summary::{self, SummaryJson},
    view::{self, ViewArgs},
    worker_command,
};
use crate::{
    node::{
        live::{LiveNode, LiveRequest, error::LiveError, session::CameraSummary},
        rosout::RosoutSlot,
        statistics::Summary,
        stop::Stop,
    },
    ros::{arguments::RosArguments, middleware::Middleware},
};

pub(super) const HELP: &str = "\
Examples:
  laser_profiler run --ros-args -r image_raw:=/camera/image_raw
      measures the camera's images and publishes ~/centerline; metric results need a calibration
  laser_profiler run --params-file rig.yaml
      with parameters and calibration: ~/profile, ~/points, ~/points_dense, ~/slice_info, ~/height_map
  laser_profiler run --transport zenoh --router --params-file rig.yaml
      on Zenoh, compatible with rmw_zenoh, acting as the router
  laser_profiler run --view --params-file rig.yaml
      with a live view for Foxglove at ws://127.0.0.1:8765
  ros2 param set /laser_profiler extraction.segment_threshold 45.0
  ros2 service call /laser_profiler/record std_srvs/srv/SetBool '{data: true}'

Without --transport, RMW_IMPLEMENTATION selects the middleware: zenoh if it is rmw_zenoh_cpp, otherwise dds. DDS uses ROS_DOMAIN_ID,
ROS_AUTOMATIC_DISCOVERY_RANGE, ROS_LOCALHOST_ONLY and ROS_STATIC_PEERS; Zenoh uses ROS_DOMAIN_ID,
ZENOH_SESSION_CONFIG_URI, ZENOH_CONFIG_OVERRIDE and ZENOH_ROUTER_CHECK_ATTEMPTS.

Ctrl-C or SIGTERM stops the node cleanly: it closes recordings and prints a summary of the frames.
A recording that fails does not stop the node; it ends with exit code 3 and names what is missing.
After a shutdown by a lifecycle manager, the node answers until it is stopped.
--json prints the summary as `replay --json` does; with several cameras as {\"cameras\": {NAME: ...}}. If one of them is not 0, it
adds live: {not_recorded (messages), not_published (results), recordings_failed, first_failure (its reason), stamps_not_of_now
(frames whose stamps are more than a minute from now: no latency), begun_again (times that the stamps began again)}.";

/// Measures cameras live, as a ROS 2 node on DDS or Zenoh.
#[derive(Debug, Default, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct RunArgs {
    /// Middleware: dds or zenoh.
    #[arg(long, value_name = "NAME", value_parser = transport)]
    pub(crate) transport: Option<Middleware>,
    /// Zenoh only: also act as the router, for a cell without one.
    #[arg(long)]
    pub(crate) router: bool,
    /// ROS 2 parameter file. Several are applied in order, before those of --ros-args.
    #[arg(long, value_name = "FILE")]
    pub(crate) params_file: Vec<PathBuf>,
    /// Print a machine-readable summary on standard output at the end.
    #[arg(long)]
    pub(crate) json: bool,
    /// Options of the live view.
    #[command(flatten)]
    pub(crate) view: ViewArgs,
}

fn transport(name: &str) -> Result<Middleware, String> {
    Middleware::from_name(name).ok_or_else(|| format!("one of {}", Middleware::NAMES.join(", ")))
}

/// Runs until a signal arrives and prints the summary on `out`.
///
/// # Errors
/// [`Usage`] for wrong usage; otherwise an error of the middleware, a file or the system.
pub(crate) fn run(
    args: RunArgs,
    ros: RosArguments,
    rosout: RosoutSlot,
    out: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let stop = Stop::default();
    interrupt::raise_on_signal(stop.clone()).context("cannot wait for signals")?;
    let (json, view) = (args.json, args.view.clone());
    let request = request(args, ros)?;
    let summaries = match view.view {
        Some(_) => view::live(&view, &request, rosout, &stop)?,
        None => live(&request, rosout, &stop).map_err(classified)?,
    };
    let summaries: Vec<(String, Summary)> = summaries
        .into_iter()
        .map(|CameraSummary { name, summary }| Ok((name, summary?)))
        .collect::<anyhow::Result<_>>()?;
    let text = if json { to_json(&summaries)? } else { text(&summaries) };
    output::print(out, &text)?;
    let is_complete = summaries.iter().all(|(_, summary)| summary.is_complete());
    Ok(if is_complete { Outcome::Done } else { Outcome::DataLost })
}

fn live(
    request: &LiveRequest,
    rosout: RosoutSlot,
    stop: &Stop,
) -> Result<Vec<CameraSummary>, LiveError> {
    measure(LiveNode::start(request, rosout)?, stop)
}

fn request(args: RunArgs, mut ros: RosArguments) -> anyhow::Result<LiveRequest> {
    ros.parameter_files.splice(0..0, args.params_file);
    let of_environment = || Middleware::of_environment(&|name| std::env::var(name).ok());
    let middleware = args.transport.unwrap_or_else(of_environment);
    if args.router && middleware != Middleware::Zenoh {
        return Err(Usage("--router requires --transport zenoh".to_owned()).into());
    }
    let worker = worker_command::of(&ros)?;
    Ok(LiveRequest { middleware, is_router: args.router, ros, worker })
}

fn text(summaries: &[(String, Summary)]) -> String {
    let mut out = String::new();
    for (name, summary) in summaries {
        if !name.is_empty() {
            // Writing to a string cannot fail.
            _ = writeln!(out, "camera {name}");
        }
        out.push_str(&summary::text(summary));
    }
    out
}

#[derive(Serialize)]
struct Cameras<'a> {
    cameras: std::collections::BTreeMap<&'a str, SummaryJson<'a>>,
}

fn to_json(summaries: &[(String, Summary)]) -> serde_json::Result<String> {
    let json = match summaries {
        [(name, summary)] if name.is_empty() => {
            serde_json::to_string(&SummaryJson::of(summary, None))?
        }
        several => {
            let cameras = several
                .iter()
                .map(|(name, summary)| (name.as_str(), SummaryJson::of(summary, None)));
            serde_json::to_string(&Cameras { cameras: cameras.collect() })?
        }
    };
    Ok(json + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::statistics::Counts;

    fn summary(processed: u64) -> Summary {
        let counts = Counts { received: processed, processed, ..Counts::default() };
        Summary { counts, ..Summary::default() }
    }

    fn keys(value: &serde_json::Value) -> Vec<&str> {
        value.as_object().unwrap().keys().map(String::as_str).collect()
    }

    #[test]
    fn one_camera_has_the_summary_of_a_replay() {
        let of_run = to_json(&[(String::new(), summary(3))]).unwrap();
        let of_replay = serde_json::to_string(&SummaryJson::of(&summary(3), None)).unwrap();
        assert_eq!(of_run, format!("{of_replay}\n"));
        assert!(text(&[(String::new(), summary(3))]).starts_with("3 frames: 3 processed"));
    }

    #[test]
    fn several_cameras_are_listed_by_name() {
        let summaries = [("left".to_owned(), summary(3)), ("right".to_owned(), summary(0))];
        let json: serde_json::Value = serde_json::from_str(&to_json(&summaries).unwrap()).unwrap();
        assert_eq!(keys(&json), ["cameras"]);
        assert_eq!(keys(&json["cameras"]), ["left", "right"]);
        assert_eq!(json["cameras"]["left"]["frames"]["processed"], 3);
        let text = text(&summaries);
        assert!(text.contains("camera left\n3 frames") && text.contains("camera right\n0 frames"));
    }

    #[test]
    fn a_router_is_for_zenoh_only() {
        let args = |transport| RunArgs {
            transport: Some(transport),
            router: true,
            params_file: vec!["own.yaml".into()],
            json: false,
            view: ViewArgs::default(),
        };
        let refused = request(args(Middleware::Dds), RosArguments::default()).unwrap_err();
        assert!(refused.is::<Usage>(), "{refused}");
        let ros =
            RosArguments { parameter_files: vec!["ros.yaml".into()], ..RosArguments::default() };
        let request = request(args(Middleware::Zenoh), ros).unwrap();
        assert!(request.is_router);
        assert_eq!(request.ros.parameter_files, [PathBuf::from("own.yaml"), "ros.yaml".into()]);
    }
}
