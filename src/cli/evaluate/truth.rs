//! `laser_profiler evaluate truth`: compares the methods with known centres.

use std::path::PathBuf;

use serde_json::json;

use super::{
    OutputArgs, Report, recorded_truth,
    recording::Recording,
    rendered, rendered_tables,
    settings::{self, Settings, SettingsArgs},
};
use crate::{cli::Outcome, evaluate::trial::Plan, ros::arguments::RosArguments};

const HELP: &str = "\
Examples:
  laser_profiler evaluate truth --plots plots
      every method, every experiment: some ten seconds
  laser_profiler evaluate truth --methods gaussian_ml,steger --experiments reference,edge
  laser_profiler evaluate truth --experiments reference --ros-args -p extraction.smoothing_columns:=5
      with your own parameters; each scene sets the camera's noise
  laser_profiler evaluate truth bags/film_defects --params-file bags/film_defects.params.yaml
      a recording of `laser_profiler simulate`: its topic /truth/centerline is the ground truth

Experiments: reference (six scenes), noise, width, saturation, slope, speckle, locking (error over the sub-pixel phase), edge
(columns that a step along the stripe spoils), smoothing (noise against resolution).

--json prints one object. Without BAG: source, seed, frames, methods, extraction, series: [{experiment, axis, scenes: [{scene,
value, amplitude, sigma_px, read_noise, bound_px, simple_bound_px, speckle_centroid_px, methods: [{method, columns, points,
false_points, missing, wrong, bias_px, rms_px, median_px, p95_px, within_1_sigma, within_2_sigma, columns_averaged, over_bound,
over_simple_bound}]}]}], locking, edge, smoothing. With BAG: source, topic, frames, rejected, unpaired, extraction, methods.
Shares are 0 to 1; missing values are null.";

/// Compares the methods with ground truth: rendered stripes, or a recording with ground truth.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct TruthArgs {
    /// Recording with the topic /truth/centerline; default: rendered stripes.
    #[arg(value_name = "BAG")]
    bag: Option<PathBuf>,
    /// Methods, separated by commas; default: all.
    #[arg(long, value_name = "NAME,..", value_delimiter = ',')]
    methods: Vec<String>,
    /// Experiments on rendered stripes, separated by commas; default: all.
    #[arg(long, value_name = "NAME,..", value_delimiter = ',', conflicts_with = "bag")]
    experiments: Vec<String>,
    /// Frames of each rendered scene; at least 2 are needed to estimate the number of averaged columns.
    #[arg(long, default_value_t = 4, conflicts_with = "bag",
        value_parser = clap::value_parser!(u32).range(1..=1000))]
    frames: u32,
    /// Seed of the rendered noise.
    #[arg(long, default_value_t = 1, conflicts_with = "bag")]
    seed: u64,
    #[command(flatten)]
    settings: SettingsArgs,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

/// Measures the methods and prints the report.
///
/// # Errors
/// [`Usage`](crate::cli::Usage) for an invalid request; a recording that cannot be read or has no ground truth.
pub(super) fn report(args: &TruthArgs, ros: RosArguments) -> anyhow::Result<Report> {
    let methods = settings::methods(&args.methods)?;
    let experiments = rendered::experiments(&args.experiments)?;
    let settings = Settings::load(&args.settings, ros)?;
    if let Some(path) = &args.bag {
        let recording = Recording::open(path, &settings)?;
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
        let measured = recorded_truth::measure(&recording, &methods)?;
        let read = measured.read;
        let is_whole = read.rejected == 0 && measured.unpaired == 0;
        return Ok(Report {
            sections: vec![recorded_truth::section(&name, &measured)],
            json: json!({
                "source": name,
                "topic": recording.topic.name,
                "frames": measured.frames,
                "rejected": read.rejected,
                "unpaired": measured.unpaired,
                "extraction": settings.extraction(&recording.camera),
                "methods": measured.methods,
            }),
            plots: Vec::new(),
            outcome: if is_whole { Outcome::Done } else { Outcome::DataLost },
        });
    }
    let camera = settings.camera(&[])?;
    let plan =
        Plan { params: camera.scanner.extraction, methods, seed: args.seed, frames: args.frames };
    let study = rendered::study(&plan, &experiments, settings.extraction(&camera));
    Ok(Report {
        sections: rendered_tables::sections(&study),
        json: serde_json::to_value(&study)?,
        plots: rendered::plots(&study),
        outcome: Outcome::Done,
    })
}
