//! `laser_profiler evaluate hard`: points of the methods on hard scenes that are wrong and do not show it.

use serde_json::json;

use super::{
    OutputArgs, Report, hard_tables, progress_bar,
    settings::{self, Settings, SettingsArgs},
};
use crate::{cli::Outcome, evaluate::hard, ros::arguments::RosArguments};

const HELP: &str = "\
Examples:
  laser_profiler evaluate hard
      every method on every scene: about a minute in a debug build
  laser_profiler evaluate hard --methods gaussian_ml --ros-args -p extraction.peak_selection:=continuity
      with your own parameters; the scenes set the camera's noise and the direction of the stripe

--json prints one object: source, seed, extraction, methods: [{method, all, classes: [{class, ..}]}], scenes: [{number, class, direction,
saturation, sigma_px, glow, halo, second, texture, methods: [{method, .., worst: {along_px, error_px, sigma_px, flags}}]}]. \"all\" and
the places marked \"..\" hold columns, points, missing, right, doubted, wrong, wrong_unsaturated, sound, rms_px, sound_rms_px,
scatter_over_sigma. Shares are 0 to 1; missing values are null.";

/// Measures rendered scenes with glow, halos, clipping, second lines and speckle, and counts the wrong points.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct HardArgs {
    /// Methods, separated by commas; default: all.
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    methods: Vec<String>,
    /// Seed of the shapes of the lines, the noise and the mixtures: the documented figures have seed 0.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(..1_000_000))]
    seed: u32,
    #[command(flatten)]
    settings: SettingsArgs,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

/// Measures the methods and returns the report.
///
/// # Errors
/// [`Usage`](crate::cli::Usage) for an invalid request.
pub(super) fn report(args: &HardArgs, ros: RosArguments) -> anyhow::Result<Report> {
    let methods = settings::methods(&args.methods)?;
    let settings = Settings::load(&args.settings, ros)?;
    let camera = settings.camera(&[])?;
    let scenes = hard::grid(args.seed);
    let bar = progress_bar(Some(scenes.len() as u64), "scenes");
    let study = hard::run(&camera.scanner, &methods, &scenes, || bar.inc(1));
    bar.finish_and_clear();
    Ok(Report {
        sections: vec![hard_tables::section(&study)],
        json: json!({
            "source": "hard",
            "seed": args.seed,
            "extraction": settings.extraction(&camera),
            "methods": study.methods,
            "scenes": study.scenes,
        }),
        plots: Vec::new(),
        outcome: Outcome::Done,
    })
}
