//! The instrument: image in, points out. Pure: no file, socket, thread, clock or `async` below this module.
//!
//! [`Pipeline`] is the whole measurement; the other modules are its steps, in the order in which a frame passes them.

pub mod image;
mod plane;
pub mod channel;
pub mod auto_channel;
pub(crate) mod ambient;
pub mod coverage;
pub mod stripe;
pub mod exposure_pair;
pub mod axis;
pub mod calibration;
pub mod camera;
pub mod laser_plane;
pub(crate) mod pose;
pub mod profile;
pub mod motion;
pub mod frame_index;
pub mod frame_error;
pub mod scan;
pub mod height_map;
pub mod params;
pub mod pipeline;
pub mod uuid;

pub use axis::{Axis, AxisKind, AxisTravel, RawPosition};
pub use calibration::Calibration;
pub use camera::Camera;
pub use frame_error::FrameError;
pub use frame_index::FrameIndex;
pub use height_map::HeightMap;
pub use laser_plane::LaserPlane;
pub use motion::{Motion, Position};
pub use params::Params;
pub use pipeline::{Output, Pipeline};
pub use profile::Profile;
pub use scan::{Scan, Slice};
