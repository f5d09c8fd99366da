//! `laser_profiler compare`: how two results of one recording differ, where and why.

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
  laser_profiler compare before after                        a table: bias, RMS, worst places, what differs in the parameters
  laser_profiler compare before after -o compare.html        the same as a page, with a map of the differences
  laser_profiler compare golden new --fail-above 0.01        for a test: exit code 1 when a point moved by more than 0.01 px

Both are results of one recording: two sets of parameters, two calibrations, two versions. Frames are matched by their stamps,
points by column (by row, for a vertical stripe). Differences are B minus A across the stripe, in pixels of the image; where both
have profiles also of the heights, in micrometres. Quantiles are exact to 1/4096 px and 1/16 µm.

Unlike diff, results that differ are no failure: the exit code is 0, and 3 when something could not be read. With --fail-above it
is 1 when the largest difference is above that limit, or when a frame or a point is in one of them only.

--json prints one object:
  a, b: {path, version, method, input, frames_only, points_only}; frames, points (in both)
  px, um: {num, bias, median, rms, robust, p95, largest}; null without points in both
  flags:    {name: [only in A, only in B]} of the points in both
  frames_worst:   [{frame, stamp_ns, points, points_only: [A, B], bias_px, rms_px, largest_px, worst_section}]
  sections_worst: [{section, points, bias_px, rms_px, points_only: [A, B]}]
  reasons:  [{what, a, b}]; notes: [text]; lost (places that could not be read)";

/// Compares two results of one recording, column by column: differences in pixels and micrometres, where they are, and why.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub struct CompareArgs {
    /// Results that others are compared with.
    #[arg(value_name = "A")]
    before: PathBuf,
    /// Results that are compared.
    #[arg(value_name = "B")]
    after: PathBuf,
    /// The point clouds of the camera that is meant, where the results have several cameras.
    #[arg(long, value_name = "TOPIC")]
    topic: Option<String>,
    /// A page to write.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Ends with exit code 1 when the largest difference is above so many pixels, or a point is in one of them only.
    #[arg(long, value_name = "PX", value_parser = limit)]
    fail_above: Option<f64>,
    /// Compares results of different recordings, too, and replaces a page that is there.
    #[arg(long)]
    force: bool,
    /// One JSON object on standard output (see below).
    #[arg(long)]
    json: bool,
}

fn limit(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(limit) if limit >= 0.0 && limit.is_finite() => Ok(limit),
        _ => Err(format!("{text:?} is not a number of pixels from 0")),
    }
}

/// Compares and tells on `out`.
///
/// # Errors
/// A recording that cannot be opened, results of different recordings or without common frames, a page that cannot be
/// written, a difference above the limit.
pub fn run(args: &CompareArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
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
            bail!("{difference}: --force compares them all the same");
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
        return Err(anyhow!("the largest difference is {largest:.4} px, above {limit_px} px"));
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
