//! The node: threads, bounds and counters around the pure pipeline.
//!
//! A source yields raw image messages; a [`queue`] hands them to the one worker of the camera, which owns the
//! pipeline; the fan-out gives every sink the same bytes through a queue of its own. run ties them together.

pub mod queue;
mod named;
pub mod order;
pub mod histogram;
pub mod statistics;
pub mod stop;
pub mod command;
pub mod unpack;
pub mod source;
pub mod sink;
pub mod fan_out;
pub mod topics;
pub mod calibration_file;
pub mod ambient;
pub mod ambient_file;
pub mod input;
pub mod positions;
pub mod camera;
pub mod status;
pub mod parameter_server;
pub mod publisher;
pub mod results;
pub mod worker;
pub mod endpoints;
pub mod clock;
pub mod lifecycle;
pub mod rosout;
pub mod static_tf;
pub mod camera_info;
pub mod player;
pub mod recording;
pub mod live_recording;
mod feed;
pub mod run;
pub mod replay;
pub mod live;
#[cfg(feature = "foxglove")]
pub mod view;

#[cfg(test)]
mod tests;
