//! `laser_profiler report`: a scan as one HTML page.

mod plots;

use std::{io::Write, path::PathBuf};

use serde_json::json;

use super::{Outcome, output, progress::progress_bar, results_args::ResultsArgs};
use crate::{
    report::{
        frames::FrameSelection,
        scan_report::{ReportSelection, ScanReport},
    },
    results::{Notes, ResultsRecording},
};

const HELP: &str = "\
Examples:
  laser_profiler report results -o report.html                            one page: heights, sections, frames, quality, parameters
  laser_profiler report results --images my_recording -o report.html      with the images of the recording
  laser_profiler report results -o report.html --frames 0,50,100          selected frames, by their number in the recording
  laser_profiler report results --plots figures                           the figures as SVG and PNG files

The page is one self-contained file that needs no network. Move the pointer or use the arrow keys on the map to select the sections.
Heights are not resampled; they are stored in 16-bit steps of their range. Of more than 2.8 million points the page shows every n-th
and states so. Without a calibration the map shows the position of the stripe in the image. Notes on the page and in the output list
missing data.

--json prints one object: output, plots (files), frames, points, missing (fraction of cross-sections without a stripe), sigma_px,
  width_px (medians), lost_frames, rows and columns (of the map; null without), notes: [text], lost (places that could not be read)";

/// Maximum number of frames with images on one page.
const MAX_FRAMES: usize = 24;

/// Writes a scan as one HTML page: height map, cross-sections, frames with their centrelines, quality, parameters.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct ReportArgs {
    #[command(flatten)]
    results: ResultsArgs,
    /// Output file.
    #[arg(short, long, value_name = "FILE", required_unless_present = "plots")]
    output: Option<PathBuf>,
    /// Recording with the images. Default: the results bag.
    #[arg(long, value_name = "BAG")]
    images: Option<PathBuf>,
    /// Numbers of the frames to show with their centrelines, from 0. Default: four, evenly spaced.
    #[arg(long, value_name = "N,…", value_delimiter = ',')]
    frames: Vec<u64>,
    /// Directory for the figures: SVG for curves and frames, PNG for the height map.
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
    /// Replace an existing page.
    #[arg(long)]
    force: bool,
    /// One JSON object on standard output (see below).
    #[arg(long)]
    json: bool,
}

/// Reads a recording, writes its page and figures, and lists the files on `out`.
///
/// # Errors
/// The recording cannot be opened, or a file exists or cannot be written.
pub(crate) fn run(args: &ReportArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    if args.frames.len() > MAX_FRAMES {
        let text = format!("--frames: at most {MAX_FRAMES} frames fit on a page");
        return Err(super::Usage(text).into());
    }
    if let (Some(path), false) = (&args.output, args.force) {
        output::refuse_existing(path)?;
    }
    let mut notes = Notes::default();
    let recording = ResultsRecording::open(&args.results.selection(), &mut notes)?;
    let topic = recording.topic("centerline");
    let bar = progress_bar(topic.and_then(|topic| recording.num_messages(&topic)), "frames");
    let frames = FrameSelection { numbers: args.frames.clone(), images: args.images.clone() };
    let selection = ReportSelection { scan: &args.results.selection(), frames: &frames };
    let report = ScanReport::read(&recording, selection, &mut notes, || bar.inc(1));
    bar.finish_and_clear();
    let report = report?;
    notes.log();
    let plots = args.plots.as_ref().map(|directory| plots::write(directory, &report));
    let plots = plots.transpose()?.unwrap_or_default();
    let text = answer(args, &plots, &report, &notes);
    if let Some(path) = &args.output {
        output::write_file(path, report.page(&notes).html()?)?;
    }
    output::print(out, &text)?;
    Ok(Outcome::with_losses(notes.num_lost()))
}

fn answer(args: &ReportArgs, plots: &[PathBuf], report: &ScanReport<'_>, notes: &Notes) -> String {
    let (quality, extent) = (report.quality(), report.extent());
    if args.json {
        let object = json!({
            "output": args.output,
            "plots": plots,
            "frames": quality.num_frames,
            "points": quality.num_points,
            "missing": quality.missing(),
            "sigma_px": quality.sigma_px(),
            "width_px": quality.width_px(),
            "lost_frames": quality.num_lost,
            "rows": extent.map(|extent| extent.rows),
            "columns": extent.map(|extent| extent.columns),
            "notes": notes.texts(),
            "lost": notes.num_lost(),
        });
        format!("{object}\n")
    } else {
        let files = args.output.iter().chain(plots).map(|path| format!("{}\n", path.display()));
        files.collect()
    }
}
