//! `laser_profiler info`: contents of a bag.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;

use super::{Outcome, output, units::bytes};
use crate::bag::images::ImageInfo;
use crate::bag::info::{BagInfo, Depth, TopicInfo, describe};
use crate::bag::{ReadOptions, pictures};
use crate::msg::printable::line;
use crate::report::date::date;

/// Lists the contents of a bag: topics, types, counts, rates, gaps, sizes, calibration, parameters.
///
/// Reads only the index if it is intact; `--verify` reads every message and checks every checksum. A truncated or
/// damaged bag is read completely, and the exit code is 3.
#[derive(Debug, Args)]
#[command(after_long_help = HELP)]
pub(crate) struct InfoArgs {
    /// A rosbag2 directory, or an .mcap or .mcap.zstd file; a folder of pictures, a picture or a video, as `replay` reads them.
    pub(crate) bag: PathBuf,
    /// One JSON object on standard output (see below).
    #[arg(long)]
    pub(crate) json: bool,
    /// Reads every message: sizes by topic, skipped messages, checksums.
    #[arg(long)]
    pub(crate) verify: bool,
}

const HELP: &str = "\
Examples:
  laser_profiler info my_recording
  laser_profiler info results/results_0.mcap --json | jq .topics

--json prints one object:
  path, bytes, start_ns, end_ns (null without messages), duration_s, stamps_assumed (true for pictures without stamps: all
  times are those of an assumed rate), messages, verified (true if every message was read)
  files:       [{path, bytes, indexed, compression: [\"none\"|\"lz4\"|\"zstd\" (chunks), \"zstd messages\", \"zstd file\"]}]
  topics:      [{name, type, encoding, type_hash, messages, rate_hz, largest_gap_s, largest_gap_at_ns,
                skipped (by the writer's counter), bytes,
                image: {encoding, width, height, stamp_rate_hz, problem}}]; rate and gap null when there are too few
                messages or stamps are assumed, skipped and bytes null unless verified; image null for other types. It is that of the first
                message; stamp_rate_hz is null if the stamps do not advance or are assumed, problem says why it cannot be measured
  attachments: [{name, media_type, bytes, sha256}]
  metadata:    {record: {key: text}}; `laser_profiler` holds version, parameters, parameters_sha256
  damaged:     [{file, offset, end, what}]; offsets in bytes from the start of the file, decompressed; both 0 for a
               missing file
  notes:       [text]";

/// Prints the description on `out`.
///
/// # Errors
/// The bag cannot be opened. A closed pipe is not an error.
pub(crate) fn run(args: &InfoArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let bag = pictures::open(&args.bag, &ReadOptions::default())?;
    let depth = if args.verify { Depth::Messages } else { Depth::Index };
    let info = describe(&args.bag, &bag, depth)?;
    let printed = if args.json { print_json(&info, out) } else { print_text(&info, out) };
    output::printed(printed)?;
    Ok(if info.damaged.is_empty() { Outcome::Done } else { Outcome::DataLost })
}

fn print_json(info: &BagInfo, out: &mut dyn Write) -> io::Result<()> {
    serde_json::to_writer_pretty(&mut *out, info)?;
    writeln!(out)?;
    out.flush()
}

fn print_text(info: &BagInfo, out: &mut dyn Write) -> io::Result<()> {
    writeln!(out, "Bag         {}  {}", info.path.display(), bytes(info.bytes))?;
    for file in &info.files {
        let compression = file.compression.join("+");
        let index = if file.indexed { "" } else { "  no index" };
        writeln!(
            out,
            "  file      {}  {}  {compression}{index}",
            file.path.display(),
            bytes(file.bytes)
        )?;
    }
    if let Some(start_ns) = info.start_ns.filter(|_| !info.stamps_assumed) {
        writeln!(
            out,
            "Start       {}  ({}.{:09} s)",
            date(start_ns),
            start_ns / NS,
            start_ns % NS
        )?;
    }
    if info.stamps_assumed {
        writeln!(out, "Duration    unknown: no stamps")?;
    } else {
        writeln!(out, "Duration    {:.3} s", info.duration_s)?;
    }
    let how = if info.verified { "all read" } else { "from the index" };
    writeln!(out, "Messages    {}  ({how})", info.messages)?;
    print_topics(&info.topics, out)?;
    print_images(info, out)?;
    for attachment in &info.attachments {
        let (name, media_type, size) =
            (line(&attachment.name), line(&attachment.media_type), bytes(attachment.bytes));
        writeln!(out, "Attachment  {name}  {media_type}  {size}  sha256 {}", attachment.sha256)?;
    }
    for (name, entries) in &info.metadata {
        writeln!(out, "Metadata    {}", line(name))?;
        // Short texts first, so that version and origin are not lost behind a hundred parameters.
        let (long, short): (Vec<_>, Vec<_>) =
            entries.iter().partition(|(_, text)| text.trim_end().contains('\n'));
        for (key, text) in short.into_iter().chain(long) {
            let text = text.trim_end().replace('\n', "\n    ");
            let separator = if text.contains('\n') { "\n    " } else { " " };
            writeln!(out, "  {}:{separator}{text}", line(key))?;
        }
    }
    for range in &info.damaged {
        writeln!(out, "Damaged     {}", line(&range.to_string()))?;
    }
    for note in &info.notes {
        writeln!(out, "Note        {}", line(note))?;
    }
    out.flush()
}

const NS: i64 = 1_000_000_000;

fn print_topics(topics: &[TopicInfo], out: &mut dyn Write) -> io::Result<()> {
    let heads =
        ["Topic", "Type", "Messages", "Hz", "Largest gap", "Skipped", "Size"].map(String::from);
    let number = |value: Option<f64>, unit: &str| {
        value.map_or("-".into(), |value| format!("{value:.3}{unit}"))
    };
    let mut rows = vec![heads];
    rows.extend(topics.iter().map(|topic| {
        [
            line(&topic.name).into_owned(),
            line(&topic.type_name).into_owned(),
            topic.messages.to_string(),
            number(topic.rate_hz, ""),
            number(topic.largest_gap_s, " s"),
            topic.skipped.map_or("-".into(), |skipped| skipped.to_string()),
            topic.bytes.map_or("-".into(), bytes),
        ]
    }));
    let width =
        |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<_> = (0..rows[0].len()).map(width).collect();
    writeln!(out)?;
    for row in &rows {
        let cells = row.iter().zip(&widths).enumerate().map(|(column, (cell, &width))| {
            if column < 2 { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
        });
        writeln!(out, "{}", cells.collect::<Vec<_>>().join("  ").trim_end())?;
    }
    writeln!(out)
}

fn print_images(info: &BagInfo, out: &mut dyn Write) -> io::Result<()> {
    let no_rate = if info.stamps_assumed { "  no stamps" } else { "  stamps do not advance" };
    let images = info.topics.iter().filter_map(|topic| Some((&topic.name, topic.image.as_ref()?)));
    let mut has_any = false;
    for (name, image) in images {
        let ImageInfo { encoding, width, height, stamp_rate_hz, problem } = image;
        let size = width.zip(*height).map_or(String::new(), |(w, h)| format!("  {w} x {h} px"));
        let rate = stamp_rate_hz
            .map_or_else(|| no_rate.to_owned(), |rate| format!("  {rate:.3} Hz by the stamps"));
        let encoding = if encoding.is_empty() { "no encoding".into() } else { line(encoding) };
        let name = line(name);
        writeln!(out, "Images      {name}  {encoding}{size}{rate}")?;
        if let Some(problem) = problem {
            writeln!(out, "  not measurable: {}", line(problem))?;
        }
        has_any = true;
    }
    if has_any { writeln!(out) } else { Ok(()) }
}
