//! ROS messages and their bytes. Pure: no I/O.
//!
//! [`schema`] defines message types, [`cdr`] converts messages to and from bytes, and [`convert`] translates between
//! messages and the scanner's types. The other modules contain the messages, one file per ROS package; fields and units
//! are those of the `.msg` files. Large arrays and text are borrowed: by a decoded message from its bytes, by a
//! published one from the scanner's buffers.

pub mod schema;
pub mod qos;
pub mod cdr;
mod text;
pub mod printable;
pub mod builtin_interfaces;
pub mod std_msgs;
pub mod std_srvs;
pub mod geometry_msgs;
pub mod tf2_msgs;
pub mod sensor_msgs;
pub(crate) mod unique_identifier_msgs;
pub mod action_msgs;
pub(crate) mod diagnostic_msgs;
pub mod rosgraph_msgs;
pub mod lifecycle_msgs;
pub mod rosout;
pub(crate) mod rcl_interfaces;
pub(crate) mod foxglove_msgs;
pub mod laser_profiler_msgs;
pub(crate) mod recorded_profile;
pub mod convert;
#[cfg(test)]
mod noise;
