//! The records inside one chunk, decompressed and checked.

use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::BagError;
use super::error::Fault;
use super::format::{ChunkHeader, PREFIX_BYTES, Source};

/// Decodes chunks and reuses its buffers between them.
pub(super) struct ChunkDecoder {
    reader: LinearReader,
    limit_bytes: usize,
}

impl ChunkDecoder {
    pub(super) fn new(limit_bytes: u64) -> Self {
        let limit_bytes = usize::try_from(limit_bytes).unwrap_or(usize::MAX);
        Self { reader: checking_reader(limit_bytes), limit_bytes }
    }

    /// Passes every record of the chunk to `visit`, in order. A wrong checksum is reported before the first record. Of
    /// a truncated chunk, the complete records are passed.
    pub(super) fn decode(
        &mut self,
        source: &mut Source,
        chunk: &ChunkHeader,
        visit: &mut dyn FnMut(u8, &[u8]),
    ) -> Result<(), BagError> {
        let is_cut = chunk.span.end > source.len_bytes;
        if chunk.uncompressed_bytes.max(chunk.compressed_bytes) > source.limit_bytes {
            let (size, limit) =
                (chunk.uncompressed_bytes.max(chunk.compressed_bytes), source.limit_bytes);
            return Err(source.damaged(
                &chunk.span,
                format!("a chunk of {size} bytes exceeds the limit of {limit}"),
            ));
        }
        if is_cut {
            // The checksum of a truncated chunk cannot be computed.
            let options = options(self.limit_bytes);
            self.reader = LinearReader::new_with_options(options);
        }
        let result = self.feed(source, chunk, visit);
        if is_cut || result.is_err() {
            self.reader = checking_reader(self.limit_bytes);
        }
        match result {
            Err(Fault::Io(error)) => Err(error),
            _ if is_cut => {
                let missing = chunk.span.end - source.len_bytes;
                let what = format!("the file ends {missing} bytes before the end of this chunk");
                Err(source.damaged(&chunk.span, what))
            }
            Ok(()) => Ok(()),
            Err(Fault::Malformed(what)) => Err(source.damaged(&chunk.span, what)),
        }
    }

    fn feed(
        &mut self,
        source: &mut Source,
        chunk: &ChunkHeader,
        visit: &mut dyn FnMut(u8, &[u8]),
    ) -> Result<(), Fault> {
        let available = (chunk.span.end.min(source.len_bytes) - chunk.span.offset) as usize;
        source.read_exact_at(chunk.span.offset, self.reader.insert(available))?;
        self.reader.notify_read(available);
        let mut shown_bytes = 0;
        while let Some(event) = self.reader.next_event() {
            match event {
                Ok(LinearReadEvent::Record { opcode, data }) => {
                    shown_bytes += PREFIX_BYTES + data.len() as u64;
                    visit(opcode, data);
                }
                // The reader already has the whole chunk: it is done, or a record claims more than the chunk holds.
                Ok(LinearReadEvent::ReadRequest(_)) if shown_bytes == chunk.uncompressed_bytes => {
                    return Ok(());
                }
                Ok(LinearReadEvent::ReadRequest(_)) => break,
                Err(error) => return Err(Fault::Malformed(error.to_string())),
            }
        }
        Err(Fault::Malformed("the chunk ends in the middle of a record".into()))
    }
}

/// Options of a reader that starts at a record.
fn options(limit_bytes: usize) -> LinearReaderOptions {
    LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_record_length_limit(limit_bytes)
}

/// A reader that verifies a chunk's checksum before it returns the first record.
fn checking_reader(limit_bytes: usize) -> LinearReader {
    LinearReader::new_with_options(options(limit_bytes).with_prevalidate_chunk_crcs(true))
}
