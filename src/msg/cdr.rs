//! Messages as CDR bytes after the four-byte encapsulation header, through serde.

use byteorder::{BigEndian, ByteOrder, LittleEndian};
use cdr_encoding::CdrDeserializer;
use serde::Deserialize;
use thiserror::Error;

use super::schema::Message;

/// Plain CDR, little endian; two bytes of options follow.
const LITTLE_ENDIAN: [u8; 2] = [0, 1];
/// Plain CDR, big endian.
const BIG_ENDIAN: [u8; 2] = [0, 0];
const HEADER_BYTES: usize = 4;
/// Writers may pad a message to the alignment of its widest number.
const MAX_PADDING_BYTES: usize = 7;

/// Errors of encoding and decoding.
#[derive(Debug, Error)]
pub enum CdrError {
    /// Too short for a header.
    #[error("{message}: {actual} bytes are fewer than the {HEADER_BYTES} bytes of a CDR header")]
    Header {
        /// Expected type.
        message: &'static str,
        /// Number of bytes.
        actual: usize,
    },
    /// Another encoding, such as a parameter list or version 2.
    #[error("{message}: encapsulation {:02x} {:02x} is not plain CDR (00 00 or 00 01)", .id[0], .id[1])]
    Encapsulation {
        /// Expected type.
        message: &'static str,
        /// The first two bytes.
        id: [u8; 2],
    },
    /// The bytes end early or contain a value that is invalid for the type.
    #[error("{message}: at byte {offset} of {length}: {reason}")]
    Content {
        /// Expected type.
        message: &'static str,
        /// Number of bytes read, header included.
        offset: usize,
        /// Number of bytes.
        length: usize,
        /// Error of the decoder.
        reason: cdr_encoding::Error,
    },
    /// The message ends long before the bytes: they belong to another type.
    #[error("{message} ends after {used} bytes, but there are {length}")]
    Surplus {
        /// Expected type.
        message: &'static str,
        /// Size of the message, bytes, header included.
        used: usize,
        /// Number of bytes.
        length: usize,
    },
    /// The message cannot be encoded.
    #[error("{message} cannot be encoded: {reason}")]
    Encode {
        /// Type of the message.
        message: &'static str,
        /// Error of the encoder.
        reason: cdr_encoding::Error,
    },
    /// A message of 4 GiB or more, whose lengths do not fit into 32 bits.
    #[error("{message} takes {length} bytes, but CDR lengths are limited to {}", u32::MAX)]
    TooLong {
        /// Type of the message.
        message: &'static str,
        /// Number of bytes written.
        length: usize,
    },
}

/// Replaces `out` by the message's bytes, header included (little endian, `00 01 00 00`). Keeps `out`'s memory.
///
/// # Errors
/// The message has 4 GiB or more.
pub fn encode<T: Message>(message: &T, out: &mut Vec<u8>) -> Result<(), CdrError> {
    out.clear();
    out.extend_from_slice(&LITTLE_ENDIAN);
    out.extend_from_slice(&[0, 0]);
    let name = T::TYPE.name;
    cdr_encoding::to_writer::<T, LittleEndian, _>(&mut *out, message)
        .map_err(|reason| CdrError::Encode { message: name, reason })?;
    // The serializer truncates longer lengths silently; every element takes at least one byte.
    if u32::try_from(out.len()).is_err() {
        return Err(CdrError::TooLong { message: name, length: out.len() });
    }
    Ok(())
}

/// Reads a message of either byte order. Byte arrays and text are borrowed from `bytes`.
///
/// Memory is proportional to `bytes`: a stated length reserves nothing.
///
/// # Errors
/// A header of another encoding, missing or surplus bytes, text that is not UTF-8 or does not end in NUL, or a bool
/// other than 0 and 1.
pub fn decode<'de, T: Message + Deserialize<'de>>(bytes: &'de [u8]) -> Result<T, CdrError> {
    decode_named(T::TYPE.name, bytes)
}

/// As [`decode`], for a former layout of the type with that name.
pub(super) fn decode_named<'de, T: Deserialize<'de>>(
    message: &'static str,
    bytes: &'de [u8],
) -> Result<T, CdrError> {
    let Some((&[first, second, ..], body)) = bytes.split_first_chunk::<HEADER_BYTES>() else {
        return Err(CdrError::Header { message, actual: bytes.len() });
    };
    match [first, second] {
        LITTLE_ENDIAN => decode_body::<T, LittleEndian>(message, body),
        BIG_ENDIAN => decode_body::<T, BigEndian>(message, body),
        id => Err(CdrError::Encapsulation { message, id }),
    }
}

fn decode_body<'de, T, Order>(message: &'static str, body: &'de [u8]) -> Result<T, CdrError>
where
    T: Deserialize<'de>,
    Order: ByteOrder,
{
    let mut deserializer = CdrDeserializer::<Order>::new(body);
    let decoded = T::deserialize(&mut deserializer);
    let used = deserializer.bytes_consumed() + HEADER_BYTES;
    let length = body.len() + HEADER_BYTES;
    match decoded {
        Err(reason) => Err(CdrError::Content { message, offset: used, length, reason }),
        Ok(_) if length - used > MAX_PADDING_BYTES => {
            Err(CdrError::Surplus { message, used, length })
        }
        Ok(decoded) => Ok(decoded),
    }
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod golden;
