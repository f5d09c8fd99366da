//! Record structure of an MCAP file: a sequence of records, each an opcode, a length and a body. This is the only
//! place that checks lengths against the file size and the limit.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use mcap::records::op;

use super::{BagError, error::Fault};

/// Bytes of a record before its body: the opcode and the length.
pub(super) const PREFIX_BYTES: u64 = 9;
/// Bytes of a chunk's header (times, sizes, checksum) without the name of its compression.
const CHUNK_HEADER_BYTES: u64 = 40;
/// Maximum bytes of a chunk's prefix and header: the longest compression name is `zstd`.
pub(super) const CHUNK_START_BYTES: u64 = PREFIX_BYTES + CHUNK_HEADER_BYTES + 4;
/// Bytes of a message record before the message.
pub(super) const MESSAGE_HEADER_BYTES: usize = 22;

/// A file with random access.
#[derive(Debug)]
pub(super) struct Source {
    file: File,
    pub(super) path: PathBuf,
    pub(super) len_bytes: u64,
    /// Limit on the size of a record or chunk that is loaded into memory, bytes.
    pub(super) limit_bytes: u64,
    /// True if the file is compressed as a whole; offsets are those of its content.
    pub(super) is_packed: bool,
    /// The reason why the content of a compressed file ends early.
    pub(super) fault: Option<String>,
}

impl Source {
    pub(super) fn open(path: &Path, limit_bytes: usize) -> Result<Self, BagError> {
        let file = File::open(path).map_err(|source| BagError::Io { path: path.into(), source })?;
        Self::of(file, path, limit_bytes)
    }

    /// An open file that holds the content of `path`.
    pub(super) fn of(file: File, path: &Path, limit_bytes: usize) -> Result<Self, BagError> {
        let io_error = |source| BagError::Io { path: path.into(), source };
        let len_bytes = file.metadata().map_err(io_error)?.len();
        Ok(Self {
            file,
            path: path.into(),
            len_bytes,
            limit_bytes: limit_bytes as u64,
            is_packed: false,
            fault: None,
        })
    }

    pub(super) fn read_exact_at(&mut self, offset: u64, buffer: &mut [u8]) -> Result<(), BagError> {
        let read = self.file.read_exact_at(buffer, offset);
        read.map_err(|source| BagError::Io { path: self.path.clone(), source })
    }

    /// The `LEN` bytes at `offset`, zeros beyond the end of the file.
    fn read_padded<const LEN: usize>(&mut self, offset: u64) -> Result<[u8; LEN], BagError> {
        let mut bytes = [0; LEN];
        let available = self.len_bytes.saturating_sub(offset).min(LEN as u64) as usize;
        self.read_exact_at(offset, &mut bytes[..available])?;
        Ok(bytes)
    }

    /// Returns the record at `offset`, `None` at the end of the file.
    pub(super) fn record_at(&mut self, offset: u64) -> Result<Option<RecordSpan>, Fault> {
        let remaining = self.len_bytes.saturating_sub(offset);
        if remaining == 0 {
            return Ok(None);
        }
        if remaining < PREFIX_BYTES {
            return Err(format!("the file ends after {remaining} bytes of a record").into());
        }
        let prefix = self.read_padded::<{ PREFIX_BYTES as usize }>(offset)?;
        let (opcode, body_bytes) = (prefix[0], u64_at(&prefix, 1));
        let is_known = matches!(opcode, op::HEADER..=op::DATA_END | 0x80..);
        if !is_known {
            return Err(format!("unknown record opcode {opcode:#04x}").into());
        }
        let end = offset.checked_add(PREFIX_BYTES).and_then(|body| body.checked_add(body_bytes));
        let end = end.ok_or_else(|| format!("a record of {body_bytes} bytes"))?;
        Ok(Some(RecordSpan { opcode, offset, end }))
    }

    /// Reads the header of the chunk at `offset`.
    pub(super) fn chunk_at(&mut self, offset: u64) -> Result<ChunkHeader, Fault> {
        let start = self.read_padded::<{ CHUNK_START_BYTES as usize }>(offset)?;
        Ok(ChunkHeader::parse(&start, offset)?)
    }

    /// Returns the start of the records of an uncompressed chunk at `offset` whose header was never filled in. Writers
    /// that reserve the header and fill it in when they close the chunk leave 0 or the largest number for its lengths.
    pub(super) fn open_chunk_at(&mut self, offset: u64) -> Result<Option<u64>, BagError> {
        let start = self.read_padded::<{ CHUNK_START_BYTES as usize }>(offset)?;
        let is_open = |number: u64| number == 0 || number == u64::MAX;
        let lengths = [u64_at(&start, 1), u64_at(&start, 25), u64_at(&start, 41)];
        let is_uncompressed = u32_at(&start, 37) == 0;
        if start[0] != op::CHUNK || !is_uncompressed || !lengths.into_iter().all(is_open) {
            return Ok(None);
        }
        let content = offset + PREFIX_BYTES + CHUNK_HEADER_BYTES;
        match self.record_at(content) {
            Ok(Some(RecordSpan { opcode: op::SCHEMA | op::CHANNEL | op::MESSAGE, .. })) => {
                Ok(Some(content))
            }
            Ok(_) | Err(Fault::Malformed(_)) => Ok(None),
            Err(Fault::Io(error)) => Err(error),
        }
    }

    /// True if the file ends in the prefix of the record at `offset` and `is_wanted` accepts its opcode.
    pub(super) fn ends_in_prefix_of(
        &mut self,
        offset: u64,
        is_wanted: fn(u8) -> bool,
    ) -> Result<bool, BagError> {
        let [opcode] = self.read_padded::<1>(offset)?;
        Ok(self.len_bytes - offset < PREFIX_BYTES && is_wanted(opcode))
    }

    /// Reads the body of a record other than a chunk.
    pub(super) fn body(&mut self, span: &RecordSpan) -> Result<Vec<u8>, BagError> {
        let body_bytes = span.end - span.offset - PREFIX_BYTES;
        self.check_length(span, body_bytes)?;
        let mut body = vec![0; body_bytes as usize];
        self.read_exact_at(span.offset + PREFIX_BYTES, &mut body)?;
        Ok(body)
    }

    /// Rejects a length beyond the end of the file or the limit.
    pub(super) fn check_length(
        &self,
        span: &RecordSpan,
        in_memory_bytes: u64,
    ) -> Result<(), BagError> {
        if span.end > self.len_bytes {
            let missing = span.end - self.len_bytes;
            return Err(self.damaged(
                span,
                format!("the file ends {missing} bytes before the end of this record"),
            ));
        }
        if in_memory_bytes > self.limit_bytes {
            let limit = self.limit_bytes;
            return Err(self.damaged(
                span,
                format!("a record of {in_memory_bytes} bytes exceeds the limit of {limit}"),
            ));
        }
        Ok(())
    }

    /// Returns the error for a damaged record.
    pub(super) fn damaged(&self, span: &RecordSpan, what: String) -> BagError {
        BagError::Damaged {
            path: self.path.clone(),
            offset: span.offset,
            end: span.end.min(self.len_bytes),
            what,
        }
    }
}

/// Range of a record, bytes from the start of the file. It may extend beyond the end of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct RecordSpan {
    pub(super) opcode: u8,
    pub(super) offset: u64,
    pub(super) end: u64,
}

/// A chunk record's header; its lengths are consistent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ChunkHeader {
    pub(super) span: RecordSpan,
    pub(super) start_time: u64,
    pub(super) end_time: u64,
    pub(super) uncompressed_bytes: u64,
    pub(super) compressed_bytes: u64,
    /// Checksum of the uncompressed content; 0 for none.
    pub(super) crc: u32,
    /// Name of the compression; empty for none.
    pub(super) compression: String,
}

impl ChunkHeader {
    /// Reads the start of a chunk record. The lengths must be consistent; random bytes fail this test.
    pub(super) fn parse(
        start: &[u8; CHUNK_START_BYTES as usize],
        offset: u64,
    ) -> Result<Self, String> {
        if start[0] != op::CHUNK {
            return Err(format!("a chunk record has the opcode {:#04x}", start[0]));
        }
        let body_bytes = u64_at(start, 1);
        let name_bytes = u32_at(start, 37) as usize;
        let Some(name) = start[41..].get(..name_bytes).filter(|_| name_bytes <= 4) else {
            return Err(format!("a compression name of {name_bytes} bytes"));
        };
        let compression = String::from_utf8_lossy(name).into_owned();
        let compressed_bytes = u64_at(start, 41 + name_bytes);
        let uncompressed_bytes = u64_at(start, 25);
        let expected = compressed_bytes.checked_add(CHUNK_HEADER_BYTES + name_bytes as u64);
        if expected != Some(body_bytes) {
            return Err(format!(
                "a chunk record of {body_bytes} bytes states {compressed_bytes} bytes of content"
            ));
        }
        if !["", "lz4", "zstd"].contains(&compression.as_str()) {
            return Err(format!("unknown compression {compression:?}"));
        }
        if compression.is_empty() && compressed_bytes != uncompressed_bytes {
            return Err(format!(
                "an uncompressed chunk states {uncompressed_bytes} bytes but holds {compressed_bytes}"
            ));
        }
        let end = offset.checked_add(PREFIX_BYTES).and_then(|body| body.checked_add(body_bytes));
        let end = end.ok_or_else(|| format!("a chunk of {body_bytes} bytes"))?;
        Ok(Self {
            span: RecordSpan { opcode: op::CHUNK, offset, end },
            start_time: u64_at(start, 9),
            end_time: u64_at(start, 17),
            uncompressed_bytes,
            compressed_bytes,
            crc: u32_at(start, 33),
            compression,
        })
    }
}

/// Fixed part of a message record.
#[derive(Clone, Copy, Debug)]
pub(super) struct MessageHeader {
    pub(super) channel: u16,
    pub(super) sequence: u32,
    pub(super) log_time: u64,
    pub(super) publish_time: u64,
}

impl MessageHeader {
    /// Splits a message record's body into header and message.
    pub(super) fn split(body: &[u8]) -> Option<(Self, &[u8])> {
        let (header, data) = body.split_at_checked(MESSAGE_HEADER_BYTES)?;
        let channel = u16::from_le_bytes([header[0], header[1]]);
        let (log_time, publish_time) = (u64_at(header, 6), u64_at(header, 14));
        Some((Self { channel, sequence: u32_at(header, 2), log_time, publish_time }, data))
    }
}

/// Little-endian number in `bytes`, which must reach there.
pub(super) fn u64_at(bytes: &[u8], at: usize) -> u64 {
    let mut number = [0; 8];
    number.copy_from_slice(&bytes[at..at + 8]);
    u64::from_le_bytes(number)
}

/// Little-endian number in `bytes`, which must reach there.
pub(super) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    let mut number = [0; 4];
    number.copy_from_slice(&bytes[at..at + 4]);
    u32::from_le_bytes(number)
}
