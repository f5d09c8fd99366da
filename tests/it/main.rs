//! All tests of the public interface, in one binary, which links once.
#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "tests fail by panicking and report skips on stderr"
)]

mod opencv;
mod program;
#[cfg(any(feature = "dds", feature = "zenoh"))]
mod live;
#[cfg(feature = "calibrate")]
mod calibrate;
mod real_scenes;
mod hard_scenes;
mod sigma_truth;
mod recordings;

mod accuracy;
mod evaluate;
mod estimators;
mod steps;
mod gauges;
mod measure;
mod older_results;
mod report;
mod metrology;
mod calibration_share;
mod level;
mod ambient;
mod bright_scene;
mod labelled_scenes;
mod alternating_exposures;
mod positions;
mod standing;
mod nothing_found;
mod suggest;
mod smoothing;
mod allocation;
mod camera_info;
mod cli;
mod coverage;
mod determinism;
mod memory;
mod pictures;
mod bad_bags;
mod bombs;
mod containers;
mod bad_images;
mod encodings;
mod bad_output;
mod hostile_names;
mod interop;
mod browser;
mod rerun;
mod interfaces;
mod tidy;
#[cfg(feature = "foxglove")]
mod view;
#[cfg(feature = "foxglove")]
mod view_attacks;
mod launch_configs;
mod launch_files;
mod packaging;
#[cfg(feature = "zenoh")]
mod zenoh;
#[cfg(feature = "dds")]
mod dds;
