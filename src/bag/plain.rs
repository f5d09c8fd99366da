//! Fast path for uncompressed chunks: each message is read from the file directly into its output buffer and hashed
//! while it is still in the processor's cache. Images pass through memory once instead of three times.

use mcap::records::op;

use super::RawMessage;
use super::format::{ChunkHeader, MESSAGE_HEADER_BYTES, MessageHeader, PREFIX_BYTES, Source};
use super::messages::SPARE_BUFFERS;
use super::take::{MAX_CHUNK_MESSAGES, Taker};

/// Bytes that are read and hashed at a time; they fit into the level-2 cache.
const PIECE_BYTES: usize = 128 << 10;
/// Messages up to this size are copied from a block that holds several of them, which saves system calls.
const SMALL_BYTES: usize = 16 << 10;
const BLOCK_BYTES: usize = 2 * SMALL_BYTES;
const RECORD_START_BYTES: usize = PREFIX_BYTES as usize;

/// Reads uncompressed chunks and reuses its block between them.
#[derive(Default)]
pub(super) struct PlainReader {
    block: Vec<u8>,
}

impl PlainReader {
    /// Returns the messages of an intact chunk that holds only messages of known channels and whose checksum matches.
    /// `None` for any other chunk: the general decoder then reads it and reports the faults.
    pub(super) fn read(
        &mut self,
        source: &mut Source,
        chunk: &ChunkHeader,
        taker: &mut Taker<'_>,
    ) -> Option<Vec<(u16, RawMessage)>> {
        let is_whole = chunk.span.end <= source.len_bytes;
        if !chunk.compression.is_empty()
            || !is_whole
            || chunk.uncompressed_bytes > source.limit_bytes
        {
            return None;
        }
        let from = chunk.span.end - chunk.uncompressed_bytes;
        self.block.resize(BLOCK_BYTES, 0);
        let mut stream = Stream {
            source,
            from,
            unread_bytes: chunk.uncompressed_bytes as usize,
            block: &mut self.block,
            held: 0..0,
            hasher: (chunk.crc != 0).then(crc32fast::Hasher::new),
        };
        let mut messages = Vec::new();
        let is_read = stream.messages(taker, &mut messages).is_some();
        let is_sound = is_read && stream.hasher.is_none_or(|hasher| hasher.finalize() == chunk.crc);
        if !is_sound {
            let buffers = messages.drain(..).map(|(_, message): (u16, RawMessage)| message.data);
            taker.spare.extend(buffers.take(SPARE_BUFFERS));
            return None;
        }
        Some(messages)
    }
}

/// The content of a chunk as a stream.
struct Stream<'a> {
    source: &'a mut Source,
    /// Offset of the first unread byte in the file.
    from: u64,
    unread_bytes: usize,
    block: &'a mut Vec<u8>,
    /// Range of the block that has not been consumed yet.
    held: std::ops::Range<usize>,
    hasher: Option<crc32fast::Hasher>,
}

impl Stream<'_> {
    const fn remaining_bytes(&self) -> usize {
        self.held.end - self.held.start + self.unread_bytes
    }

    fn messages(
        &mut self,
        taker: &mut Taker<'_>,
        messages: &mut Vec<(u16, RawMessage)>,
    ) -> Option<()> {
        while self.remaining_bytes() > 0 {
            let start = self.take(RECORD_START_BYTES)?;
            let (opcode, body_bytes) = (start[0], super::format::u64_at(start, 1));
            let body_bytes = usize::try_from(body_bytes).ok()?;
            let data_bytes = body_bytes.checked_sub(MESSAGE_HEADER_BYTES)?;
            if opcode != op::MESSAGE || body_bytes > self.remaining_bytes() {
                return None;
            }
            let (header, _) = MessageHeader::split(self.take(MESSAGE_HEADER_BYTES)?)?;
            match taker.empty(&header).ok()? {
                // The general decoder reports it.
                Some(_) if messages.len() == MAX_CHUNK_MESSAGES => return None,
                Some(mut message) => {
                    let filled = self.fill(data_bytes, &mut message.data);
                    messages.push((header.channel, message));
                    filled?;
                }
                None => self.skip(data_bytes)?,
            }
        }
        Some(())
    }

    /// Returns the next bytes: at most [`SMALL_BYTES`], or as many as the block holds.
    fn take(&mut self, num_bytes: usize) -> Option<&[u8]> {
        let num_held = self.held.len();
        if num_held < num_bytes {
            self.block.copy_within(self.held.clone(), 0);
            let num_read = SMALL_BYTES.min(self.unread_bytes);
            let free = self.block.get_mut(num_held..num_held + num_read)?;
            read(self.source, self.from, free, &mut self.hasher)?;
            self.advance(num_read);
            self.held = 0..num_held + num_read;
        }
        let taken = self.held.start..self.held.start.checked_add(num_bytes)?;
        if taken.end > self.held.end {
            return None;
        }
        self.held.start = taken.end;
        self.block.get(taken)
    }

    /// Replaces `data` with the next bytes.
    fn fill(&mut self, num_bytes: usize, data: &mut Vec<u8>) -> Option<()> {
        // The old content is overwritten, so only the growth is zeroed.
        data.resize(num_bytes, 0);
        let num_copied =
            if num_bytes <= SMALL_BYTES { num_bytes } else { self.held.len().min(num_bytes) };
        let (front, rest) = data.split_at_mut(num_copied);
        front.copy_from_slice(self.take(num_copied)?);
        for piece in rest.chunks_mut(PIECE_BYTES) {
            read(self.source, self.from, piece, &mut self.hasher)?;
            self.advance(piece.len());
        }
        Some(())
    }

    fn skip(&mut self, mut num_bytes: usize) -> Option<()> {
        while num_bytes > 0 {
            let num_taken = num_bytes.min(SMALL_BYTES);
            self.take(num_taken)?;
            num_bytes -= num_taken;
        }
        Some(())
    }

    const fn advance(&mut self, num_bytes: usize) {
        self.from += num_bytes as u64;
        self.unread_bytes -= num_bytes;
    }
}

fn read(
    source: &mut Source,
    from: u64,
    out: &mut [u8],
    hasher: &mut Option<crc32fast::Hasher>,
) -> Option<()> {
    source.read_exact_at(from, out).ok()?;
    if let Some(hasher) = hasher {
        hasher.update(out);
    }
    Some(())
}
