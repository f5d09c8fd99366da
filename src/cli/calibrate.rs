//! `laser_profiler calibrate`: computes the file that converts pixels to metres from recordings.

mod args;
mod level;
mod line;
mod steps;
#[cfg(feature = "calibrate")]
mod vision;
#[cfg(not(feature = "calibrate"))]
mod without_vision;

use std::io::Write;

#[cfg(not(feature = "calibrate"))]
use without_vision as vision;

use super::Outcome;
use crate::ros::arguments::RosArguments;

const HELP: &str = "\
Examples:
  laser_profiler calibrate camera board_recording --target checkerboard:8x6:0.040 -o camera.yaml
                                                       camera and lens, from 20 or more views of a checkerboard
  laser_profiler calibrate plane laser_on_board --target checkerboard:8x6:0.040 --camera camera.yaml -o rig.yaml
                                                       the laser plane, from views of the board with the line on it
  laser_profiler calibrate axis turning_markers --calibration rig.yaml --markers aruco:4x4_50 -o scanner.yaml
                                                       the rotary axis, from markers that turn with the part
  laser_profiler calibrate steps base.png=0mm low.png=2mm high.png=5mm top.png=9mm --lateral 22um -o calibration.yaml
                                                       known heights instead of a board
  laser_profiler calibrate level results -o level.yaml --region=-30mm,-30mm,30mm,30mm
                                                       the part's frame levelled on a scanned flat

Each subcommand has its own --help.";

/// Calibrates from recordings or pictures: camera, laser plane, axis and level, or known heights.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct CalibrateArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    Camera(args::CameraArgs),
    Plane(args::PlaneArgs),
    Axis(args::AxisArgs),
    Steps(steps::StepsArgs),
    Level(level::LevelArgs),
}

/// Calibrates and prints the result to `out`.
///
/// # Errors
/// [`Usage`](super::Usage) for an invalid request; files that cannot be read or written; data that do not calibrate.
pub(crate) fn run(
    args: CalibrateArgs,
    ros: RosArguments,
    out: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    match args.what {
        What::Camera(args) => vision::camera(&args, ros, out),
        What::Plane(args) => vision::plane(&args, ros, out),
        What::Axis(args) => vision::axis(&args, ros, out),
        What::Steps(args) => steps::run(&args, ros, out),
        What::Level(args) => level::run(&args, out),
    }
}
