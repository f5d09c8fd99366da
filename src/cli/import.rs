//! `laser_profiler import`: makes a recording of pictures.

use std::{io::Write, path::PathBuf};

use anyhow::Context;
use serde_json::json;

use super::{
    Outcome, interrupt, output, picture_args::PictureArgs, progress::progress_bar, settings::usage,
    summary::INTERRUPTED, units::bytes,
};
use crate::{
    bag::{
        BagError, BagReader, Compression, ReadOptions, RecordOptions,
        import::{Imported, import},
        pictures,
    },
    node::stop::Stop,
};

const HELP: &str = "\
PNG, JPEG and TIFF files are copied as they are (sensor_msgs/CompressedImage on /image_raw/compressed); of BMP and PGM files and
of the frames of videos the pixels are stored (sensor_msgs/Image on /image_raw). Positions become sensor_msgs/JointState on /joint_states. A replay of
the recording gives the results of a replay of the pictures. Pictures that cannot be used are named and left out (exit code 3).

Examples:
  laser_profiler import scan -o scan_bag --frame-rate 50
  laser_profiler import 'scan/*.png' -o scan_bag --positions positions.csv
  laser_profiler import scan.mp4 -o scan_bag

--json prints one object:
  output, bytes, pictures, left_out (number), reasons: [text] (of the first ones), interrupted (true if Ctrl-C or SIGTERM
  ended it before the last picture; exit code 3), notes: [text]";

/// Makes a recording (MCAP) of pictures, for other programs and to keep.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct ImportArgs {
    /// A folder of pictures, pictures (PNG, JPEG, TIFF, BMP, PGM) or a quoted pattern: one series, in natural order. Or a
    /// video, through an installed ffmpeg.
    #[arg(required = true, value_name = "PICTURES")]
    inputs: Vec<PathBuf>,
    /// Directory of the new recording.
    #[arg(short, long, value_name = "BAG")]
    output: PathBuf,
    #[command(flatten)]
    pictures: PictureArgs,
    /// Largest accepted picture file; of those whose pixels are stored, the largest image, too. Bytes.
    #[arg(long, default_value_t = ReadOptions::default().max_frame_bytes)]
    max_frame_bytes: u64,
    /// Replace an existing bag.
    #[arg(long)]
    force: bool,
    /// One JSON object on standard output.
    #[arg(long)]
    json: bool,
}

/// Makes the recording and prints a summary on `out`.
///
/// # Errors
/// [`Usage`](super::Usage) for wrong options; an input that cannot be opened or an output that cannot be written.
pub(crate) fn run(args: ImportArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let stop = Stop::default();
    interrupt::raise_on_signal(stop.clone()).context("cannot wait for signals")?;
    let read = ReadOptions::for_frames(args.max_frame_bytes);
    let opened = pictures::open_all(&args.inputs, &read, &args.pictures.options());
    let inputs = opened.map_err(|error| match error {
        BagError::Pictures(error) if error.is_usage() => usage(error),
        error => error.into(),
    })?;
    let notes: Vec<_> = inputs.iter().flat_map(BagReader::notes).cloned().collect();
    // Pictures are compressed already, or large: disks write faster than processors compress.
    let options = RecordOptions { compression: Compression::None, force: args.force };
    let total = inputs.first().and_then(BagReader::num_pictures);
    let bar = progress_bar(total, "pictures");
    let imported = import(&inputs, &args.output, options, &mut |num| {
        bar.set_position(num);
        !stop.is_raised()
    });
    bar.finish_and_clear();
    let imported = imported?;
    output::print(
        out,
        &if args.json { json_of(&imported, &notes) } else { text_of(&imported, &notes) },
    )?;
    let num_lost = imported.num_left_out + u64::from(imported.was_interrupted);
    Ok(Outcome::with_losses(num_lost))
}

fn json_of(imported: &Imported, notes: &[String]) -> String {
    let object = json!({
        "output": imported.output.directory,
        "bytes": imported.output.bytes,
        "pictures": imported.num_pictures,
        "left_out": imported.num_left_out,
        "reasons": imported.left_out,
        "interrupted": imported.was_interrupted,
        "notes": notes,
    });
    format!("{object}\n")
}

fn text_of(imported: &Imported, notes: &[String]) -> String {
    let notes = notes.iter().map(|note| format!("note: {note}"));
    let reasons = imported.left_out.iter().map(|reason| format!("left out: {reason}"));
    let Imported { output, num_pictures, num_left_out, .. } = imported;
    let left_out =
        if *num_left_out > 0 { format!(", {num_left_out} left out") } else { String::new() };
    let (place, size) = (output.directory.display(), bytes(output.bytes));
    let interrupted = imported.was_interrupted.then_some(INTERRUPTED.to_owned());
    let last = format!("{place}: {num_pictures} pictures ({size}){left_out}\n");
    notes.chain(reasons).chain(interrupted).chain([last]).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bag::RecordSummary;

    fn imported() -> Imported {
        let output = RecordSummary {
            directory: "bag".into(),
            file: "bag/bag_0.mcap".into(),
            topics: Vec::new(),
            messages: 3,
            bytes: 1000,
        };
        let (num_left_out, left_out) = (1, vec!["a.png: is empty".to_owned()]);
        Imported { output, num_pictures: 3, num_left_out, left_out, was_interrupted: true }
    }

    #[test]
    fn an_interruption_is_told() {
        let json = |imported: &Imported| {
            serde_json::from_str::<serde_json::Value>(&json_of(imported, &[])).unwrap()
        };
        for was_interrupted in [true, false] {
            let imported = Imported { was_interrupted, ..imported() };
            assert_eq!(json(&imported)["interrupted"], was_interrupted);
            assert_eq!(text_of(&imported, &[]).contains(INTERRUPTED), was_interrupted);
        }
    }

    #[test]
    fn every_key_is_documented() {
        let json: serde_json::Value = serde_json::from_str(&json_of(&imported(), &[])).unwrap();
        let (_, documented) = HELP.split_once("--json prints").unwrap();
        for key in json.as_object().unwrap().keys() {
            assert!(documented.contains(key.as_str()), "{key}");
        }
    }
}
