//! Frames on a pipe: length of the header, length of the payload, header as JSON, payload.
//!
//! The payload is a message's CDR bytes, which stay as they are; JSON describes them.

use std::{
    io::{self, Read, Write},
    sync::Arc,
};

use serde::{Serialize, de::DeserializeOwned};
use thiserror::Error;

/// Longest header, bytes: the list of a large graph's topics.
const MAX_HEADER_BYTES: u32 = 16 << 20;
/// Largest payload for which memory is reserved before it arrives, bytes.
const MAX_RESERVED_BYTES: usize = 64 << 20;
/// Length of the two lengths.
const PREFIX_BYTES: usize = 8;

/// Bytes of a message.
#[derive(Clone, Debug, Default)]
pub(super) enum Payload {
    /// No message.
    #[default]
    None,
    /// Bytes that only this frame needs.
    Owned(Vec<u8>),
    /// Bytes that other parts of the program use, too.
    Shared(Arc<[u8]>),
}

impl Payload {
    pub(super) fn bytes(&self) -> &[u8] {
        match self {
            Self::None => &[],
            Self::Owned(bytes) => bytes,
            Self::Shared(bytes) => bytes,
        }
    }
}

/// Errors of reading or writing a frame. The pipe cannot be used afterwards.
#[derive(Debug, Error)]
pub(super) enum WireError {
    /// The pipe is broken, or ends within a frame.
    #[error("the pipe is broken: {0}")]
    Pipe(#[from] io::Error),
    /// The header is not one of this version of the program.
    #[error("invalid header: {0}")]
    Header(#[from] serde_json::Error),
    /// The header exceeds the limit.
    #[error("a header of {0} bytes exceeds the limit of {MAX_HEADER_BYTES} bytes")]
    TooLong(u32),
    /// The message cannot be described in 32 bits.
    #[error("a message of {0} bytes exceeds the limit of 4 GiB")]
    TooLarge(usize),
}

/// Writes a frame.
pub(super) fn write(
    output: &mut impl Write,
    header: &impl Serialize,
    payload: &Payload,
) -> Result<(), WireError> {
    let (header, payload) = (serde_json::to_vec(header)?, payload.bytes());
    let header_bytes = u32::try_from(header.len()).unwrap_or(u32::MAX);
    if header_bytes > MAX_HEADER_BYTES {
        return Err(WireError::TooLong(header_bytes));
    }
    let payload_bytes =
        u32::try_from(payload.len()).map_err(|_too_large| WireError::TooLarge(payload.len()))?;
    let mut start = Vec::with_capacity(PREFIX_BYTES + header.len());
    start.extend_from_slice(&header_bytes.to_le_bytes());
    start.extend_from_slice(&payload_bytes.to_le_bytes());
    start.extend_from_slice(&header);
    output.write_all(&start)?;
    output.write_all(payload)?;
    Ok(output.flush()?)
}

/// Reads a frame; `None` if the pipe ends before one.
pub(super) fn read<Header: DeserializeOwned>(
    input: &mut impl Read,
) -> Result<Option<(Header, Vec<u8>)>, WireError> {
    let mut prefix = Vec::with_capacity(PREFIX_BYTES);
    input.take(PREFIX_BYTES as u64).read_to_end(&mut prefix)?;
    if prefix.is_empty() {
        return Ok(None);
    }
    let (Some(header_bytes), Some(payload_bytes)) = (number(&prefix, 0), number(&prefix, 4)) else {
        return Err(io::Error::from(io::ErrorKind::UnexpectedEof).into());
    };
    if header_bytes > MAX_HEADER_BYTES {
        return Err(WireError::TooLong(header_bytes));
    }
    let header = exactly(input, header_bytes)?;
    Ok(Some((serde_json::from_slice(&header)?, exactly(input, payload_bytes)?)))
}

fn number(prefix: &[u8], at: usize) -> Option<u32> {
    let bytes = prefix.get(at..at + 4)?;
    bytes.try_into().ok().map(u32::from_le_bytes)
}

/// Reads that number of bytes. A stated length alone reserves little.
fn exactly(input: &mut impl Read, num_bytes: u32) -> Result<Vec<u8>, io::Error> {
    let mut bytes = Vec::with_capacity((num_bytes as usize).min(MAX_RESERVED_BYTES));
    input.take(num_bytes.into()).read_to_end(&mut bytes)?;
    if bytes.len() < num_bytes as usize {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(header: &str, payload: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        write(&mut bytes, &header, &Payload::Owned(payload.to_vec())).unwrap();
        bytes
    }

    #[test]
    fn frames_round_trip_one_after_another() {
        let bytes = [frame("a", &[1, 2, 3]), frame("b", &[])].concat();
        let input = &mut &bytes[..];
        assert_eq!(read(input).unwrap(), Some(("a".to_owned(), vec![1, 2, 3])));
        assert_eq!(read(input).unwrap(), Some(("b".to_owned(), vec![])));
        assert_eq!(read::<String>(input).unwrap(), None);
    }

    #[test]
    fn a_pipe_that_ends_within_a_frame_is_an_error() {
        let bytes = frame("header", &[1, 2, 3]);
        for length in 1..bytes.len() {
            assert!(read::<String>(&mut &bytes[..length]).is_err(), "{length}");
        }
    }

    #[test]
    fn stated_lengths_reserve_no_memory() {
        let mut bytes = u32::MAX.to_le_bytes().repeat(2);
        assert!(matches!(read::<String>(&mut &bytes[..]), Err(WireError::TooLong(u32::MAX))));
        bytes[..4].copy_from_slice(&2_u32.to_le_bytes());
        bytes.extend_from_slice(b"\"\"");
        assert!(matches!(read::<String>(&mut &bytes[..]), Err(WireError::Pipe(_))));
    }
}
