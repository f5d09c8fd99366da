//! Iterator over the messages of a bag in order of time. Memory holds one chunk and the chunks that overlap it in
//! time.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap, VecDeque};
use std::sync::Arc;

use mcap::records::op;

use super::channels::Channels;
use super::chunk::ChunkDecoder;
use super::error::Fault;
use super::format::{ChunkHeader, RecordSpan, Source};
use super::inflate::Inflater;
use super::layout::{Layout, Part, PartKind};
use super::open::Opener;
use super::pictures::SeriesMessages;
use super::plain::PlainReader;
use super::take::{Filter, MAX_CHUNK_MESSAGES, Taker};
use super::waiting::{Turn, Waiting};
use super::{BagError, RawMessage, scan};

/// Maximum number of recycled buffers kept for the next messages.
pub(super) const SPARE_BUFFERS: usize = 8;
/// Maximum number of distinct faults reported per chunk.
const MAX_FAULTS: usize = 8;

/// Iterator over the messages of a bag: file after file, within a file in order of `log_time_ns`, ties in order of
/// position. An error takes the place of the missing messages and describes one damaged range; iteration continues
/// after it.
pub struct Messages {
    files: VecDeque<(std::path::PathBuf, Arc<Layout>)>,
    filter: Filter,
    opener: Arc<Opener>,
    current: Option<FileMessages>,
    spare: Vec<Vec<u8>>,
    series: Option<SeriesMessages>,
}

impl Messages {
    /// Reads pictures or a video instead of files.
    pub(super) fn with_series(self, series: SeriesMessages) -> Self {
        Self { series: Some(series), ..self }
    }

    pub(super) fn new(
        files: impl IntoIterator<Item = (std::path::PathBuf, Arc<Layout>)>,
        filter: Filter,
        opener: Arc<Opener>,
    ) -> Self {
        Self {
            files: files.into_iter().collect(),
            filter,
            opener,
            current: None,
            spare: Vec::new(),
            series: None,
        }
    }

    /// Takes back the buffer of a processed message, to reuse it for a later one.
    pub(crate) fn recycle(&mut self, buffer: Vec<u8>) {
        if let Some(series) = &mut self.series {
            return series.recycle(buffer);
        }
        let spare = self.current.as_mut().map_or(&mut self.spare, |file| &mut file.spare);
        if spare.len() < SPARE_BUFFERS {
            spare.push(buffer);
        }
    }
}

impl Iterator for Messages {
    type Item = Result<RawMessage, BagError>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Some(series) = &mut self.series {
            return series.next();
        }
        loop {
            if let Some(file) = &mut self.current {
                if let Some(item) = file.next() {
                    return Some(item);
                }
                self.spare = std::mem::take(&mut file.spare);
                self.current = None;
            }
            let (path, layout) = self.files.pop_front()?;
            if let Some(why) = &layout.lost {
                return Some(Err(BagError::Lost { path, why: why.clone() }));
            }
            match self.opener.open(&path) {
                Ok(source) => {
                    let mut file = FileMessages::new(source, &layout, self.filter.clone());
                    file.spare = std::mem::take(&mut self.spare);
                    self.current = Some(file);
                }
                Err(error) => return Some(Err(error)),
            }
        }
    }
}

/// The messages of one file.
struct FileMessages {
    source: Source,
    plain: PlainReader,
    decoder: ChunkDecoder,
    inflater: Inflater,
    channels: Channels,
    filter: Filter,
    /// Parts still to be read, in order of time.
    parts: VecDeque<Part>,
    /// Offsets of the parts already read, needed if the index proves wrong.
    read_offsets: BTreeSet<u64>,
    waiting: BinaryHeap<Reverse<Waiting>>,
    waiting_bytes: usize,
    /// Number of messages found so far, by channel.
    found: BTreeMap<u16, u64>,
    /// Number of messages stated by the file, by channel.
    expected: Option<BTreeMap<u16, u64>>,
    may_rescan: bool,
    has_loss: bool,
    is_sorted: bool,
    spare: Vec<Vec<u8>>,
}

impl FileMessages {
    fn new(source: Source, layout: &Layout, filter: Filter) -> Self {
        let takes_any = |part: &&Part| {
            let is_past = part.end_time < filter.start_time();
            let may_have = part.message_indexes.is_empty()
                || part.message_indexes.iter().any(|(channel, _)| {
                    layout.channels.get(*channel).is_none_or(|topic| filter.takes(&topic.name))
                });
            may_have && !is_past
        };
        let mut inflater = Inflater::new(source.limit_bytes);
        inflater.is_stated = layout.has_packed_messages;
        Self {
            plain: PlainReader::default(),
            decoder: ChunkDecoder::new(source.limit_bytes),
            inflater,
            source,
            channels: layout.channels.clone(),
            parts: layout.parts.iter().filter(takes_any).cloned().collect(),
            // The stated counts cover the whole file only.
            expected: layout.stated_counts.clone().filter(|_| filter.start_time() == 0),
            filter,
            read_offsets: BTreeSet::new(),
            waiting: BinaryHeap::new(),
            waiting_bytes: 0,
            found: BTreeMap::new(),
            may_rescan: layout.is_indexed,
            has_loss: false,
            is_sorted: true,
            spare: Vec::new(),
        }
    }

    fn next(&mut self) -> Option<Result<RawMessage, BagError>> {
        loop {
            if self.must_read_first() {
                match self.read_part() {
                    Ok(()) => {}
                    Err(error) => return Some(Err(error)),
                }
            } else if let Some(Reverse(first)) = self.waiting.pop() {
                return Some(first.item.and_then(|(channel, message)| {
                    self.waiting_bytes -= cost(&message);
                    self.finish(channel, message, first.turn.offset)
                }));
            } else {
                return self.missing().map(Err);
            }
        }
    }

    /// Decompresses a message of the part at `offset` if it is compressed, then rewrites it if it is not one of ROS 2.
    fn finish(
        &mut self,
        channel: u16,
        mut message: RawMessage,
        offset: u64,
    ) -> Result<RawMessage, BagError> {
        let (rewrite, spare) = (self.channels.rewrite(channel), &mut self.spare);
        let inflated = self.inflater.inflate(&mut message, rewrite, spare);
        let finished = inflated.and_then(|()| match rewrite {
            Some(rewrite) => rewrite.apply(&mut message, spare),
            None => Ok(()),
        });
        let path = &self.source.path;
        let damaged = |what| BagError::Damaged { path: path.clone(), offset, end: offset, what };
        finished.map(|()| message).map_err(damaged)
    }

    /// True if the next part may hold a message earlier than all buffered ones.
    fn must_read_first(&mut self) -> bool {
        let Some(part) = self.parts.front() else { return false };
        let Some(Reverse(first)) = self.waiting.peek() else { return true };
        if (part.start_time, part.offset) >= (first.turn.time, first.turn.offset) {
            return false;
        }
        let limit_bytes = usize::try_from(self.source.limit_bytes).unwrap_or(usize::MAX);
        if self.waiting_bytes <= limit_bytes {
            return true;
        }
        if std::mem::take(&mut self.is_sorted) {
            let error = BagError::Unsorted {
                path: self.source.path.clone(),
                offset: part.offset,
                limit_bytes,
            };
            self.wait(Turn { number: 0, ..first.turn }, Err(error));
        }
        false
    }

    fn wait(&mut self, turn: Turn, item: Result<(u16, RawMessage), BagError>) {
        if let Ok((_, message)) = &item {
            self.waiting_bytes += cost(message);
        }
        self.has_loss |= item.as_ref().is_err_and(BagError::is_loss);
        self.waiting.push(Reverse(Waiting { turn, item }));
    }

    /// Reads the next part. An I/O error ends the file.
    fn read_part(&mut self) -> Result<(), BagError> {
        let Some(part) = self.parts.pop_front() else { return Ok(()) };
        let result = match &part.kind {
            PartKind::Damage(what) => {
                let span = RecordSpan { opcode: 0, offset: part.offset, end: part.end };
                let error = self.source.damaged(&span, what.clone());
                self.wait(Turn::first(part.start_time, part.offset), Err(error));
                Ok(())
            }
            PartKind::Loose => self.read_loose(part),
            PartKind::Chunk => self.read_chunk(&part),
        };
        if matches!(result, Err(BagError::Io { .. })) {
            self.parts.clear();
            self.expected = None;
        }
        result
    }

    fn read_chunk(&mut self, part: &Part) -> Result<(), BagError> {
        let chunk = match self.source.chunk_at(part.offset) {
            Ok(chunk) if !self.may_rescan || chunk.span.end == part.end => chunk,
            Ok(_) => {
                return self
                    .rescan(format!("the length of the chunk at byte {} differs", part.offset));
            }
            Err(Fault::Io(error)) => return Err(error),
            Err(Fault::Malformed(_)) => {
                return self.rescan(format!("there is no chunk at byte {}", part.offset));
            }
        };
        if !self.read_offsets.insert(part.offset) {
            return Ok(());
        }
        let mut taker =
            Taker { channels: &self.channels, filter: &self.filter, spare: &mut self.spare };
        match self.plain.read(&mut self.source, &chunk, &mut taker) {
            Some(messages) => self.wait_all(part.offset, messages),
            None => self.decode_chunk(part, &chunk),
        }
        Ok(())
    }

    /// Reads any chunk, valid or damaged.
    fn decode_chunk(&mut self, part: &Part, chunk: &ChunkHeader) {
        let mut faults = BTreeSet::new();
        let mut messages = Vec::new();
        let (channels, filter, spare) = (&mut self.channels, &self.filter, &mut self.spare);
        let decoded = self.decoder.decode(&mut self.source, chunk, &mut |opcode, body| {
            let fault = if opcode == op::MESSAGE {
                let taken = Taker { channels, filter, spare }.take(body);
                taken.and_then(|message| push(&mut messages, message))
            } else if matches!(opcode, op::SCHEMA | op::CHANNEL | 0x80..) {
                channels.add(opcode, body)
            } else {
                Err(format!("a chunk with a record of opcode {opcode:#04x}"))
            };
            if let Err(what) = fault
                && faults.len() < MAX_FAULTS
            {
                faults.insert(what);
            }
        });
        let last_time = messages
            .iter()
            .map(|(_, message)| message.log_time_ns as u64)
            .max()
            .unwrap_or(part.start_time);
        self.wait_all(part.offset, messages);
        let faults = faults
            .into_iter()
            .map(|what| self.source.damaged(&chunk.span, what))
            .collect::<Vec<_>>();
        let errors = faults.into_iter().chain(decoded.err());
        for (number, error) in errors.enumerate() {
            let number = u64::MAX / 2 + number as u64;
            self.wait(Turn { time: last_time, offset: part.offset, number }, Err(error));
        }
    }

    /// Buffers the messages of the chunk at `offset`, each with its channel.
    fn wait_all(&mut self, offset: u64, messages: Vec<(u16, RawMessage)>) {
        for (number, (channel, message)) in messages.into_iter().enumerate() {
            *self.found.entry(channel).or_default() += 1;
            let (time, number) = (message.log_time_ns as u64, number as u64);
            self.wait(Turn { time, offset, number }, Ok((channel, message)));
        }
    }

    /// Reads one message of a run outside chunks and puts the rest of the run back.
    fn read_loose(&mut self, mut part: Part) -> Result<(), BagError> {
        self.read_offsets.insert(part.offset);
        let span = match self.source.record_at(part.offset) {
            Ok(Some(span)) => span,
            Err(Fault::Io(error)) => return Err(error),
            Ok(None) | Err(Fault::Malformed(_)) => return Ok(()),
        };
        let body = self.source.body(&span)?;
        let mut taker =
            Taker { channels: &self.channels, filter: &self.filter, spare: &mut self.spare };
        match taker.take(&body) {
            Ok(Some((channel, message))) => {
                *self.found.entry(channel).or_default() += 1;
                part.start_time = message.log_time_ns as u64;
                self.wait(Turn::first(part.start_time, part.offset), Ok((channel, message)));
            }
            Ok(None) => {}
            Err(what) => {
                let error = self.source.damaged(&span, what);
                self.wait(Turn::first(part.start_time, part.offset), Err(error));
            }
        }
        part.offset = span.end;
        if part.offset < part.end {
            self.parts.push_front(part);
        }
        Ok(())
    }

    /// Scans the file and continues without the index, with every part that has not been read yet.
    fn rescan(&mut self, what: String) -> Result<(), BagError> {
        if !std::mem::take(&mut self.may_rescan) {
            let end = self.source.len_bytes;
            return Err(BagError::Damaged {
                path: self.source.path.clone(),
                offset: end,
                end,
                what,
            });
        }
        let layout = scan::scan(&mut self.source, self.channels.clone())?;
        self.channels = layout.channels;
        let unread =
            layout.parts.into_iter().filter(|part| !self.read_offsets.contains(&part.offset));
        self.parts = unread.collect();
        Err(BagError::Index { path: self.source.path.clone(), what })
    }

    /// At the end of the file, reports once if fewer messages were found than stated: the index or the file is wrong.
    fn missing(&mut self) -> Option<BagError> {
        let expected = self.expected.as_ref()?;
        let (channel, expected_count, found_count) =
            expected.iter().find_map(|(channel, &expected)| {
                let found = self.found.get(channel).copied().unwrap_or(0);
                let is_taken =
                    self.channels.get(*channel).is_some_and(|topic| self.filter.takes(&topic.name));
                (is_taken && found < expected).then_some((*channel, expected, found))
            })?;
        let topic = self.channels.get(channel).map_or("", |topic| &topic.name);
        let what = format!("{topic}: found {found_count} of {expected_count} messages");
        if self.has_loss {
            return None;
        }
        if !self.may_rescan {
            self.expected = None;
        }
        self.rescan(what).err()
    }
}

/// Memory that a message takes while it waits, bytes.
const fn cost(message: &RawMessage) -> usize {
    message.data.len() + size_of::<Waiting>()
}

fn push<T>(messages: &mut Vec<T>, message: Option<T>) -> Result<(), String> {
    if message.is_some() && messages.len() == MAX_CHUNK_MESSAGES {
        return Err(format!("the chunk holds more than {MAX_CHUNK_MESSAGES} messages"));
    }
    messages.extend(message);
    Ok(())
}
