//! Laser stripe in, sub-pixel centreline and metric profile out: the library behind the `laser_profiler` node.
//!
//! Modules in reading order. Dependencies point one way, from the bottom of this list to its top:
//! `cli → node → {ros, bag, foxglove} → msg → scanner`; `metrology`, `simulate`, `evaluate` and `calibrate`
//! stand beside `scanner`, `report` beside `ros`.

pub use laser_triangulation::{calibrate, evaluate, metrology, scanner, simulate, statistics};

pub mod msg;
pub mod report;
pub mod ros;
pub mod bag;
#[cfg(feature = "foxglove")]
pub mod foxglove;
pub mod node;
pub mod cli;
