//! The node on DDS among peers that are not ours: Cyclone DDS from Python and C, Fast DDS from C++.

mod domain;
mod peer;
mod node;

mod topics;
mod services;
mod graph;
mod discovery;
mod volume;
mod process;
mod load;
mod bad_input;
