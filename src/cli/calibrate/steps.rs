//! `laser_profiler calibrate steps`: known heights instead of a board.

use std::{io::Write, path::PathBuf};

use anyhow::Context;

use super::line::{self, Line};
use crate::{
    cli::{
        Outcome, Usage,
        length::{length_m, positive_m},
        settings::{Settings, SettingsArgs},
    },
    metrology::plateaus,
    ros::arguments::RosArguments,
};

const HELP: &str = "\
Examples:
  laser_profiler calibrate steps base.png=0mm low.png=2mm high.png=5mm top.png=9mm
      four pictures, one height each
  laser_profiler calibrate steps stair.jpg=0mm,1mm,2mm,3mm,4mm
      one picture of a stair gauge; the heights in their order along the stripe";

/// Calibrates from pictures of known heights: a step gauge, gauge blocks, or a flat moved by known amounts.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct StepsArgs {
    /// A PNG or JPEG file or a recording, and the heights it shows in their order along the stripe.
    #[arg(value_name = "SOURCE=HEIGHT[,HEIGHT]", required = true, value_parser = source)]
    sources: Vec<Source>,
    /// Width that a pixel sees at height 0, along the stripe.
    #[arg(long, value_name = "LENGTH", value_parser = positive_m)]
    lateral: Option<f64>,
    #[command(flatten)]
    settings: SettingsArgs,
}

/// A picture or recording and its heights.
#[derive(Clone, Debug, PartialEq)]
struct Source {
    path: PathBuf,
    heights_m: Vec<f64>,
}

fn source(text: &str) -> Result<Source, String> {
    let Some((path, heights)) = text.rsplit_once('=') else {
        return Err("a height is missing: FILE=HEIGHT, as in base.png=0mm".to_owned());
    };
    let heights_m = heights.split(',').map(length_m).collect::<Result<Vec<_>, _>>()?;
    if heights_m.windows(2).any(|pair| pair[0].total_cmp(&pair[1]).is_eq()) {
        return Err("two neighbouring plateaus of one height are one plateau".to_owned());
    }
    Ok(Source { path: path.into(), heights_m })
}

/// Calibrates and tells on `out` how well.
///
/// # Errors
/// [`Usage`] for parameters that the node would refuse, pictures without stripe or with other plateaus.
pub(super) fn run(
    args: &StepsArgs,
    ros: RosArguments,
    out: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let settings = Settings::load(&args.settings, ros)?;
    tracing::debug!(lateral_m = args.lateral);
    for source in &args.sources {
        let name = source.path.display();
        let Line { points, size_px: (width, height), frames } =
            line::find(&source.path, &settings)?;
        let pieces = plateaus::cut(&points, source.heights_m.len())
            .map_err(|error| Usage(format!("{name}: {error}")))?;
        for (piece, height_m) in pieces.iter().zip(&source.heights_m) {
            writeln!(
                out,
                "{name} ({width} x {height}, {frames} frames): {height_m} m: {} points",
                piece.len()
            )
            .context("standard output")?;
        }
    }
    Ok(Outcome::Done)
}
