//! Messages as CDR bytes behind the four-byte encapsulation header, through serde.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Why bytes are not the message they should be.
#[derive(Debug, Error)]
pub enum CdrError {
    /// To be refined.
    #[error("placeholder")]
    Placeholder,
}

/// Replaces `out` by the message's bytes, header included (little endian, `00 01 00 00`).
///
/// # Errors
/// A sequence of more than 2³² - 1 elements.
pub fn encode<T: Serialize + ?Sized>(message: &T, out: &mut Vec<u8>) -> Result<(), CdrError> {
    let _unused = (message, out);
    todo!()
}

/// Reads a message; byte arrays are borrowed from `bytes`. Both byte orders.
///
/// # Errors
/// A header of another encoding, bytes that end early, text that is not UTF-8.
pub fn decode<'de, T: Deserialize<'de>>(bytes: &'de [u8]) -> Result<T, CdrError> {
    let _unused = bytes;
    todo!()
}
