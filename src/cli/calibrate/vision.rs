//! The subcommands that need the feature `calibrate`: they find boards and markers in pictures.

mod axis;
mod axis_answer;
mod axis_pictures;
mod boards;
mod camera;
mod charts;
mod file;
mod joint;
mod pictures;
mod plane;
mod plane_answer;
mod rejected;
mod report;
mod stripes;

pub(super) use axis::run as axis;
pub(super) use camera::run as camera;
pub(super) use plane::run as plane;

use super::args;
