//! `laser_profiler evaluate page`: `docs/accuracy.md`, made of the other answers.

use std::{
    fs,
    io::Write,
    path::{Path, PathBuf},
};

use anyhow::Context;

use super::{
    document, draw, paper, recorded_truth,
    recording::Recording,
    rendered, rendered_tables,
    settings::{self, Settings, SettingsArgs},
};
use crate::{
    cli::{Outcome, output},
    evaluate::trial::Plan,
    ros::arguments::RosArguments,
};

const HELP: &str = "\
Example:
  laser_profiler evaluate page --output docs
      docs/accuracy.md and docs/accuracy_*.svg; run it where `bags` is, in the root of the repository

The page has the paper's protocol on the paper's numbers, all experiments on rendered stripes, and the recordings of this
project that carry their truth. The same program gives the same bytes.";

/// Recordings of the page, with their parameters.
const RECORDINGS: [&str; 2] = ["film_defects", "saturated_vertical"];
const SEED: u64 = 1;
const FRAMES: u32 = 4;

/// Writes the page about accuracy in the documentation, with its plots.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(super) struct PageArgs {
    /// Directory of the page.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Directory of the project's recordings.
    #[arg(long, value_name = "DIR", default_value = "bags")]
    bags: PathBuf,
}

/// Writes the page and says where.
///
/// # Errors
/// A recording that cannot be read, a file that cannot be written.
pub(super) fn run(
    args: &PageArgs,
    ros: RosArguments,
    out: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let methods = settings::methods(&[])?;
    let experiments = rendered::experiments(&[])?;
    // Recordings first: what is not there is told before the work.
    let mut recorded = Vec::new();
    for name in RECORDINGS {
        let parameters = SettingsArgs {
            params_file: vec![args.bags.join(format!("{name}.params.yaml"))],
            camera: None,
        };
        let settings = Settings::load(&parameters, ros.clone())?;
        let recording = Recording::open(&args.bags.join(name), &settings)?;
        let measured = recorded_truth::measure(&recording, &methods)?;
        recorded.push(recorded_truth::section(name, &measured));
    }
    let settings = Settings::load(&SettingsArgs::default(), ros)?;
    let camera = settings.camera(&[])?;
    let plan = Plan { params: camera.scanner.extraction, methods, seed: SEED, frames: FRAMES };
    let study = rendered::study(&plan, &experiments, settings.extraction(&camera));
    let mut sections = vec![paper::table_3_section()];
    sections.extend(rendered_tables::sections(&study));
    sections.extend(recorded);
    draw(&rendered::plots(&study), &args.output)?;
    let path = args.output.join("accuracy.md");
    let page = format!("{PREFACE}\n{}", document::markdown(&sections, Some(Path::new(""))));
    fs::write(&path, page).with_context(|| format!("cannot write {}", path.display()))?;
    output::printed(writeln!(out, "{}", path.display()))?;
    Ok(Outcome::Done)
}

const PREFACE: &str = "\
# Accuracy

This page is the output of `laser_profiler evaluate page --output docs`; nobody edits it. Its parts alone, with `--json` for
scripts and `--plots` for pictures:

```sh
laser_profiler evaluate paper                  # the paper's protocol, on its Table 3 or on a recording
laser_profiler evaluate truth                  # all methods on rendered stripes
laser_profiler evaluate truth bags/film_defects --params-file bags/film_defects.params.yaml
```

Methods stand side by side as they are, also where they lose. `improved_gravity`, the default, is the paper's method.
Pixels are what is measured here; what a pixel is on the part depends on the optics. On rough surfaces speckle, not noise, is
the limit: see the speckle table before you trust a hundredth of a pixel.
";
