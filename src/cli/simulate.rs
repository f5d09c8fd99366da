//! `laser_profiler simulate`: renders a scenario into a recording with ground truth.

use std::{
    fs::File,
    io::{Read, Write},
    path::{Path, PathBuf},
};

use anyhow::{Context, Result};

use super::{Outcome, Usage, output};
use crate::{
    bag::{Compression, RecordOptions},
    simulate::scene_from_yaml,
};
use recording::record;

mod recording;
#[cfg(test)]
mod expected;

/// Longest accepted scenario file, bytes.
const MAX_SCENARIO_BYTES: u64 = 1 << 20;

const HELP: &str = "\
Example:
  laser_profiler simulate bags/film_defects.scenario.yaml -o film --force

OUT becomes a rosbag2 directory with the topics /camera/image_raw, /axis/joint_states and /truth/centerline. It also
contains the calibration.yaml of the camera. The same scenario gives the same bytes.

A scenario describes a part under the camera of formula 6; or, with the key rig, a gauge (flat, groove, stairs, spheres)
or checkerboards in front of any camera and laser plane; then /camera/camera_info is recorded too.

--json prints one object: frames (taken), images (recorded), dropped, output, bytes";

/// Renders a scenario into a recording with ground truth.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct SimulateArgs {
    /// Scenario file (YAML).
    pub(crate) scenario: PathBuf,
    /// Directory of the recording.
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// Print a machine-readable summary on standard output.
    #[arg(long)]
    pub(crate) json: bool,
    /// Replace an existing recording.
    #[arg(long)]
    pub(crate) force: bool,
}

/// Renders and prints the summary on `out`.
///
/// # Errors
/// [`Usage`] for an invalid scenario; an input that cannot be read; an output that exists or cannot be written.
pub(crate) fn run(args: &SimulateArgs, out: &mut dyn Write) -> Result<Outcome> {
    let text = read_scenario(&args.scenario)?;
    let scene = scene_from_yaml(&text)
        .map_err(|error| Usage(format!("{}: {error}", args.scenario.display())))?;
    let options = RecordOptions { compression: Compression::Zstd, force: args.force };
    let summary = record(&*scene, &text, &args.output, options)?;
    let report = if args.json {
        serde_json::to_string(&summary)?
    } else {
        format!(
            "{}: {} images, {} of {} frames dropped, {:.2} MB",
            summary.output.display(),
            summary.images,
            summary.dropped,
            summary.frames,
            summary.bytes as f64 / 1e6,
        )
    };
    output::printed(writeln!(out, "{report}"))?;
    Ok(Outcome::Done)
}

fn read_scenario(path: &Path) -> Result<String> {
    let cannot_read = || format!("cannot read the scenario {}", path.display());
    let mut text = String::new();
    let file = File::open(path).with_context(cannot_read)?;
    let length = file.take(MAX_SCENARIO_BYTES + 1).read_to_string(&mut text);
    let is_too_long = length.with_context(cannot_read)? as u64 > MAX_SCENARIO_BYTES;
    anyhow::ensure!(!is_too_long, "{}: longer than {MAX_SCENARIO_BYTES} bytes", path.display());
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::scenario::EXAMPLE;

    /// Runs the command on a file with the given text.
    fn simulate(text: &str, flags: &[&str]) -> Result<String> {
        let directory = tempfile::tempdir()?;
        let scenario = directory.path().join("scenario.yaml");
        std::fs::write(&scenario, text)?;
        let output = directory.path().join("out");
        let mut printed = Vec::new();
        let json = flags.contains(&"--json");
        run(&SimulateArgs { scenario, output, json, force: false }, &mut printed)?;
        Ok(String::from_utf8(printed)?)
    }

    #[test]
    fn the_summary_counts_frames() {
        let line = simulate(EXAMPLE, &[]).unwrap();
        assert!(line.contains("38 images, 2 of 40 frames dropped"), "{line}");
        let json: serde_json::Value =
            serde_json::from_str(&simulate(EXAMPLE, &["--json"]).unwrap()).unwrap();
        assert_eq!(
            (&json["frames"], &json["images"], &json["dropped"]),
            (&40.into(), &38.into(), &2.into())
        );
    }

    #[test]
    fn an_invalid_scenario_is_wrong_usage_and_named() {
        let error = simulate(&EXAMPLE.replace("frames: 40", "frames: 0"), &[]).unwrap_err();
        assert!(error.is::<Usage>(), "{error}");
        assert!(
            error.to_string().ends_with("scenario.yaml: frames is 0: allowed is 1 to 1000000"),
            "{error}"
        );
        let error = simulate(&" ".repeat(MAX_SCENARIO_BYTES as usize + 1), &[]).unwrap_err();
        assert!(error.to_string().contains("longer than"), "{error}");
    }
}
