//! Laser stripe in, sub-pixel centreline and metric profile out: the library behind the `laser_profiler` node.
//!
//! Modules in reading order. Dependencies point one way, from the bottom of this list to its top:
//! `cli → node → {ros, bag, live} → msg → scanner`; `metrology`, `simulate`, `evaluate` and `calibrate`
//! stand beside `scanner`, `report` beside `ros`.

pub mod scanner;
pub mod metrology;
pub mod simulate;
pub mod evaluate;
#[cfg(feature = "calibrate")]
pub mod calibrate;
pub mod msg;
pub mod report;
pub mod ros;
pub mod bag;
#[cfg(feature = "foxglove")]
pub mod live;
pub mod node;
pub mod cli;
