//! Errors, and the texts of Cyclone's return codes.
#![expect(unsafe_code, reason = "the text of a return code is a C string")]

use std::ffi::{CStr, CString};

use cyclors::{DDS_RETCODE_TIMEOUT, dds_return_t, dds_strretcode};
use thiserror::Error;

/// Errors of topics over Cyclone DDS.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Error {
    /// The domain cannot be joined; the reason is Cyclone's own.
    #[error("cannot join DDS domain {domain_id}: {reason}")]
    Join {
        /// Number of the domain.
        domain_id: u32,
        /// Return code and what Cyclone logged.
        reason: String,
    },
    /// Cyclone refuses an operation.
    #[error("{operation}: {reason}")]
    Refused {
        /// The attempted operation, such as `create a writer`.
        operation: &'static str,
        /// Text of the return code.
        reason: String,
    },
    /// Readers did not acknowledge earlier messages in time, so this one is not sent.
    #[error("readers are too slow, the message is dropped")]
    TooSlow,
    /// The message exceeds the limit of the domain.
    #[error("a message of {bytes} bytes exceeds the domain's limit of {limit_bytes} bytes")]
    TooLarge {
        /// Length of the message, bytes.
        bytes: usize,
        /// `max_sample_bytes` of the domain.
        limit_bytes: usize,
    },
    /// A message is shorter than the header of CDR.
    #[error("a message of {0} bytes has no CDR header of four bytes")]
    NoHeader(usize),
    /// A name with a NUL character.
    #[error("the name {0:?} contains a NUL character")]
    Name(String),
}

/// Passes a result that is not negative.
pub(crate) fn check(operation: &'static str, result: dds_return_t) -> Result<dds_return_t, Error> {
    match result {
        DDS_RETCODE_TIMEOUT => Err(Error::TooSlow),
        result if result < 0 => Err(Error::Refused { operation, reason: text(result) }),
        result => Ok(result),
    }
}

/// Returns Cyclone's text of a return code.
pub(crate) fn text(result: dds_return_t) -> String {
    // SAFETY: for every number, it returns a static string that ends with NUL.
    let text = unsafe { CStr::from_ptr(dds_strretcode(result)) };
    text.to_string_lossy().into_owned()
}

/// Converts a name.
pub(crate) fn c_string(name: &str) -> Result<CString, Error> {
    CString::new(name)
        .map_err(|error| Error::Name(String::from_utf8_lossy(&error.into_vec()).into_owned()))
}
