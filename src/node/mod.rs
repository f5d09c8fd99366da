//! The node: threads, bounds and counters around the pure pipeline.
//!
//! A source yields raw image messages. A `queue` passes them to the camera's only worker, which owns the pipeline. The
//! fan-out sends the same bytes to every sink, directly or through a queue. `run` connects them.

pub(crate) mod queue;
mod named;
pub(crate) mod order;
pub(crate) mod histogram;
pub(crate) mod statistics;
pub mod stop;
pub(crate) mod scan_watch;
pub(crate) mod command;
pub(crate) mod unpack;
pub(crate) mod source;
pub mod sink;
pub(crate) mod watch;
pub(crate) mod fan_out;
pub(crate) mod topics;
pub(crate) mod allowed_directories;
mod named_file;
pub(crate) mod calibration_file;
mod only_topic;
pub(crate) mod ambient;
pub(crate) mod sampled;
pub(crate) mod ambient_file;
pub(crate) mod input;
pub(crate) mod positions;
pub(crate) mod camera;
pub(crate) mod status;
pub(crate) mod board;
pub(crate) mod parameter_server;
pub(crate) mod publisher;
pub(crate) mod results;
pub(crate) mod worker;
pub(crate) mod endpoints;
pub(crate) mod clock;
pub(crate) mod lifecycle;
pub(crate) mod rosout;
pub(crate) mod static_tf;
pub(crate) mod camera_info;
pub(crate) mod player;
pub mod recording;
pub mod live_recording;
mod feed;
pub(crate) mod run;
pub mod replay;
pub(crate) mod live;
#[cfg(feature = "foxglove")]
pub(crate) mod view;

#[cfg(test)]
mod tests;
