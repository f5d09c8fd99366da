//! `laser_profiler report`: a scan as one page for people.

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
  laser_profiler report results --images my_recording -o report.html      with the images that the results were made from
  laser_profiler report results -o report.html --frames 0,50,100          these frames, by their number in the recording
  laser_profiler report results --plots figures                           the same figures as SVG and PNG files

The page is one file and needs no network: open it in a browser, send it, print it. The map takes the pointer and the arrow keys;
the sections follow. Heights are shown as they were measured, in 16-bit steps of their range; of more than 2.8 million points every
n-th is shown, and the page says so. Without a calibration it shows where the stripe was in the image instead.
What is missing in the recording is said on the page and in the answer, and the rest is shown.

--json prints one object: output, plots (files), frames, points, missing (share of cross-sections without a stripe), sigma_px,
  width_px (medians), lost_frames, rows and columns (of the map; null without), notes: [text], lost (places that could not be read)";

/// Most frames with images in one page.
const MAX_FRAMES: usize = 24;

/// Writes a scan as one HTML page: height map, cross-sections, frames with their centrelines, quality, parameters.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub struct ReportArgs {
    #[command(flatten)]
    results: ResultsArgs,
    /// The page to write.
    #[arg(short, long, value_name = "FILE", required_unless_present = "plots")]
    output: Option<PathBuf>,
    /// The recording with the images; when not given, images are looked for in the results.
    #[arg(long, value_name = "BAG")]
    images: Option<PathBuf>,
    /// Numbers of frames that are shown with their centrelines, from 0; four over the recording, when not given.
    #[arg(long, value_name = "N,…", value_delimiter = ',')]
    frames: Vec<u64>,
    /// A directory for the figures as files: SVG for curves and frames, PNG for the height map.
    #[arg(long, value_name = "DIR")]
    plots: Option<PathBuf>,
    /// Replaces files that are there already.
    #[arg(long)]
    force: bool,
    /// One JSON object on standard output (see below).
    #[arg(long)]
    json: bool,
}

/// Reads a recording, writes its page and figures, and tells on `out` what was written.
///
/// # Errors
/// A recording that cannot be opened, a file that is there or cannot be written.
pub fn run(args: &ReportArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    if args.frames.len() > MAX_FRAMES {
        let told = format!("--frames: at most {MAX_FRAMES} frames fit on a page");
        return Err(super::Usage(told).into());
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
