//! Between messages and the scanner's types: images in, results out. Nothing is copied that can be borrowed.

pub mod frame;
pub mod compressed;
pub mod results;
pub mod cloud;
pub mod annotations;
pub mod preview;
pub mod tf;

pub use frame::FrameRejected;
