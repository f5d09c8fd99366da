//! `laser_profiler calibrate`: from recordings to the file that makes pixels metres.

mod args;
mod line;
mod steps;
#[cfg(feature = "calibrate")]
mod axis;
#[cfg(feature = "calibrate")]
mod axis_answer;
#[cfg(feature = "calibrate")]
mod axis_distance;
#[cfg(feature = "calibrate")]
mod boards;
#[cfg(feature = "calibrate")]
mod camera;
#[cfg(feature = "calibrate")]
mod file;
#[cfg(feature = "calibrate")]
mod joint;
#[cfg(feature = "calibrate")]
mod plane;
#[cfg(feature = "calibrate")]
mod plane_answer;
#[cfg(feature = "calibrate")]
mod rejected;
#[cfg(feature = "calibrate")]
mod report;
#[cfg(feature = "calibrate")]
mod report_charts;
#[cfg(feature = "calibrate")]
mod stripes;
#[cfg(feature = "calibrate")]
mod views;

use std::io::Write;

use super::Outcome;
use crate::ros::arguments::RosArguments;

const HELP: &str = "\
Examples:
  laser_profiler calibrate camera board_recording --target checkerboard:8x6:0.040 -o camera.yaml
                                                       the lens, from 20 views of a checkerboard or more
  laser_profiler calibrate plane laser_on_board --target checkerboard:8x6:0.040 --camera camera.yaml -o rig.yaml
                                                       the laser's plane, from views of the board with the line on it
  laser_profiler calibrate axis turning_markers --calibration rig.yaml --markers aruco:4x4_50 -o scanner.yaml
                                                       the rotary axis, from markers that turn with the part
  laser_profiler calibrate steps base.png=0mm low.png=2mm high.png=5mm top.png=9mm --lateral 22um -o calibration.yaml
                                                       known heights, for users without a board

Each has --help of its own.";

/// Calibrates from recordings or pictures: camera, laser plane and axis, or known heights.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub struct CalibrateArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    Camera(args::CameraArgs),
    Plane(args::PlaneArgs),
    Axis(args::AxisArgs),
    Steps(steps::StepsArgs),
}

/// Calibrates and tells on `out` how well.
///
/// # Errors
/// [`Usage`](super::Usage) when the request cannot be followed, else whatever cannot be read, calibrated or written.
pub fn run(args: CalibrateArgs, ros: RosArguments, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    match args.what {
        #[cfg(feature = "calibrate")]
        What::Camera(args) => camera::run(&args, ros, out),
        #[cfg(feature = "calibrate")]
        What::Plane(args) => plane::run(&args, ros, out),
        #[cfg(feature = "calibrate")]
        What::Axis(args) => axis::run(&args, ros, out),
        What::Steps(args) => steps::run(&args, ros, out),
        #[cfg(not(feature = "calibrate"))]
        What::Camera(_) => without("camera"),
        #[cfg(not(feature = "calibrate"))]
        What::Plane(_) => without("plane"),
        #[cfg(not(feature = "calibrate"))]
        What::Axis(_) => without("axis"),
    }
}

/// The node's own build stays small.
#[cfg(not(feature = "calibrate"))]
fn without(what: &str) -> anyhow::Result<Outcome> {
    anyhow::bail!(
        "this program was built without `calibrate {what}`: build it with \
         `cargo build --release --features calibrate`"
    )
}
