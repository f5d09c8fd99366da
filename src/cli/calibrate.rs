//! `laser_profiler calibrate`: from recordings to the file that makes pixels metres.

mod line;
mod steps;

use std::io::Write;

use super::Outcome;
use crate::ros::arguments::RosArguments;

const HELP: &str = "\
Examples:
  laser_profiler calibrate steps base.png=0mm low.png=2mm high.png=5mm top.png=9mm --lateral 22um -o calibration.yaml
                                                       known heights, for users without a board

Each has --help of its own.";

/// Calibrates from recordings or pictures: known heights, with the node's own extraction.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub struct CalibrateArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    Steps(steps::StepsArgs),
}

/// Calibrates and tells on `out` how well.
///
/// # Errors
/// [`Usage`](super::Usage) when the request cannot be followed, else whatever cannot be read, calibrated or written.
pub fn run(args: CalibrateArgs, ros: RosArguments, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    match args.what {
        What::Steps(args) => steps::run(&args, ros, out),
    }
}
