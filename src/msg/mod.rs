//! ROS messages and their bytes. Pure: no I/O.
//!
//! [`schema`] says what a message type is, [`cdr`] turns messages into bytes and back, [`convert`] translates between
//! messages and the scanner's types. Between them stand the messages, one file a ROS package; fields and units are
//! those of the `.msg` files. Arrays and text borrow where a copy would cost: a decoded message from its bytes, a
//! published one from the scanner's buffers.

pub mod schema;
pub mod qos;
pub mod cdr;
mod text;
pub mod builtin_interfaces;
pub mod std_msgs;
pub mod std_srvs;
pub mod geometry_msgs;
pub mod tf2_msgs;
pub mod sensor_msgs;
pub(crate) mod unique_identifier_msgs;
pub(crate) mod diagnostic_msgs;
pub mod rosgraph_msgs;
pub mod lifecycle_msgs;
pub mod rosout;
pub(crate) mod rcl_interfaces;
pub(crate) mod foxglove_msgs;
pub mod laser_profiler_msgs;
pub mod convert;
#[cfg(test)]
mod noise;
