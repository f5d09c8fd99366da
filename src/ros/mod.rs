//! A ROS 2 node without a ROS installation: names, remaps, arguments, parameters and the middleware. Edge: reads
//! parameter files and uses the network.

pub mod names;
pub mod arguments;
pub(crate) mod value;
pub(crate) mod table;
pub(crate) mod parameter_file;
pub(crate) mod qos_overrides;
pub mod parameters;
pub mod camera_params;
pub mod node_params;
pub mod transport;
pub(crate) mod middleware;
pub(crate) mod process;
#[cfg(feature = "zenoh")]
pub mod zenoh;
#[cfg(feature = "dds")]
pub mod dds;
#[cfg(test)]
pub(crate) mod loopback;
