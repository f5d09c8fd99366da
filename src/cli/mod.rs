//! The command line: one file per verb. Verbs share files of this folder, never each other's.

mod interrupt;
mod terminal;
mod logging;
mod summary;
mod chart;
mod length;
mod output;
mod progress;
mod plots;
mod height_picture;
pub mod replaying;
mod live_run;
mod worker_command;
mod units;
mod status_line;
mod settings;
mod recording;
mod results_args;
mod picture_args;
mod view;
mod middleware;
pub(crate) mod run;
pub(crate) mod replay;
pub(crate) mod parameters;
pub(crate) mod info;
pub(crate) mod recover;
pub(crate) mod import;
pub(crate) mod simulate;
pub(crate) mod evaluate;
pub(crate) mod calibrate;
pub(crate) mod measure;
pub(crate) mod export;
pub(crate) mod report;
pub(crate) mod compare;
pub(crate) mod ambient;
pub(crate) mod suggest;
pub(crate) mod demo;

use std::{ffi::OsString, io};

use clap::{Parser, Subcommand};
use thiserror::Error;

use crate::{results::SelectionError, ros::arguments};

/// Outcome of a command that did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Finished. Exit code 0.
    Done,
    /// Finished, but data was lost or rejected. Exit code 3.
    DataLost,
}

impl Outcome {
    /// [`Done`](Self::Done) without losses.
    const fn with_losses(num_lost: u64) -> Self {
        if num_lost == 0 { Self::Done } else { Self::DataLost }
    }
}

/// Wrong usage. Exit code 2.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct Usage(pub String);

const EXAMPLES: &str = "\
Examples:
  laser_profiler run --ros-args -r image_raw:=/camera/image_raw      the live node on DDS or Zenoh
  laser_profiler demo                                replays a bundled recording and explains the result
  laser_profiler replay my_recording -o results
  laser_profiler replay my_recording -o results --ros-args -r image_raw:=/camera/image_raw -p stripe_direction:=vertical
  laser_profiler parameters > my_parameters.yaml     all parameters with descriptions, ready to edit:
  laser_profiler replay my_recording -o results --params-file my_parameters.yaml

`--ros-args ... [--]` works as with ros2 run: -r from:=to, -p name:=value, --params-file F, --log-level L.

Exit codes: 0 done, 1 failed, 2 wrong usage, 3 finished, but data was lost or rejected.";

/// Measures laser stripes: sub-pixel centrelines, metric profiles and height maps. A ROS 2 node without a ROS installation.
#[derive(Debug, Parser)]
#[command(name = "laser_profiler", version, after_help = EXAMPLES)]
struct CommandLine {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    Run(run::RunArgs),
    Replay(replay::ReplayArgs),
    Info(info::InfoArgs),
    Recover(recover::RecoverArgs),
    Import(import::ImportArgs),
    Simulate(simulate::SimulateArgs),
    Evaluate(evaluate::EvaluateArgs),
    Calibrate(calibrate::CalibrateArgs),
    Measure(measure::MeasureArgs),
    Export(export::ExportArgs),
    Report(report::ReportArgs),
    Compare(compare::CompareArgs),
    Suggest(suggest::SuggestArgs),
    Ambient(ambient::AmbientArgs),
    Demo(demo::DemoArgs),
    Parameters(parameters::ParametersArgs),
    #[command(hide = true)]
    Middleware(middleware::MiddlewareArgs),
}

impl Verb {
    const fn lines(&self) -> logging::Lines {
        let is_open = match self {
            Self::Run(_) => true,
            Self::Replay(args) => args.view.view.view.is_some(),
            _ => false,
        };
        if is_open { logging::Lines::Limited } else { logging::Lines::All }
    }
}

/// Runs the program. `arguments` begin with the program's name.
///
/// # Errors
/// [`Usage`] or [`clap::Error`] for wrong usage, any other error for a failure.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> anyhow::Result<Outcome> {
    let arguments: Vec<_> = arguments
        .into_iter()
        .map(OsString::into_string)
        .collect::<Result<_, _>>()
        .map_err(|text| Usage(format!("argument {} is not UTF-8", text.display())))?;
    let (ros, rest) = arguments::split(&arguments).map_err(|error| Usage(error.to_string()))?;
    let command_line = CommandLine::try_parse_from(with_verb(rest, &arguments))?;
    if let Verb::Middleware(args) = &command_line.verb {
        // Standard output belongs to its node, and logging has another destination.
        return middleware::run(args);
    }
    let levels = logging::Levels::new(&ros.log_levels, &ros.remaps)?;
    let rosout = logging::start(&levels, command_line.verb.lines());
    let out = &mut output::Printable::new(io::stdout().lock());
    let ended = match command_line.verb {
        Verb::Run(args) => run::run(args, ros, rosout, out),
        Verb::Replay(args) => replay::run(args, ros, out),
        Verb::Info(args) => info::run(&args, out),
        Verb::Recover(args) => recover::run(&args, out),
        Verb::Import(args) => import::run(args, out),
        Verb::Simulate(args) => simulate::run(&args, out),
        Verb::Evaluate(args) => evaluate::run(args, ros, out),
        Verb::Calibrate(args) => calibrate::run(args, ros, out),
        Verb::Measure(args) => measure::run(&args, out),
        Verb::Export(args) => export::run(&args, out),
        Verb::Report(args) => report::run(&args, out),
        Verb::Compare(args) => compare::run(&args, out),
        Verb::Suggest(args) => suggest::run(&args, out),
        Verb::Ambient(args) => ambient::run(&args, out),
        Verb::Demo(args) => demo::run(&args, out),
        Verb::Parameters(args) => parameters::run(&args, out),
        Verb::Middleware(args) => middleware::run(&args),
    };
    ended.map_err(|error| match error.downcast::<SelectionError>() {
        Ok(error) => Usage(error.0).into(),
        Err(error) => error,
    })
}

/// Adds the verb `run` if there are only ROS arguments, as from `ros2 run` and launch files.
fn with_verb(mut rest: Vec<String>, all: &[String]) -> Vec<String> {
    if rest.len() == 1 && all.len() > 1 {
        rest.push("run".to_owned());
    }
    rest
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    fn failure(line: &str) -> anyhow::Error {
        run(line.split_whitespace().map(OsString::from)).unwrap_err()
    }

    #[test]
    fn the_command_line_is_valid() {
        CommandLine::command().debug_assert();
    }

    #[test]
    fn ros_arguments_are_accepted_anywhere() {
        let error = failure(
            "laser_profiler --ros-args -p a:=1 -- replay --ros-args -r b:=c -- missing -o out",
        );
        assert!(error.to_string().contains("no parameter is called \"a\""), "{error}");
    }

    #[test]
    fn without_a_verb_ros_arguments_mean_the_live_node() {
        let verb = |line: &str| {
            let all: Vec<_> = line.split(' ').map(str::to_owned).collect();
            let (_, rest) = arguments::split(&all).unwrap();
            CommandLine::try_parse_from(with_verb(rest, &all)).map(|line| line.verb)
        };
        for line in ["laser_profiler --ros-args -r __ns:=/cell", "laser_profiler --ros-args"] {
            assert!(matches!(verb(line), Ok(Verb::Run(_))), "{line}");
        }
        assert!(verb("laser_profiler").is_err(), "help is shown");
        let info = verb("laser_profiler --ros-args -r a:=b -- info bag");
        assert!(matches!(info, Ok(Verb::Info(_))));
    }

    #[test]
    fn wrong_usage_is_distinguished_from_failures() {
        for line in [
            "laser_profiler --ros-args --bogus",
            "laser_profiler replay missing -o out --ros-args -p slice.profiles:=0",
            "laser_profiler replay missing -o out --ros-args -r __node:=a/b",
            "laser_profiler replay missing -o out --rate 0",
            "laser_profiler replay missing -o out --ros-args --log-level unknown:=debug",
        ] {
            assert!(failure(line).is::<Usage>(), "{line}");
        }
        assert!(failure("laser_profiler replay missing").is::<clap::Error>());
        assert!(!failure("laser_profiler replay missing -o out").is::<Usage>());
    }
}
