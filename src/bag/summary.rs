//! The index at the end of a finished file, believed only when its checksum fits.

use std::io::SeekFrom;

use mcap::records::op;
use mcap::sans_io::summary_reader::{SummaryReadEvent, SummaryReader, SummaryReaderOptions};

use super::BagError;
use super::format::{PREFIX_BYTES, Source, u32_at, u64_at};

/// A footer record and the magic behind it.
const END_BYTES: u64 = PREFIX_BYTES + 20 + 8;

/// The file's summary; in the inner error why there is none to use.
pub(super) fn read(source: &mut Source) -> Result<Result<mcap::Summary, String>, BagError> {
    if let Err(why) = check(source)? {
        return Ok(Err(why));
    }
    let options = SummaryReaderOptions::default()
        .with_file_size(source.len_bytes)
        .with_record_length_limit(usize::try_from(source.limit_bytes).unwrap_or(usize::MAX));
    let mut reader = SummaryReader::new_with_options(options);
    let mut position = 0;
    while let Some(event) = reader.next_event() {
        match event {
            Ok(SummaryReadEvent::SeekRequest(to)) => {
                position = match to {
                    SeekFrom::Start(offset) => offset,
                    SeekFrom::End(back) => source.len_bytes.saturating_add_signed(back),
                    SeekFrom::Current(by) => position.saturating_add_signed(by),
                };
                reader.notify_seeked(position);
            }
            Ok(SummaryReadEvent::ReadRequest(wanted_bytes)) => {
                let available =
                    source.len_bytes.saturating_sub(position).min(wanted_bytes as u64) as usize;
                source.read_exact_at(position, &mut reader.insert(wanted_bytes)[..available])?;
                reader.notify_read(available);
                position += available as u64;
            }
            Err(error) => return Ok(Err(format!("the summary is unreadable: {error}"))),
        }
    }
    Ok(reader.finish().ok_or_else(|| "it has no summary".into()))
}

/// Footer, magic and checksum of the summary.
fn check(source: &mut Source) -> Result<Result<(), String>, BagError> {
    let unfinished = || Ok(Err("it was not finished".into()));
    let Some(footer_offset) = source.len_bytes.checked_sub(END_BYTES) else { return unfinished() };
    let mut end = [0; END_BYTES as usize];
    source.read_exact_at(footer_offset, &mut end)?;
    if !end.ends_with(mcap::MAGIC) || end[0] != op::FOOTER || u64_at(&end, 1) != 20 {
        return unfinished();
    }
    let (summary_start, saved) = (u64_at(&end, 9), u32_at(&end, 25));
    if summary_start == 0 {
        return Ok(Err("it has no summary".into()));
    }
    if summary_start > footer_offset {
        return Ok(Err(format!("the footer puts the summary at byte {summary_start}")));
    }
    if saved != 0 {
        let calculated = checksum(source, summary_start, footer_offset + PREFIX_BYTES + 16)?;
        if calculated != saved {
            return Ok(Err("the checksum of the summary does not fit".into()));
        }
    }
    Ok(Ok(()))
}

fn checksum(source: &mut Source, start: u64, end: u64) -> Result<u32, BagError> {
    let mut hasher = crc32fast::Hasher::new();
    let mut block = vec![0; 64 << 10];
    let mut offset = start;
    while offset < end {
        let length = (end - offset).min(block.len() as u64) as usize;
        source.read_exact_at(offset, &mut block[..length])?;
        hasher.update(&block[..length]);
        offset += length as u64;
    }
    Ok(hasher.finalize())
}
