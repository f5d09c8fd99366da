//! `laser_profiler recover`: copies the readable part of a damaged bag.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use serde_json::json;

use super::{Outcome, output, units::bytes};
use crate::bag::Compression;
use crate::bag::recover::{RecoverOptions, Recovery, recover};
use crate::msg::printable::line;

/// Copies everything readable from a damaged bag into a new bag.
///
/// Keeps all topics with the metadata of their channels, messages, attachments and metadata. Skips missing files and damaged chunks and continues at the next
/// valid one. Decompresses files (.mcap.zstd) and messages that are compressed one by one. The exit code is 3 if anything
/// is not in the new bag; the summary names it.
#[derive(Debug, Args)]
#[command(after_long_help = HELP)]
pub(crate) struct RecoverArgs {
    /// A rosbag2 directory, or an .mcap or .mcap.zstd file.
    pub(crate) bag: PathBuf,
    /// Directory of the new bag.
    #[arg(short, long)]
    pub(crate) output: PathBuf,
    /// Compression of the new bag. Default: that of the input.
    #[arg(long)]
    pub(crate) compression: Option<CompressionName>,
    /// Replace an existing bag.
    #[arg(long)]
    pub(crate) force: bool,
    /// One JSON object on standard output (see below).
    #[arg(long)]
    pub(crate) json: bool,
}

/// Compression of the new bag's chunks.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum CompressionName {
    /// No compression.
    None,
    /// LZ4.
    Lz4,
    /// Zstandard, level 1.
    Zstd,
}

const HELP: &str = "\
Example:
  laser_profiler recover cut_off.mcap -o recovered

--json prints one object:
  output, bytes, messages, topics: {name: count}, attachments, metadata (numbers of records)
  damaged:  [{file, offset, end, what}]; offsets in bytes from the start of the file, decompressed
  left_out: [text]; whatever else is not in the new bag
  notes:    [text]; also what is written otherwise: messages of other systems, quality of service of older versions";

/// Recovers a bag and prints a summary on `out`.
///
/// # Errors
/// The input is not a bag, or the output cannot be written. A closed pipe is not an error.
pub(crate) fn run(args: &RecoverArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let compression = args.compression.map(|name| match name {
        CompressionName::None => Compression::None,
        CompressionName::Lz4 => Compression::Lz4,
        CompressionName::Zstd => Compression::Zstd,
    });
    let options = RecoverOptions { compression, force: args.force };
    let recovery = recover(&args.bag, &args.output, options)?;
    let printed = if args.json { print_json(&recovery, out) } else { print_text(&recovery, out) };
    output::printed(printed)?;
    Ok(if recovery.is_complete() { Outcome::Done } else { Outcome::DataLost })
}

fn print_json(recovery: &Recovery, out: &mut dyn Write) -> io::Result<()> {
    let topics: std::collections::BTreeMap<_, _> = recovery.output.topics.iter().cloned().collect();
    let object = json!({
        "output": recovery.output.directory,
        "bytes": recovery.output.bytes,
        "messages": recovery.output.messages,
        "topics": topics,
        "attachments": recovery.num_attachments,
        "metadata": recovery.num_metadata,
        "damaged": recovery.damaged,
        "left_out": recovery.left_out,
        "notes": recovery.notes,
    });
    serde_json::to_writer_pretty(&mut *out, &object)?;
    writeln!(out)?;
    out.flush()
}

fn print_text(recovery: &Recovery, out: &mut dyn Write) -> io::Result<()> {
    let output = &recovery.output;
    for (topic, count) in &output.topics {
        writeln!(out, "{}: {count} messages", line(topic))?;
    }
    for range in &recovery.damaged {
        writeln!(out, "skipped {}", line(&range.to_string()))?;
    }
    for what in &recovery.left_out {
        writeln!(out, "left out {}", line(what))?;
    }
    for note in &recovery.notes {
        writeln!(out, "note: {}", line(note))?;
    }
    let (messages, attachments, metadata) =
        (output.messages, recovery.num_attachments, recovery.num_metadata);
    writeln!(
        out,
        "recovered {messages} messages, {attachments} attachments, {metadata} metadata records into {} ({})",
        output.directory.display(),
        bytes(output.bytes)
    )?;
    out.flush()
}
