//! Tests the live node through an in-process middleware.

mod actions;
mod cameras;
mod driver;
mod listener;
mod lifecycle;
mod network;
mod panics;
mod parameters;
mod positions;
mod recordings;
mod replayed;
mod rig;
mod scans;
mod stream;
#[cfg(feature = "foxglove")]
mod viewed;
#[cfg(feature = "foxglove")]
mod viewer;

use listener::Received;
