//! `laser_profiler ambient`: the picture without laser that `background: reference` takes off.

use std::{
    io::Write,
    path::{Path, PathBuf},
};

use anyhow::Context;
use clap::Args;
use serde_json::json;

use super::{Outcome, Usage, output};
use crate::{
    node::ambient::{self, Mean},
    scanner::params::Channel,
};

/// Averages a recording made with the laser off into the picture that `background: reference` takes off every frame.
///
/// Record some ten frames with the laser off and everything else as in production: camera, exposure, room light.
#[derive(Debug, Args)]
#[command(after_long_help = HELP)]
pub struct AmbientArgs {
    /// A rosbag2 directory or an .mcap file with one image topic.
    pub bag: PathBuf,
    /// The picture, a PNG file.
    #[arg(short, long)]
    pub output: PathBuf,
    /// Grey level of a colour pixel, as the parameter channel; give the same one.
    #[arg(long, default_value = "auto")]
    pub channel: String,
    /// Largest image accepted, bytes, decoded.
    #[arg(long, default_value_t = 64 << 20)]
    pub max_frame_bytes: u64,
    /// Replaces a picture that is there already.
    #[arg(long)]
    pub force: bool,
    /// One JSON object on standard output: output, width, height, bits, frames.
    #[arg(long)]
    pub json: bool,
}

const HELP: &str = "\
Example:
  laser_profiler ambient laser_off -o ambient.png
  laser_profiler replay recording -o results --ros-args -p extraction.background:=reference \\
    -p extraction.background_file:=ambient.png";

/// Averages, writes the picture and tells on `out` what it is.
///
/// # Errors
/// An input that cannot be read, an output that is there or cannot be written. A reader of `out` that goes away is none.
pub fn run(args: &AmbientArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
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
