//! The live node: cameras on the middleware, and all that ROS users see of a node.
//!
//! Every camera has a worker of its own behind a queue that drops the oldest image; it is the worker of a replay, with
//! the middleware and the recorder as its sinks.

pub mod error;
mod feed;
mod publications;
mod notes;
mod camera;
mod setup;
pub mod session;
mod node;
mod services;
