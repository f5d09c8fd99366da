//! What makes this a ROS 2 node without ROS: names, remaps, arguments and parameters. Edge: reads parameter files.

pub mod names;
pub mod arguments;
pub mod value;
pub mod table;
pub mod parameter_file;
pub mod parameters;
pub mod node_params;
