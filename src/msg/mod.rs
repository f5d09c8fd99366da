//! ROS messages and their bytes. Pure: no I/O.
//!
//! One file a ROS package. [`schema`] holds the texts and hashes, [`cdr`] turns messages into bytes and back,
//! [`convert`] translates between messages and the scanner's types.

pub mod schema;
pub mod cdr;
pub mod convert;
