//! `laser_profiler suggest`: parameters for a recording, worked out from some of its frames.

mod file;
mod picture;

use std::{
    io::Write,
    path::{Path, PathBuf},
};

use anyhow::{Context, bail};
use clap::Args;
use serde_json::json;

use super::{Outcome, Usage, output};
use crate::{
    bag::ReadOptions,
    node::sampled::{self, Sampled},
    ros::value::Value,
    scanner::suggestion::{Suggestion, suggest},
};

/// Endings of pictures.
const PICTURES: [&str; 10] =
    ["png", "jpg", "jpeg", "tif", "tiff", "bmp", "pgm", "ppm", "pbm", "pnm"];

/// Looks at some frames of a recording and writes a parameter file for them, with comments.
///
/// It finds the direction of the line, the channel of colour images, the full scale of 10, 12 or 14 bits, background,
/// threshold, limit of the width and region of interest. The picture beside the file shows the line that these parameters
/// measure: look at it.
#[derive(Debug, Args)]
#[command(after_long_help = HELP)]
pub(crate) struct SuggestArgs {
    /// A recording with one image topic, a folder of pictures, a quoted pattern or a video.
    pub(crate) bag: PathBuf,
    /// Parameter file, YAML; the picture gets the same name with .png. Default: the file is printed.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Number of frames to look at, spread over the recording.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub(crate) frames: u16,
    /// Largest accepted image, bytes after decoding.
    #[arg(long, default_value_t = ReadOptions::default().max_frame_bytes)]
    pub(crate) max_frame_bytes: u64,
    /// Replace existing files.
    #[arg(long)]
    pub(crate) force: bool,
    /// Print a machine-readable summary on standard output.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Below this share a line may be something else.
const DOUBTFUL_SHARE: f64 = 0.6;

const HELP: &str = "\
Example:
  laser_profiler suggest my_recording -o rig.yaml      look at rig.png, then:
  laser_profiler replay my_recording -o results --params-file rig.yaml

The file holds only parameters that differ from the defaults; `laser_profiler parameters` lists all of them. If no line is
found, the likely reason is printed, no file is written, and the exit code is 1.

--json prints one object:
  topic, frames, examined, unusable, line_share (of the cross-sections with the line, 0 to 1), line_share_of_defaults,
  width_px, parameters (name: value; numbers are numbers), output, picture";

/// Suggests parameters, writes them, and prints them or a summary on `out`.
///
/// # Errors
/// [`Usage`] if the output is named like a picture; the recording cannot be read, no line is found, or a file exists or
/// cannot be written.
pub(crate) fn run(args: &SuggestArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    if let Some(path) = &args.output {
        refuse_picture(path)?;
    }
    let picture_path = args.output.as_deref().and_then(picture_path);
    if !args.force {
        for path in args.output.iter().chain(&picture_path) {
            output::refuse_existing(path)?;
        }
    }
    let name = || args.bag.display().to_string();
    let count = usize::from(args.frames);
    let sampled = sampled::frames(&args.bag, count, args.max_frame_bytes).with_context(name)?;
    let suggestion = suggest(&sampled.pictures).context("the recording holds no frames")?;
    if let Some(diagnosis) = suggestion.diagnosis {
        bail!(
            "{}: no line in {} frames. Likely reason: {diagnosis}",
            name(),
            sampled.pictures.len()
        );
    }
    if suggestion.share < DOUBTFUL_SHARE {
        tracing::warn!(
            "only {:.0} % of the cross-sections have the line. Look at the picture: it may show edges or reflections, and the laser may be off",
            100.0 * suggestion.share
        );
    }
    let text = file::text(&suggestion, &sampled);
    if let Some(path) = &args.output {
        output::write_file(path, &text)?;
    }
    if let Some(path) = &picture_path {
        draw(&suggestion, &sampled, path)?;
    }
    let printed = match (args.json, &args.output) {
        (true, _) => format!("{}\n", summary(&suggestion, &sampled, args)),
        (false, None) => text,
        (false, Some(path)) => {
            let picture = picture_path.map(|path| path.display().to_string());
            let picture = picture.map(|path| format!("{path}: the line that is measured\n"));
            format!(
                "{}: the line in {:.0} % of the cross-sections ({:.0} % with the defaults)\n{}",
                path.display(),
                100.0 * suggestion.share,
                100.0 * suggestion.share_of_defaults,
                picture.unwrap_or_default()
            )
        }
    };
    output::print(out, &printed)?;
    Ok(Outcome::Done)
}

/// Returns the path of the picture: beside the parameter file, and none beside a device or a pipe.
fn picture_path(output: &Path) -> Option<PathBuf> {
    let is_file = output.metadata().map_or(true, |of| of.is_file());
    is_file.then(|| output.with_extension("png"))
}

/// The picture gets its name from the parameter file, which must have another.
fn refuse_picture(path: &Path) -> Result<(), Usage> {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    if PICTURES.iter().any(|picture| ending == *picture) {
        let (path, yaml) = (path.display(), path.with_extension("yaml"));
        let yaml = yaml.display();
        return Err(Usage(format!(
            "-o {path} is named like a picture, but the output is a parameter file in YAML: use -o {yaml}; the picture of \
             the line is written beside it, with the ending .png"
        )));
    }
    Ok(())
}

fn draw(suggestion: &Suggestion, sampled: &Sampled, path: &Path) -> anyhow::Result<()> {
    let middle = sampled.pictures.get(sampled.pictures.len() / 2);
    let view = middle.context("the recording holds no frames")?.view();
    picture::save(path, &view, &suggestion.params)
}

fn summary(suggestion: &Suggestion, sampled: &Sampled, args: &SuggestArgs) -> serde_json::Value {
    let parameters: serde_json::Map<_, _> = file::changed(&suggestion.params)
        .into_iter()
        .map(|changed| (changed.name.to_owned(), in_json(changed.value)))
        .collect();
    json!({
        "topic": sampled.topic,
        "frames": sampled.num_frames,
        "examined": sampled.pictures.len(),
        "unusable": sampled.num_unusable,
        "line_share": suggestion.share,
        "line_share_of_defaults": suggestion.share_of_defaults,
        "width_px": suggestion.width_px,
        "parameters": parameters,
        "output": args.output,
        "picture": args.output.as_deref().and_then(picture_path),
    })
}

fn in_json(value: Value) -> serde_json::Value {
    match value {
        Value::Bool(value) => json!(value),
        Value::Integer(value) => json!(value),
        Value::Float(value) => json!(value),
        Value::Text(value) => json!(value),
        Value::TextList(values) => json!(values),
    }
}
