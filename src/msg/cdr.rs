//! Messages as CDR bytes behind the four-byte encapsulation header, through serde.

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

/// Why bytes are not the message they should be, or a message cannot become bytes.
#[derive(Debug, Error)]
pub enum CdrError {
    /// Not even a header.
    #[error("{message}: {actual} bytes are too few for the {HEADER_BYTES} bytes of a CDR header")]
    Header {
        /// Type expected.
        message: &'static str,
        /// Bytes there are.
        actual: usize,
    },
    /// Another encoding, such as a parameter list or version 2.
    #[error("{message}: encapsulation {:02x} {:02x} is not plain CDR (00 00 or 00 01)", .id[0], .id[1])]
    Encapsulation {
        /// Type expected.
        message: &'static str,
        /// The first two bytes.
        id: [u8; 2],
    },
    /// The bytes end early, or hold what the type cannot.
    #[error("{message}: at byte {offset} of {length}: {reason}")]
    Content {
        /// Type expected.
        message: &'static str,
        /// Bytes that could be read, header included.
        offset: usize,
        /// Bytes there are.
        length: usize,
        /// What is wrong there.
        reason: cdr_encoding::Error,
    },
    /// The type ends long before the bytes do: they are another type's.
    #[error("{message} ends after {used} bytes, but there are {length}")]
    Surplus {
        /// Type expected.
        message: &'static str,
        /// Bytes that the message takes, header included.
        used: usize,
        /// Bytes there are.
        length: usize,
    },
    /// It cannot be written.
    #[error("{message} cannot be encoded: {reason}")]
    Encode {
        /// Type of the message.
        message: &'static str,
        /// Why.
        reason: cdr_encoding::Error,
    },
    /// A message of 4 GiB or more: its lengths do not fit into 32 bits.
    #[error("{message} takes {length} bytes, but lengths in CDR end at {}", u32::MAX)]
    TooLong {
        /// Type of the message.
        message: &'static str,
        /// Bytes written.
        length: usize,
    },
}

/// Replaces `out` by the message's bytes, header included (little endian, `00 01 00 00`). Keeps `out`'s memory.
///
/// # Errors
/// A message of 4 GiB or more.
pub fn encode<T: Message>(message: &T, out: &mut Vec<u8>) -> Result<(), CdrError> {
    out.clear();
    out.extend_from_slice(&LITTLE_ENDIAN);
    out.extend_from_slice(&[0, 0]);
    let name = T::TYPE.name;
    cdr_encoding::to_writer::<T, LittleEndian, _>(&mut *out, message)
        .map_err(|reason| CdrError::Encode { message: name, reason })?;
    // The serializer truncates longer lengths unseen; every element takes a byte or more.
    if u32::try_from(out.len()).is_err() {
        return Err(CdrError::TooLong { message: name, length: out.len() });
    }
    Ok(())
}

/// Reads a message; byte arrays and text are borrowed from `bytes`. Both byte orders.
///
/// Memory stays in proportion to `bytes`: a stated length reserves nothing.
///
/// # Errors
/// A header of another encoding, bytes that end early or late, text that is not UTF-8 or not ended by NUL, a bool
/// other than 0 and 1.
pub fn decode<'de, T: Message + Deserialize<'de>>(bytes: &'de [u8]) -> Result<T, CdrError> {
    let message = T::TYPE.name;
    let Some((&[first, second, ..], body)) = bytes.split_first_chunk::<HEADER_BYTES>() else {
        return Err(CdrError::Header { message, actual: bytes.len() });
    };
    match [first, second] {
        LITTLE_ENDIAN => decode_body::<T, LittleEndian>(body),
        BIG_ENDIAN => decode_body::<T, BigEndian>(body),
        id => Err(CdrError::Encapsulation { message, id }),
    }
}

fn decode_body<'de, T, Order>(body: &'de [u8]) -> Result<T, CdrError>
where
    T: Message + Deserialize<'de>,
    Order: ByteOrder,
{
    let mut deserializer = CdrDeserializer::<Order>::new(body);
    let decoded = T::deserialize(&mut deserializer);
    let used = deserializer.bytes_consumed() + HEADER_BYTES;
    let length = body.len() + HEADER_BYTES;
    let message = T::TYPE.name;
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
