//! Conversions between messages and the scanner's types: images in, results out. Borrows wherever possible.

mod encoding;
mod jpeg;
mod png;
mod strict_jpeg;
pub(crate) mod decode;
pub(crate) mod file_kind;
pub(crate) mod picture_message;
pub(crate) mod frame;
pub mod compressed;
pub(crate) mod results;
pub mod cloud;
pub(crate) mod annotations;
pub(crate) mod preview;
pub(crate) mod tf;

pub(crate) use frame::FrameRejected;
