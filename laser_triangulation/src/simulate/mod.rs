//! Scene → image whose answer is known exactly. Pure: a frame is a function of the scene, the seed and its number.
//!
//! A [`scenario`] describes everything in one file; [`world`] renders any of its frames and states the exact centre of
//! the stripe. [`stripe::render_stripe`] draws one stripe whose centre the caller states: enough for tests and benchmarks.

pub mod scenario;
pub mod scene;
pub mod rig;
pub mod part;
pub mod camera;
pub mod clutter;
pub mod exposure;
pub mod noise;
pub mod speckle;
pub mod sensor;
pub mod stripe;
pub mod texture;
pub mod world;
