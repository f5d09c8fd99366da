//! The node on DDS among peers that are not ours: Cyclone DDS from Python and C, Fast DDS from C++.

mod domain;
mod network;
mod peer;
mod node;

mod topics;
mod services;
mod large_replies;
mod graph;
mod discovery;
mod volume;
mod process;
mod line;
mod replaced;
mod hostile;
mod load;
mod bad_input;
#[cfg(feature = "cyclone")]
mod cyclone;
