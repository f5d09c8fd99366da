//! Laser triangulation: from the image of a laser stripe to sub-pixel centrelines, metric profiles, scans and height maps.
//!
//! Everything here computes: no file, socket, thread or clock.

mod named_enum;

pub mod parameters;
pub mod statistics;
pub mod scanner;
pub mod metrology;
pub mod simulate;
pub mod evaluate;
pub mod calibrate;
