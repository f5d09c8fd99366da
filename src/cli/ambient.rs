//! `laser_profiler ambient`: the ambient image that `background: reference` subtracts.

use std::{
    io::Write,
    path::{Path, PathBuf},
};

use anyhow::Context;
use clap::Args;
use serde_json::json;

use super::{Outcome, Usage, output};
use crate::{
    bag::ReadOptions,
    node::ambient::{self, Mean},
    scanner::params::Channel,
};

/// Averages a recording with the laser off into the ambient image that `background: reference` subtracts.
///
/// Record about ten frames with the laser off and everything else as in production: camera, exposure, room light.
#[derive(Debug, Args)]
#[command(after_long_help = HELP)]
pub(crate) struct AmbientArgs {
    /// A rosbag2 directory or an .mcap file with one image topic; a folder of pictures, a picture or a video.
    pub(crate) bag: PathBuf,
    /// Ambient image, a PNG file.
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Conversion of colour pixels to grey levels; use the value of the parameter `channel`.
    #[arg(long, default_value = "auto")]
    pub(crate) channel: String,
    /// Largest accepted image, bytes after decoding.
    #[arg(long, default_value_t = ReadOptions::default().max_frame_bytes)]
    pub(crate) max_frame_bytes: u64,
    /// Replace an existing file.
    #[arg(long)]
    pub(crate) force: bool,
    /// One JSON object on standard output: output, width, height, bits, frames.
    #[arg(long)]
    pub(crate) json: bool,
}

const HELP: &str = "\
Example:
  laser_profiler ambient laser_off -o ambient.png
  laser_profiler replay recording -o results --ros-args -p extraction.background:=reference \\
    -p extraction.background_file:=ambient.png";

/// Averages the frames, writes the image and prints a summary on `out`.
///
/// # Errors
/// The input cannot be read, or the output exists or cannot be written. A closed pipe is not an error.
pub(crate) fn run(args: &AmbientArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let Some(channel) = Channel::from_name(&args.channel) else {
        let (name, names) = (&args.channel, Channel::NAMES.join(", "));
        return Err(Usage(format!("--channel is {name}, allowed is one of {names}")).into());
    };
    if !args.force {
        output::refuse_existing(&args.output)?;
    }
    let mean = ambient::mean(&args.bag, channel, args.max_frame_bytes, |_| {})
        .with_context(|| args.bag.display().to_string())?;
    save(&mean, &args.output).with_context(|| args.output.display().to_string())?;
    let Mean { width, height, bits, num_frames, .. } = mean;
    let output = args.output.display();
    let printed = if args.json {
        let object = json!({
            "output": args.output, "width": width, "height": height, "bits": bits, "frames": num_frames,
        });
        writeln!(out, "{object}")
    } else {
        writeln!(
            out,
            "{output}: mean of {num_frames} frames, {width} x {height} pixels, {bits} bits"
        )
    };
    output::printed(printed)?;
    Ok(Outcome::Done)
}

fn save(mean: &Mean, path: &Path) -> image::ImageResult<()> {
    let (bytes, color): (Vec<u8>, _) = if mean.bits == 8 {
        (mean.levels().map(|level| level as u8).collect(), image::ColorType::L8)
    } else {
        (mean.levels().flat_map(u16::to_ne_bytes).collect(), image::ColorType::L16)
    };
    let (width, height) = (mean.width as u32, mean.height as u32);
    image::save_buffer_with_format(path, &bytes, width, height, color, image::ImageFormat::Png)
}
