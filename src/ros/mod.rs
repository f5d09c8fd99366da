//! What makes this a ROS 2 node without ROS: names, remaps, arguments, parameters and the middleware. Edge: reads
//! parameter files, talks to the network.

pub mod names;
pub mod arguments;
pub mod value;
pub mod table;
pub mod parameter_file;
pub mod parameters;
pub mod node_params;
pub mod transport;
#[cfg(feature = "zenoh")]
pub mod zenoh;
#[cfg(test)]
pub(crate) mod loopback;
