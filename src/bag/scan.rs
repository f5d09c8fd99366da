//! Scans a file without its index and resynchronizes after damage.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use mcap::records::op;

use super::channels::Channels;
use super::chunk::ChunkDecoder;
use super::error::Fault;
use super::fields::Fields;
use super::format::{
    CHUNK_START_BYTES, ChunkHeader, MessageHeader, PREFIX_BYTES, RecordSpan, Source, u32_at,
};
use super::layout::{Layout, Part, PartKind};
use super::{BagError, content};

/// Bytes searched at a time for the next chunk.
const SEARCH_BLOCK_BYTES: u64 = 1 << 20;
/// Bytes of a `DataEnd` record: opcode, length, checksum.
const DATA_END_BYTES: u64 = PREFIX_BYTES + 4;
/// A `DataEnd` record up to its checksum.
const DATA_END: [u8; PREFIX_BYTES as usize] = [op::DATA_END, 4, 0, 0, 0, 0, 0, 0, 0];

/// Returns the profile in the file's header record; empty if there is no such record.
pub(super) fn profile(source: &mut Source) -> Result<String, BagError> {
    let first = match source.record_at(mcap::MAGIC.len() as u64) {
        Err(Fault::Io(error)) => return Err(error),
        Err(Fault::Malformed(_)) => None,
        Ok(first) => first,
    };
    if let Some(span) = first
        && span.opcode == op::HEADER
        && source.check_length(&span, span.end - span.offset).is_ok()
    {
        return Ok(Fields::of(&source.body(&span)?).string().unwrap_or_default());
    }
    Ok(String::new())
}

/// Returns the layout of a file from a scan of all records, which opens every chunk. After damage it searches for the
/// next chunk or the end of the data; loose messages, attachments and metadata in between are lost.
pub(super) fn scan(source: &mut Source, channels: Channels) -> Result<Layout, BagError> {
    let layout = Layout { channels, ..Layout::default() };
    let decoder = ChunkDecoder::new(source.limit_bytes);
    let mut scan = Scan { source, decoder, layout, counts: BTreeMap::new(), suspect: None };
    let mut offset = mcap::MAGIC.len() as u64;
    while let Some(next) = scan.step(offset)? {
        offset = next;
    }
    scan.layout.counts = Some(scan.counts);
    if scan.layout.unknown_bytes > 0 {
        let (path, bytes) = (scan.source.path.display(), scan.layout.unknown_bytes);
        scan.layout.notes.push(format!("{path}: ignored {bytes} bytes of unknown record types"));
    }
    scan.layout.sort();
    Ok(scan.layout)
}

struct Scan<'a> {
    source: &'a mut Source,
    decoder: ChunkDecoder,
    layout: Layout,
    counts: BTreeMap<u16, u64>,
    /// The last record, if only the next one can confirm its length.
    suspect: Option<Suspect>,
}

/// True for the records that a chunk may contain.
fn is_content(opcode: u8) -> bool {
    matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE)
}

struct Suspect {
    offset: u64,
    /// Channel if the record is a message.
    channel: Option<u16>,
}

impl Scan<'_> {
    /// Takes the record at `offset`. Returns the offset at which to continue, `None` after the last record.
    fn step(&mut self, offset: u64) -> Result<Option<u64>, BagError> {
        let span = match self.source.record_at(offset) {
            Ok(Some(span)) => span,
            Ok(None) => {
                let what = "the file was not finished: messages not yet written are missing";
                self.damage(offset, offset, what.into());
                return Ok(None);
            }
            Err(Fault::Malformed(what)) => return self.malformed(offset, what),
            Err(Fault::Io(error)) => return Err(error),
        };
        if span.opcode == op::CHUNK {
            return match self.source.chunk_at(offset) {
                Ok(chunk) => self.chunk(&chunk),
                Err(Fault::Malformed(what)) => self.malformed(offset, what),
                Err(Fault::Io(error)) => Err(error),
            };
        }
        if let Err(BagError::Damaged { what, .. }) = self.source.check_length(&span, 0) {
            if is_content(span.opcode) && span.end - offset <= self.source.limit_bytes {
                // The end of the file cuts this record off, so the length of the one before was right.
                self.suspect = None;
            }
            return self.resume_behind(offset, what);
        }
        if span.opcode == op::DATA_END && span.end - span.offset == DATA_END_BYTES {
            return Ok(None);
        }
        match self.record(&span) {
            Err(BagError::Damaged { what, .. }) => self.resume_behind(offset, what),
            Err(error) => Err(error),
            Ok(()) => Ok(Some(span.end)),
        }
    }

    /// Continues after a malformed record: inside a chunk whose header was never filled in, else behind it.
    fn malformed(&mut self, offset: u64, what: String) -> Result<Option<u64>, BagError> {
        let Some(content) = self.source.open_chunk_at(offset)? else {
            if self.source.ends_in_prefix_of(offset, is_content)? {
                self.suspect = None;
            }
            return self.resume_behind(offset, what);
        };
        let path = self.source.path.display();
        self.layout.notes.push(format!(
            "{path}: the chunk at byte {offset} was not finished; its complete messages are read"
        ));
        self.suspect = None;
        Ok(Some(content))
    }

    fn record(&mut self, span: &RecordSpan) -> Result<(), BagError> {
        self.suspect = Some(Suspect { offset: span.offset, channel: None });
        match span.opcode {
            op::MESSAGE => {
                let body = self.source.body(span)?;
                let Some((header, _)) = MessageHeader::split(&body) else {
                    return Err(self
                        .source
                        .damaged(span, "a message record shorter than its header".into()));
                };
                // No checksum protects the opcodes of the records after a chunk: one flipped bit turns an index
                // into a message.
                let is_behind_chunk = self
                    .layout
                    .parts
                    .last()
                    .is_some_and(|part| matches!(part.kind, PartKind::Chunk));
                if is_behind_chunk && u32_at(&body, 2) as usize + 6 == body.len() {
                    let what = "a message index with the opcode of a message";
                    return Err(self.source.damaged(span, what.into()));
                }
                self.suspect = Some(Suspect { offset: span.offset, channel: Some(header.channel) });
                *self.counts.entry(header.channel).or_default() += 1;
                match self.layout.parts.last_mut() {
                    Some(part)
                        if matches!(part.kind, PartKind::Loose) && part.end == span.offset =>
                    {
                        part.end = span.end;
                        part.end_time = part.end_time.max(header.log_time);
                    }
                    _ => self.part(PartKind::Loose, span, header.log_time..=header.log_time),
                }
            }
            op::SCHEMA | op::CHANNEL => {
                let body = self.source.body(span)?;
                self.layout
                    .channels
                    .add(span.opcode, &body)
                    .map_err(|what| self.source.damaged(span, what))?;
            }
            op::ATTACHMENT => {
                let body = self.source.body(span)?;
                content::attachment(&body).map_err(|what| self.source.damaged(span, what))?;
                self.layout.attachments.push(*span);
                self.suspect = None;
            }
            op::METADATA => {
                let body = self.source.body(span)?;
                content::metadata(&body).map_err(|what| self.source.damaged(span, what))?;
                self.layout.metadata.push(*span);
                self.suspect = None;
            }
            // A chunk with a damaged opcode must not be taken for a message index.
            op::MESSAGE_INDEX => self.check_message_index(span)?,
            op::HEADER if span.offset == mcap::MAGIC.len() as u64 => {}
            0x80.. => self.layout.unknown_bytes += span.end - span.offset,
            opcode => {
                return Err(self.source.damaged(
                    span,
                    format!("a record with opcode {opcode:#04x} in the data section"),
                ));
            }
        }
        Ok(())
    }

    /// Checks that a message index consists of a channel, a length, and as many bytes as the length states.
    fn check_message_index(&mut self, span: &RecordSpan) -> Result<(), BagError> {
        let body_bytes = span.end - span.offset - PREFIX_BYTES;
        let mut start = [0; 6];
        if body_bytes >= 6 {
            self.source.read_exact_at(span.offset + PREFIX_BYTES, &mut start)?;
        }
        if u64::from(u32_at(&start, 2)).checked_add(6) != Some(body_bytes) {
            return Err(self
                .source
                .damaged(span, format!("a message index of {body_bytes} bytes")));
        }
        self.suspect = None;
        Ok(())
    }

    /// Reads the channels, counts and times of a chunk. Faults inside are reported when its messages are read.
    fn chunk(&mut self, chunk: &ChunkHeader) -> Result<Option<u64>, BagError> {
        let mut times: Option<RangeInclusive<u64>> = None;
        let (channels, counts) = (&mut self.layout.channels, &mut self.counts);
        let decoded = self.decoder.decode(self.source, chunk, &mut |opcode, body| {
            if opcode != op::MESSAGE {
                // A contradiction is reported when the messages are read.
                let _reported_later = channels.add(opcode, body);
            } else if let Some((header, _)) = MessageHeader::split(body) {
                *counts.entry(header.channel).or_default() += 1;
                let time = header.log_time;
                let (first, last) = times.take().map_or((time, time), RangeInclusive::into_inner);
                times = Some(first.min(time)..=last.max(time));
            }
        });
        if let Err(error @ BagError::Io { .. }) = decoded {
            return Err(error);
        }
        self.suspect = None;
        if !self.layout.compressions.contains(&chunk.compression) {
            self.layout.compressions.push(chunk.compression.clone());
        }
        let times = times.unwrap_or(chunk.start_time..=chunk.start_time);
        self.part(PartKind::Chunk, &chunk.span, times);
        Ok((chunk.span.end <= self.source.len_bytes).then_some(chunk.span.end))
    }

    fn part(&mut self, kind: PartKind, span: &RecordSpan, times: RangeInclusive<u64>) {
        let (start_time, end_time) = times.into_inner();
        let (offset, end, message_indexes) = (span.offset, span.end, Vec::new());
        let part = Part { kind, offset, end, start_time, end_time, message_indexes };
        self.layout.parts.push(part);
    }

    /// Notes damage at the start time of the preceding part.
    fn damage(&mut self, offset: u64, end: u64, what: String) {
        let start_time = self.layout.parts.last().map_or(0, |part| part.start_time);
        let span = RecordSpan { opcode: 0, offset, end };
        self.part(PartKind::Damage(what), &span, start_time..=start_time);
    }

    /// Notes damage from `offset` to the next chunk or end of the data. Returns where that begins.
    fn resume_behind(&mut self, offset: u64, what: String) -> Result<Option<u64>, BagError> {
        let offset = self.drop_suspect().unwrap_or(offset);
        let next = self.find_landmark(offset + 1)?;
        self.damage(offset, next.unwrap_or(self.source.len_bytes), what);
        Ok(next)
    }

    /// Removes the last record, whose length was wrong. Returns its start.
    fn drop_suspect(&mut self) -> Option<u64> {
        let Suspect { offset, channel } = self.suspect.take()?;
        if let (Some(channel), Some(part)) = (channel, self.layout.parts.last_mut()) {
            part.end = offset;
            self.counts.entry(channel).and_modify(|count| *count -= 1);
            self.layout.parts.pop_if(|part| part.offset == part.end);
        }
        Some(offset)
    }

    fn find_landmark(&mut self, from: u64) -> Result<Option<u64>, BagError> {
        let mut block = vec![0; (SEARCH_BLOCK_BYTES + CHUNK_START_BYTES) as usize];
        let mut start = from;
        while start < self.source.len_bytes {
            let length = (self.source.len_bytes - start).min(block.len() as u64) as usize;
            self.source.read_exact_at(start, &mut block[..length])?;
            block[length..].fill(0);
            let searched = length.min(SEARCH_BLOCK_BYTES as usize);
            if let Some(at) =
                (0..searched).find(|&at| self.is_landmark(&block[at..], start + at as u64))
            {
                return Ok(Some(start + at as u64));
            }
            start += searched as u64;
        }
        Ok(None)
    }

    fn is_landmark(&self, bytes: &[u8], offset: u64) -> bool {
        match bytes[0] {
            op::CHUNK => bytes.first_chunk().is_some_and(|start| {
                ChunkHeader::parse(start, offset).is_ok_and(|chunk| {
                    chunk.uncompressed_bytes <= self.source.limit_bytes
                        && chunk.start_time <= chunk.end_time
                })
            }),
            op::DATA_END => bytes.starts_with(&DATA_END),
            _ => false,
        }
    }
}
