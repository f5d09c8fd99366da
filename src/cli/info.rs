//! `laser_profiler info`: what a bag holds.

use std::io::{self, Write};
use std::path::PathBuf;

use anyhow::Context;
use clap::Args;

use super::Outcome;
use crate::bag::info::{BagInfo, Depth, TopicInfo, describe};
use crate::bag::{BagReader, ReadOptions};

/// Tells what a bag holds: topics, types, counts, rates, gaps, sizes, calibration, parameters.
///
/// A bag with a sound index is not read further; `--verify` reads every message and tests every checksum. A bag
/// that was cut short or is damaged is read from end to end, and the exit code is 3.
#[derive(Debug, Args)]
#[command(after_long_help = HELP)]
pub struct InfoArgs {
    /// A rosbag2 directory or an .mcap file.
    pub bag: PathBuf,
    /// One JSON object on standard output (see below).
    #[arg(long)]
    pub json: bool,
    /// Reads every message: sizes by topic, skipped messages, checksums.
    #[arg(long)]
    pub verify: bool,
}

const HELP: &str = "\
Examples:
  laser_profiler info my_recording
  laser_profiler info results/results_0.mcap --json | jq .topics

--json prints one object:
  path, bytes, start_ns, end_ns (null without messages), duration_s, messages, verified (every message was read)
  files:       [{path, bytes, indexed, compression: [\"none\"|\"lz4\"|\"zstd\"]}]
  topics:      [{name, type, encoding, type_hash, messages, rate_hz, largest_gap_s, largest_gap_at_ns,
                skipped (by the writer's counter), bytes}]; rate and gap null when there are too few messages,
                skipped and bytes null unless verified
  attachments: [{name, media_type, bytes, sha256}]
  metadata:    {record: {key: text}}; `laser_profiler` holds version, parameters, parameters_sha256
  damaged:     [{file, offset, end, what}]; offsets in bytes from the start of the file
  notes:       [text]";

/// Prints the description on `out`.
///
/// # Errors
/// A bag that cannot be opened. A reader of `out` that goes away is no error.
pub fn run(args: &InfoArgs, out: &mut dyn Write) -> anyhow::Result<Outcome> {
    let bag = BagReader::open(&args.bag, &ReadOptions::default())?;
    let depth = if args.verify { Depth::Messages } else { Depth::Index };
    let info = describe(&args.bag, &bag, depth)?;
    let printed = if args.json { print_json(&info, out) } else { print_text(&info, out) };
    super::quiet_pipe(printed).context("standard output")?;
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
    if let Some(start_ns) = info.start_ns {
        writeln!(
            out,
            "Start       {}  ({}.{:09} s)",
            date(start_ns),
            start_ns / NS,
            start_ns % NS
        )?;
    }
    writeln!(out, "Duration    {:.3} s", info.duration_s)?;
    let how = if info.verified { "every one read" } else { "by the index" };
    writeln!(out, "Messages    {}  ({how})", info.messages)?;
    print_topics(&info.topics, out)?;
    for attachment in &info.attachments {
        let (name, media_type, size) =
            (&attachment.name, &attachment.media_type, bytes(attachment.bytes));
        writeln!(out, "Attachment  {name}  {media_type}  {size}  sha256 {}", attachment.sha256)?;
    }
    for (name, entries) in &info.metadata {
        writeln!(out, "Metadata    {name}")?;
        // Short texts first: version and origin would be lost behind a hundred parameters.
        let (long, short): (Vec<_>, Vec<_>) =
            entries.iter().partition(|(_, text)| text.trim_end().contains('\n'));
        for (key, text) in short.into_iter().chain(long) {
            let text = text.trim_end().replace('\n', "\n    ");
            let separator = if text.contains('\n') { "\n    " } else { " " };
            writeln!(out, "  {key}:{separator}{text}")?;
        }
    }
    for range in &info.damaged {
        writeln!(
            out,
            "Damaged     {}: bytes {} to {}: {}",
            range.file.display(),
            range.offset,
            range.end,
            range.what
        )?;
    }
    for note in &info.notes {
        writeln!(out, "Note        {note}")?;
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
            topic.name.clone(),
            topic.type_name.clone(),
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

/// A length with three digits and a binary unit.
pub(super) fn bytes(length: u64) -> String {
    const UNITS: [&str; 5] = ["KiB", "MiB", "GiB", "TiB", "PiB"];
    if length < 1024 {
        return format!("{length} B");
    }
    let mut value = length as f64 / 1024.0;
    let mut unit = 0;
    while value >= 1000.0 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    let digits = if value < 10.0 { 2 } else { 1 };
    format!("{value:.digits$} {}", UNITS[unit])
}

/// The time in UTC, as in `2018-07-18 08:00:00`.
pub(super) fn date(time_ns: i64) -> String {
    let seconds = time_ns.div_euclid(NS);
    let (days, second) = (seconds.div_euclid(86_400), seconds.rem_euclid(86_400));
    // Days since 0000-03-01 in eras of 400 years: H. Hinnant, "chrono-compatible low-level date algorithms".
    let shifted = days + 719_468;
    let (era, day_of_era) = (shifted.div_euclid(146_097), shifted.rem_euclid(146_097));
    let year_of_era =
        (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month_from_march = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month_from_march + 2) / 5 + 1;
    let month = if month_from_march < 10 { month_from_march + 3 } else { month_from_march - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    format!(
        "{year:04}-{month:02}-{day:02} {:02}:{:02}:{:02} UTC",
        second / 3600,
        second / 60 % 60,
        second % 60
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        // From `date -u -d @…`.
        assert_eq!(date(1_531_900_000_980_000_000), "2018-07-18 07:46:40 UTC");
        assert_eq!(date(951_782_400 * NS), "2000-02-29 00:00:00 UTC");
        assert_eq!(date(-NS), "1969-12-31 23:59:59 UTC");
    }

    #[test]
    fn lengths_have_a_unit() {
        let lengths = [0, 1023, 1024, 1_000_000, 60_644_376, u64::MAX].map(bytes);
        assert_eq!(lengths, ["0 B", "1023 B", "1.00 KiB", "976.6 KiB", "57.8 MiB", "16384.0 PiB"]);
    }
}
