//! Scene → image whose answer is known exactly. Pure: a frame is a function of the scene, the seed and its number.
//!
//! [`stripe::render_stripe`] draws one stripe whose centre the caller states: enough for tests and benchmarks.

pub mod exposure;
pub mod noise;
pub mod sensor;
pub mod stripe;
