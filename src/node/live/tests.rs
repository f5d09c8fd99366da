//! The live node as its network sees it: over a middleware inside the process.

mod cameras;
mod driver;
mod ear;
mod lifecycle;
mod network;
mod parameters;
mod positions;
mod recordings;
mod replayed;
mod rig;
mod scans;
mod stream;

use ear::Heard;
