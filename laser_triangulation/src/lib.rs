//! Laser triangulation: from the image of a laser stripe to sub-pixel centrelines, metric profiles, scans and height maps,
//! each with its uncertainty.
//!
//! # Example: from a picture to a height map
//!
//! A block moves through the laser plane. Each picture shows one cross-section of it. Here the pictures are simulated, so
//! the result can be compared with the ground truth.
//!
//! ```
//! use laser_triangulation::{
//!     metrology::height_map::{CellState, GridLayout, Resampler},
//!     nalgebra::Point3,
//!     scanner::{
//!         calibration::{Calibration, Lines},
//!         channel::SearchedRegion,
//!         image::{Image, PixelFormat},
//!         params::{ExtractionParams, StripeDirection},
//!         profile::Profile,
//!         stripe::Extractor,
//!     },
//!     simulate::{scenario::Scenario, world::RenderedFrame},
//! };
//!
//! // A block of 12 mm x 10 mm, 4.0 mm high, under a film of 0.2 mm. 0.5 mm of motion per frame.
//! let scenario = Scenario::from_yaml("
//! frames: 17
//! frame_rate_hz: 20.0
//! start_time_ns: 0
//! seed: 1
//! motion: {start_m: 0.001, step_m: 0.0005}
//! laser: {amplitude: 183.0, sigma_px: 2.3}
//! camera:
//!   width_px: 160
//!   height_px: 96
//!   image_distance_m: 0.026
//!   object_distance_m: 0.3
//!   beta_rad: 0.5236
//!   pixel_pitch_m: 9.6e-6
//!   base_row_px: 75.0
//!   center_column_px: 79.5
//!   height_sign: -1
//! part:
//!   table_reflectance: 0.5
//!   cell: {width_m: 0.012, length_m: 0.010, height_m: 0.004, reflectance: 0.8}
//!   film: {margin_m: 0.001, thickness_m: 0.0002, reflectance: 1.0}
//! ")?;
//! let calibration = Calibration::from_yaml(&scenario.camera.calibration_yaml())?;
//!
//! let direction = StripeDirection::Horizontal;
//! // The default minimum of 500 px is for larger pictures.
//! let params = ExtractionParams { min_segment_area: 50, ..ExtractionParams::default() };
//! let mut extractor = Extractor::new(params, direction);
//! let mut profile = Profile::default();
//! // Cells of 0.5 mm on the film. Points are 0.11 mm apart along x and 0.5 mm along y.
//! let layout = GridLayout { origin_m: [-0.004, 0.002], cell_m: 0.0005, width: 16, height: 12 };
//! let mut grid = Resampler::new(layout, [0.00011, 0.0005]);
//!
//! let mut frame = RenderedFrame::default();
//! for number in 0..scenario.frames {
//!     scenario.render(number, &mut frame);
//!     let image = Image::packed(160, 96, PixelFormat::Mono8, &frame.samples)?;
//!
//!     // Picture -> centreline, in pixels.
//!     let line = extractor.extract(&image);
//!     for (truth, (u_px, v_px)) in frame.truth[40..120].iter().zip(line.u_px.iter().zip(&line.v_px).skip(40)) {
//!         assert!((f64::from(*v_px) - truth.center_px).abs() < 0.05, "column {u_px}");
//!     }
//!
//!     // Centreline -> profile, in metres.
//!     let lines = Lines::new(direction, &SearchedRegion::whole(&image));
//!     calibration.triangulate(line, &lines, image.format().max_level(), &mut profile);
//!     assert_eq!(profile.z_m.len(), 160);
//!
//!     // Profiles -> height map.
//!     let y_m = scenario.position_m(number);
//!     let points = profile.x_m.iter().zip(&profile.z_m);
//!     let points: Vec<_> = points.map(|(&x, &z)| Point3::new(x.into(), y_m, z.into())).collect();
//!     grid.push(&points);
//! }
//! let map = grid.finish();
//! assert_eq!(map.count(CellState::Measured), 16 * 12);
//! assert!(map.z_m.iter().all(|z_m| (z_m - 0.0042).abs() < 20e-6));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Three more examples are complete programs: `extract_folder`, `write_cloud` and `calibrate_from_pictures` in `examples/`.
//!
//! # Three levels
//!
//! 1. [`scanner::pipeline::Pipeline`] takes frames and returns centrelines, profiles, slices of a point cloud and the height
//!    map of a scan. It counts missing and rejected frames.
//! 2. [`scanner::stripe::Extractor::extract`], [`scanner::calibration::Calibration::triangulate`] and
//!    [`scanner::scan::Scan::push`] are its steps, for your own loop. [`scanner::calibration::Triangulator`] adds the
//!    calibration's uncertainty of each height.
//! 3. [`scanner::channel::Decoder`] and [`scanner::stripe::Extractor::extract_plane`] work on buffers that you own: a region
//!    of interest, one colour channel, 10 or 12 bits in 16, padded rows.
//!
//! All three reuse their buffers: after the first frames of a size they do not allocate.
//!
//! # Modules
//!
//! | module | purpose |
//! |---|---|
//! | [`scanner`] | the instrument: image in, centreline, profile, scan and height map out |
//! | [`calibrate`] | from pictures of known objects to the calibration of camera, laser plane and axis |
//! | [`metrology`] | measurements on points: planes, steps, spheres, volumes, regular height maps |
//! | [`simulate`] | pictures with exactly known ground truth |
//! | [`evaluate`] | the accuracy of extraction methods against ground truth and against the Cramér–Rao bound |
//! | [`statistics`] | medians, quantiles and robust standard deviations |
//!
//! # Guarantees and limits
//!
//! - The same images give the same bits with every level of vector instructions that the machine has.
//! - Every centre has a standard deviation, and tests compare it with the scatter about the ground truth.
//! - The crate has no I/O: no file, socket, thread or clock, and no `unsafe` code. It does not decode PNG or JPEG and does
//!   not write point clouds; the examples show both.
//!
//! # Features
//!
//! - `calibrate` (off by default): camera, laser plane and axis from images of boards and markers.

#![cfg_attr(
    not(feature = "calibrate"),
    allow(dead_code, reason = "a build with every feature finds dead code")
)]

mod named_enum;

pub use nalgebra;

pub mod parameters;
pub mod statistics;
pub mod scanner;
pub mod metrology;
pub mod simulate;
pub mod evaluate;
pub mod calibrate;

/// Runs the example of the README as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
