//! Decompresses messages that are compressed one by one, as in rosbag2's compression mode MESSAGE.

use std::io::{Cursor, Read};

use super::RawMessage;
use super::kind::ZSTD_MAGIC;
use super::rewrite::Rewrite;

/// Decompresses messages and reuses its buffers between them.
pub(super) struct Inflater {
    context: Option<zstd::zstd_safe::DCtx<'static>>,
    limit_bytes: u64,
    /// True if the recording states that every message is compressed.
    pub(super) is_stated: bool,
}

impl Inflater {
    /// Decompresses messages of up to `limit_bytes`.
    pub(super) const fn new(limit_bytes: u64) -> Self {
        Self { context: None, limit_bytes, is_stated: false }
    }

    /// Decompresses a message in place if it is compressed, before it is rewritten; `spare` is where its old buffer goes.
    ///
    /// CDR begins with two bytes that name its variant; the first is 0. So a CDR message that begins like a frame of
    /// Zstandard is one, whatever the recording states.
    ///
    /// # Errors
    /// The message is damaged or too large; the text describes the fault.
    pub(super) fn inflate(
        &mut self,
        message: &mut RawMessage,
        rewrite: Option<Rewrite>,
        spare: &mut Vec<Vec<u8>>,
    ) -> Result<(), String> {
        let is_cdr = match rewrite {
            Some(rewrite) => rewrite.is_of_cdr(),
            None => message.topic.message_encoding == "cdr",
        };
        let may_be = self.is_stated || is_cdr;
        if !may_be || !message.data.starts_with(&ZSTD_MAGIC) {
            return Ok(());
        }
        let fault = |what: String| {
            let (topic, time_ns) = (&message.topic.name, message.log_time_ns);
            format!("{topic}: the message at log time {time_ns} ns cannot be decompressed: {what}")
        };
        let context = self.context.get_or_insert_with(zstd::zstd_safe::DCtx::create);
        let mut inflated = spare.pop().unwrap_or_default();
        inflated.clear();
        let read = zstd::Decoder::with_context(Cursor::new(&message.data), context)
            .take(self.limit_bytes + 1)
            .read_to_end(&mut inflated);
        read.map_err(|error| fault(error.to_string()))?;
        if inflated.len() as u64 > self.limit_bytes {
            return Err(fault(format!("it exceeds the limit of {} bytes", self.limit_bytes)));
        }
        spare.push(std::mem::replace(&mut message.data, inflated));
        Ok(())
    }
}
