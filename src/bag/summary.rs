//! The index at the end of a finished file, used only if its checksum matches.

use std::collections::BTreeMap;
use std::ops::Range;

use mcap::records::{Record, Statistics, op};

use super::BagError;
use super::channels::Channels;
use super::error::Fault;
use super::fields::Fields;
use super::format::{PREFIX_BYTES, RecordSpan, Source, u32_at, u64_at};

/// Bytes of the footer record and the magic after it.
const END_BYTES: u64 = PREFIX_BYTES + 20 + 8;

/// The summary section of a file.
#[derive(Debug, Default)]
pub(super) struct Summary {
    pub(super) channels: Channels,
    pub(super) chunks: Vec<ChunkIndex>,
    pub(super) attachments: Vec<RecordSpan>,
    pub(super) metadata: Vec<RecordSpan>,
    pub(super) statistics: Option<Statistics>,
}

/// Position and content of a chunk.
#[derive(Debug)]
pub(super) struct ChunkIndex {
    pub(super) span: RecordSpan,
    pub(super) start_time: u64,
    pub(super) end_time: u64,
    pub(super) message_indexes: BTreeMap<u16, u64>,
    pub(super) compression: String,
}

/// Reads the file's summary.
pub(super) fn read(source: &mut Source) -> Result<Summary, Fault> {
    let Range { start: mut offset, end } = find(source)?;
    let mut summary = Summary::default();
    while offset < end {
        let span = match source.record_at(offset) {
            Ok(Some(span)) if span.end <= end => span,
            Err(Fault::Io(error)) => return Err(error.into()),
            _ => return Err(format!("the summary is unreadable at byte {offset}").into()),
        };
        let body = match source.body(&span) {
            Err(BagError::Damaged { what, .. }) => return Err(what.into()),
            body => body?,
        };
        summary
            .add(span.opcode, &body)
            .map_err(|why| format!("the summary is unreadable at byte {offset}: {why}"))?;
        offset = span.end;
    }
    for records in [&mut summary.attachments, &mut summary.metadata] {
        require_apart(records)?;
    }
    Ok(summary)
}

/// Refuses records that are listed twice or within each other: a small file could state any amount of content.
fn require_apart(records: &mut [RecordSpan]) -> Result<(), String> {
    records.sort_by_key(|span| span.offset);
    match records.array_windows().find(|[one, next]| next.offset < one.end) {
        Some([_, next]) => {
            Err(format!("the index lists a record at byte {} within another", next.offset))
        }
        None => Ok(()),
    }
}

impl Summary {
    fn add(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
        let mut fields = Fields::of(body);
        let ill_formed = || format!("malformed record with opcode {opcode:#04x}");
        match opcode {
            op::SCHEMA | op::CHANNEL => self.channels.add(opcode, body)?,
            op::CHUNK_INDEX => self.chunks.push(chunk_index(&mut fields).ok_or_else(ill_formed)?),
            op::ATTACHMENT_INDEX => {
                self.attachments.push(span(&mut fields, op::ATTACHMENT).ok_or_else(ill_formed)?);
            }
            op::METADATA_INDEX => {
                self.metadata.push(span(&mut fields, op::METADATA).ok_or_else(ill_formed)?);
            }
            op::STATISTICS => match mcap::parse_record(opcode, body) {
                Ok(Record::Statistics(statistics)) => self.statistics = Some(statistics),
                _ => return Err(ill_formed()),
            },
            _ => {}
        }
        Ok(())
    }
}

fn span(fields: &mut Fields<'_>, opcode: u8) -> Option<RecordSpan> {
    let (offset, length) = (fields.u64()?, fields.u64()?);
    Some(RecordSpan { opcode, offset, end: offset.checked_add(length)? })
}

fn chunk_index(fields: &mut Fields<'_>) -> Option<ChunkIndex> {
    let (start_time, end_time) = (fields.u64()?, fields.u64()?);
    let span = span(fields, op::CHUNK)?;
    let message_indexes = fields.channel_map()?;
    let _message_indexes_bytes = fields.u64()?;
    Some(ChunkIndex { span, start_time, end_time, message_indexes, compression: fields.string()? })
}

/// Returns the range of the summary before the footer if footer, magic and checksum are valid.
fn find(source: &mut Source) -> Result<Range<u64>, Fault> {
    let unfinished = || "the file was not finished".to_owned();
    let footer_offset = source.len_bytes.checked_sub(END_BYTES).ok_or_else(unfinished)?;
    let mut end = [0; END_BYTES as usize];
    source.read_exact_at(footer_offset, &mut end)?;
    if !end.ends_with(mcap::MAGIC) || end[0] != op::FOOTER || u64_at(&end, 1) != 20 {
        return Err(unfinished().into());
    }
    let (summary_start, saved) = (u64_at(&end, 9), u32_at(&end, 25));
    if summary_start == 0 {
        return Err("the file has no summary".to_owned().into());
    }
    if summary_start > footer_offset {
        return Err(format!("the footer puts the summary at byte {summary_start}").into());
    }
    if saved != 0 && saved != checksum(source, summary_start, footer_offset + PREFIX_BYTES + 16)? {
        return Err("the checksum of the summary is wrong".to_owned().into());
    }
    Ok(summary_start..footer_offset)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_within_each_other_are_refused() {
        let spans = |ranges: &[(u64, u64)]| {
            let span = |&(offset, end)| RecordSpan { opcode: op::METADATA, offset, end };
            require_apart(&mut ranges.iter().map(span).collect::<Vec<_>>())
        };
        assert_eq!(spans(&[]), Ok(()));
        assert_eq!(spans(&[(50, 60), (10, 20), (20, 30)]), Ok(()));
        for ranges in [&[(10, 20), (10, 20)][..], &[(10, 90), (50, 60)], &[(50, 60), (10, 51)]] {
            assert!(spans(ranges).unwrap_err().contains("within another"), "{ranges:?}");
        }
    }
}
