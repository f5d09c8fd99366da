//! Destination of a recorder's bytes. It buffers and counts them, and writes nothing after the first error, so that no
//! data follows a gap.

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Size of the buffer, bytes.
const BUFFER_BYTES: usize = 64 << 10;

/// A destination of bytes.
pub(super) struct Sink {
    inner: Box<dyn Write + Send>,
    buffer: Vec<u8>,
    written_bytes: Arc<AtomicU64>,
    has_failed: bool,
}

impl Sink {
    pub(super) fn new(inner: Box<dyn Write + Send>, written_bytes: Arc<AtomicU64>) -> Self {
        Self { inner, buffer: Vec::with_capacity(BUFFER_BYTES), written_bytes, has_failed: false }
    }

    fn guard(&mut self, act: impl FnOnce(&mut Self) -> io::Result<()>) -> io::Result<()> {
        if self.has_failed {
            return Err(io::Error::other("an earlier write failed"));
        }
        act(self).inspect_err(|_| self.has_failed = true)
    }

    fn empty_buffer(&mut self) -> io::Result<()> {
        self.inner.write_all(&self.buffer)?;
        self.buffer.clear();
        Ok(())
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.guard(|sink| {
            if sink.buffer.len() + bytes.len() > BUFFER_BYTES {
                sink.empty_buffer()?;
            }
            if bytes.len() > BUFFER_BYTES {
                sink.inner.write_all(bytes)
            } else {
                sink.buffer.write_all(bytes)
            }
        })?;
        self.written_bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.guard(|sink| {
            sink.empty_buffer()?;
            sink.inner.flush()
        })
    }
}

impl Drop for Sink {
    fn drop(&mut self) {
        // An error cannot be returned from here; `Recorder::finish` flushes and reports errors.
        let _ignored = self.flush();
    }
}
