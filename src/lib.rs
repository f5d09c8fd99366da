//! Laser stripe in, sub-pixel centreline and metric profile out: the library behind the `laser_profiler` node.
//!
//! Modules in reading order. Dependencies point one way, from the bottom of this list to its top:
//! `cli → {node, report → results} → {ros, bag, foxglove} → msg → scanner`; `metrology`, `simulate`, `evaluate` and
//! `calibrate` build on `scanner`.

#![cfg_attr(
    not(all(feature = "calibrate", feature = "dds", feature = "foxglove", feature = "zenoh")),
    allow(
        dead_code,
        unused_imports,
        reason = "some parts serve one feature; a build with every feature finds dead code"
    )
)]

pub use laser_triangulation::{calibrate, evaluate, metrology, scanner, simulate, statistics};

pub mod msg;
pub mod ros;
pub mod bag;
pub mod results;
pub mod report;
#[cfg(feature = "foxglove")]
pub mod foxglove;
pub mod node;
pub mod cli;
#[cfg(fuzzing)]
#[doc(hidden)]
pub mod fuzzing;
