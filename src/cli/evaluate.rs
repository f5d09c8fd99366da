//! `laser_profiler evaluate`: accuracy of the methods, against ground truth and by the protocol of the paper.

mod document;
mod hard;
mod hard_tables;
mod paper;
mod recorded_truth;
mod rendered;
mod rendered_tables;
mod truth;

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};

use anyhow::Context;
use serde_json::Value as Json;

use super::{Outcome, output, plots, progress::progress_bar, recording, settings};
use crate::ros::arguments::RosArguments;
use document::Section;
use plots::Plot;

const HELP: &str = "\
Examples:
  laser_profiler evaluate truth                        every method on rendered stripes with known centres
  laser_profiler evaluate truth bags/film_defects --params-file bags/film_defects.params.yaml
                                                       on a recording of `simulate`, with its ground truth
  laser_profiler evaluate hard                         hard scenes: wrong points that nothing shows
  laser_profiler evaluate paper                        Table 3 of the paper, and the correct Table 4
  laser_profiler evaluate paper my_recording --columns 500..900
                                                       the paper's protocol on your own recording

Each subcommand has its own --help. The same command gives the same bytes.";

/// Measures the accuracy of the methods, against ground truth and by the paper's protocol.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct EvaluateArgs {
    #[command(subcommand)]
    question: Question,
}

#[derive(Debug, clap::Subcommand)]
enum Question {
    Truth(truth::TruthArgs),
    Hard(hard::HardArgs),
    Paper(paper::PaperArgs),
}

/// Output format.
#[derive(Clone, Debug, Default, clap::Args)]
struct OutputArgs {
    /// Print one JSON object on standard output: all figures, unrounded; null for missing values.
    #[arg(long, conflicts_with = "markdown")]
    json: bool,
    /// Print Markdown instead of text.
    #[arg(long)]
    markdown: bool,
    /// Draw the plots as SVG files into this directory.
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
}

/// A report in all its formats.
struct Report {
    sections: Vec<Section>,
    json: Json,
    plots: Vec<Plot>,
    outcome: Outcome,
}

/// Prints the report to `out`.
///
/// # Errors
/// [`Usage`](super::Usage) for an invalid request; files that cannot be read or written.
pub(crate) fn run(
    args: EvaluateArgs,
    ros: RosArguments,
    out: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    match args.question {
        Question::Truth(args) => write(&truth::report(&args, ros)?, &args.output, out),
        Question::Hard(args) => write(&hard::report(&args, ros)?, &args.output, out),
        Question::Paper(args) => {
            let output = args.output.clone();
            write(&paper::report(args, ros)?, &output, out)
        }
    }
}

fn write(report: &Report, output: &OutputArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    if let Some(directory) = &output.plots {
        draw(&report.plots, directory)?;
    }
    let text = if output.json {
        format!("{}\n", report.json)
    } else if output.markdown {
        document::markdown(&report.sections, output.plots.as_deref())
    } else {
        document::plain(&report.sections)
    };
    output::print(out, &text)?;
    Ok(report.outcome)
}

fn draw(plots: &[Plot], directory: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(directory)
        .with_context(|| format!("cannot create the directory {}", directory.display()))?;
    plots.iter().try_for_each(|plot| plot.save(directory))
}
