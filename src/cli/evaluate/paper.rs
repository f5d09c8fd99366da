//! `laser_profiler evaluate paper`: the protocol of Yao et al. 2023 on its own numbers or on a recording.

mod measure;
mod words;

use std::{ops::RangeInclusive, path::PathBuf};

use serde::Serialize;
use serde_json::json;

use super::{
    OutputArgs, Report,
    plots::{Curve, Plot},
    recording::Recording,
    settings::{Settings, SettingsArgs},
};
use crate::{
    cli::Outcome,
    evaluate::{
        paper::{Deviations, METHODS, Protocol},
        table3,
    },
    ros::arguments::RosArguments,
};
pub(super) use words::table_3_section;

const HELP: &str = "\
Examples:
  laser_profiler evaluate paper
      the 63 numbers of Table 3 of Yao et al. 2023 (doi 10.3390/app13179831)
  laser_profiler evaluate paper my_recording --frames 20 --columns 500..900 --plots plots
      the first 20 frames of a recording, columns 500 to 900, and the noise test
  laser_profiler evaluate paper my_recording --params-file rig.yaml --ros-args -r image_raw:=/left/image_raw

The protocol runs gray_gravity, gaussian_fit and improved_gravity, takes the mean of the three as the true centre and reports
each one's deviations from it. It measures agreement, not accuracy: for accuracy, see `evaluate truth`.

--json prints one object: source, points, methods: [{method, mean_absolute_px, standard_error_px, without_root}]; of a
recording also frames, rejected, columns and noise: [{gamma, points, methods: [... found, from_own_rms_px]}]";

/// The paper's protocol: three methods, their mean as reference, deviations, the noise test.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct PaperArgs {
    /// rosbag2 directory or .mcap file; default: the paper's own Table 3.
    #[arg(value_name = "BAG")]
    bag: Option<PathBuf>,
    /// Number of frames to use, from the first on.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// First and last column (row, for a vertical stripe) to use; default: all.
    #[arg(long, value_name = "A..B", value_parser = parse_columns)]
    columns: Option<RangeInclusive<u32>>,
    /// Seed of the added noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    settings: SettingsArgs,
    #[command(flatten)]
    pub(super) output: OutputArgs,
}

/// Parses columns `A..B`, both ends included.
fn parse_columns(text: &str) -> Result<RangeInclusive<u32>, String> {
    let ends = text.split_once("..").and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
    match ends {
        Some((first, last)) if first <= last => Ok(first..=last),
        _ => {
            Err("columns are two whole numbers, the first not above the last, as in 500..900"
                .into())
        }
    }
}

/// One method's figures.
#[derive(Clone, Debug, Serialize)]
struct MethodFigures {
    method: &'static str,
    #[serde(flatten)]
    deviations: Deviations,
}

/// One method's figures with added noise.
#[derive(Clone, Debug, Serialize)]
struct NoisyFigures {
    method: &'static str,
    #[serde(flatten)]
    deviations: Deviations,
    /// Share of the columns in which the method found a point.
    found: f64,
    /// Root mean square distance from the method's own result without added noise, pixels.
    from_own_rms_px: f64,
}

/// The noise test at one noise level.
#[derive(Clone, Debug, Serialize)]
struct NoiseStep {
    /// Standard deviation of the added noise, grey levels of an 8-bit scale.
    gamma: f64,
    /// Columns in which all three methods found a point.
    points: u64,
    methods: Vec<NoisyFigures>,
}

fn figures(protocol: &Protocol) -> Vec<MethodFigures> {
    let named = METHODS.iter().zip(protocol.deviations());
    named.map(|(method, deviations)| MethodFigures { method: method.name(), deviations }).collect()
}

/// Applies the protocol to Table 3 or to a recording.
///
/// # Errors
/// A recording that cannot be read, has no images or not the requested columns; parameters that the node would reject.
pub(super) fn report(args: PaperArgs, ros: RosArguments) -> anyhow::Result<Report> {
    let settings = Settings::load(&args.settings, ros)?;
    let Some(path) = &args.bag else {
        return Ok(of_table_3());
    };
    let recording = Recording::open(path, &settings)?;
    let run = measure::Run { frames: args.frames, columns: args.columns, seed: args.seed };
    let measured = run.measure(&recording)?;
    let read = measured.read;
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    let json = json!({
        "source": name,
        "topic": recording.topic.name,
        "frames": read.frames,
        "rejected": read.rejected,
        "columns": measured.columns,
        "points": measured.steps[0].points,
        "seed": args.seed,
        "extraction": settings.extraction(&recording.camera),
        "methods": measured.steps[0].methods,
        "noise": measured.steps[1..],
    });
    Ok(Report {
        sections: words::recording_sections(&name, &recording.topic.name, &measured),
        json,
        plots: vec![noise_plot(&measured.steps)],
        outcome: if read.rejected == 0 { Outcome::Done } else { Outcome::DataLost },
    })
}

fn of_table_3() -> Report {
    let protocol = Protocol::of(&table3::ROWS_PX);
    let methods = figures(&protocol);
    let json = json!({
        "source": "table_3",
        "points": protocol.points(),
        "methods": methods,
        "printed_standard_error_px": table3::PRINTED_STANDARD_ERROR_PX,
    });
    let sections = vec![table_3_section()];
    Report { sections, json, plots: Vec::new(), outcome: Outcome::Done }
}

fn noise_plot(steps: &[NoiseStep]) -> Plot {
    let curve = |(number, method): (usize, &crate::scanner::params::Method)| {
        let point =
            |step: &NoiseStep| (step.gamma, step.methods[number].deviations.standard_error_px);
        Curve::method(method.name(), steps.iter().map(point).collect())
    };
    Plot {
        file: "paper_noise.svg".to_owned(),
        title: "Standard error by the paper's protocol".to_owned(),
        x_label: "added noise γ [grey levels]",
        y_label: "from the mean of three [px]",
        is_log: false,
        curves: METHODS.iter().enumerate().map(curve).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_two_numbers_in_order() {
        assert_eq!(parse_columns("5..9"), Ok(5..=9));
        assert_eq!(parse_columns("7..7"), Ok(7..=7));
        for wrong in ["9..5", "5-9", "5..", "..", "-1..4", "5..9999999999"] {
            assert!(parse_columns(wrong).unwrap_err().contains("500..900"), "{wrong}");
        }
    }
}
