//! The instrument: image in, points out. Pure: no file, socket, thread, clock or `async` below this module.
//!
//! [`Pipeline`](pipeline::Pipeline) is the whole measurement; the other modules are its steps, in the order in which a frame meets them.

pub mod image;
pub mod channel;
pub mod ambient;
pub mod coverage;
pub mod stripe;
pub mod exposure_pair;
pub mod axis;
pub mod calibration;
pub mod camera;
pub mod laser_plane;
pub mod pose;
pub mod profile;
pub mod motion;
pub mod frame_index;
pub mod frame_error;
pub mod scan;
pub mod height_map;
pub mod params;
pub mod pipeline;
pub mod uuid;
