//! `laser_profiler compare`: differences between two results of one recording.

mod answer;

use std::{io::Write, path::PathBuf};

use anyhow::{anyhow, bail};

use super::{Outcome, output};
use crate::{
    report::{comparison::Comparison, difference::Differences},
    results::{Notes, ResultsRecording, ScanSelection, different_inputs},
};

const HELP: &str = "\
Examples:
  laser_profiler compare before after                        a table: bias, RMS, worst places, differing parameters
  laser_profiler compare before after -o compare.html        the same as a page, with a map of the differences
  laser_profiler compare golden new --fail-above 0.01        for a test: exit code 1 if a point moved by more than 0.01 px

A and B are results of one recording with different parameters, calibrations or versions. Frames are matched by their stamps, points by
column (by row for a vertical stripe). Differences are B minus A: across the stripe in pixels of the image and, if both have profiles,
in height in micrometres. Quantiles are exact to 1/4096 px and 1/16 µm.

Unlike with diff, differences are not a failure: the exit code is 0, or 3 if something could not be read. With --fail-above it is 1 if
the largest difference exceeds the limit, or if a frame or a point is in only one of them.

--json prints one object:
  a, b: {path, version, method, input, frames_only, points_only}; frames, points (in both)
  px, um: {num, bias, median, rms, robust, p95, largest}; null without points in both
  flags:    {name: [only in A, only in B]} for points in both
  frames_worst:   [{frame, stamp_ns, points, points_only: [A, B], bias_px, rms_px, largest_px, worst_section}]
  sections_worst: [{section, points, bias_px, rms_px, points_only: [A, B]}]
  reasons:  [{what, a, b}]; notes: [text]; lost (number of losses)";

/// Compares two results of one recording: differences in pixels and micrometres, their places, and differing settings.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct CompareArgs {
    /// Reference results.
    #[arg(value_name = "A")]
    before: PathBuf,
    /// Results to compare with the reference.
    #[arg(value_name = "B")]
    after: PathBuf,
    /// Point-cloud topic of the camera, if the results have several cameras.
    #[arg(long, value_name = "TOPIC")]
    topic: Option<String>,
    /// Write the comparison as an HTML page.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// End with exit code 1 if the largest difference exceeds PX pixels, or if a point is in only one of them.
    #[arg(long, value_name = "PX", value_parser = limit)]
    fail_above: Option<f64>,
    /// Also compare results of different recordings, and replace an existing page.
    #[arg(long)]
    force: bool,
    /// One JSON object on standard output (see below).
    #[arg(long)]
    json: bool,
}

fn limit(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(limit) if limit >= 0.0 && limit.is_finite() => Ok(limit),
        _ => Err(format!("{text:?} is not a non-negative number of pixels")),
    }
}

/// Compares two results and prints the differences on `out`.
///
/// # Errors
/// A recording cannot be opened, the results are of different recordings or have no common frame, the page exists or cannot
/// be written, a difference exceeds the limit.
pub(crate) fn run(args: &CompareArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    if let (Some(path), false) = (&args.output, args.force) {
        output::refuse_existing(path)?;
    }
    let mut notes = Notes::default();
    let open = |bag: &PathBuf, notes: &mut Notes| {
        let selection = ScanSelection { bag: bag.clone(), topic: args.topic.clone(), scan: None };
        ResultsRecording::open(&selection, notes)
    };
    let recordings = [open(&args.before, &mut notes)?, open(&args.after, &mut notes)?];
    let recordings = [&recordings[0], &recordings[1]];
    for difference in different_inputs(recordings, &mut notes) {
        if !args.force {
            bail!("{difference}: --force compares them anyway");
        }
        notes.add(difference);
    }
    let comparison = Comparison::read(recordings, &mut notes).inspect_err(|_| notes.log())?;
    if let Some(path) = &args.output {
        output::write_file(path, comparison.page(&mut notes)?.html()?)?;
    }
    notes.log();
    let text =
        if args.json { answer::json(&comparison, &notes) } else { answer::text(&comparison)? };
    output::print(out, &text)?;
    if let Some(limit_px) = args.fail_above {
        require_below(limit_px, &comparison.differences)?;
    }
    Ok(Outcome::with_losses(notes.num_lost()))
}

fn require_below(limit_px: f64, differences: &Differences) -> anyhow::Result<()> {
    let largest = differences.pixels.figures().largest;
    if largest > limit_px {
        return Err(anyhow!(
            "the largest difference is {largest:.4} px, above the limit of {limit_px} px"
        ));
    }
    let [_, frames @ ..] = differences.num_frames;
    let [_, points @ ..] = differences.num_points;
    if frames.iter().chain(&points).any(|num| *num > 0) {
        return Err(anyhow!(
            "only in A: {} frames, {} points; only in B: {} frames, {} points",
            frames[0],
            points[0],
            frames[1],
            points[1]
        ));
    }
    Ok(())
}
