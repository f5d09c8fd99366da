//! Calibration: computes the file that converts pixels to metres from images of known targets.
//!
//! Every result depends only on the images: no file, socket, thread or clock.
//!
//! | entry point | input | result |
//! |---|---|---|
#![cfg_attr(
    feature = "calibrate",
    doc = "| [`calibrate_camera`] | views of a [`Target`] | the camera and its lens |"
)]
#![cfg_attr(
    feature = "calibrate",
    doc = "| [`LaserLines::find`], [`calibrate_plane`] | views of the board with the laser's line on it | the laser plane |"
)]
#![cfg_attr(
    feature = "calibrate",
    doc = "| [`calibrate_axis`] | markers or a board that move with the part, and stated positions | the axis |"
)]
//! | [`calibrate_steps`] | known heights: a step gauge, gauge blocks, or a moved flat | a projective map, or formula 6 |
//! | [`level_part`] | a scanned plane | the part's frame levelled on it |
//!
//! The first three need the feature `calibrate`.

mod level;
mod median_stripe;
mod steps;
#[cfg(feature = "calibrate")]
mod vision;

pub use level::level_part;
pub use median_stripe::{GaugePicture, GaugeStripe, MedianStripe, MedianStripeError};
pub use steps::{
    GaugeHeight, GaugePlateau, HeightModel, HeightReference, HeightTerms, KnownDistance,
    KnownLateral, KnownLength, LateralScale, LineBow, MIN_HEIGHTS, Plateau, PlateauCheck,
    PlateauError, StepsCalibration, StepsError, StepsRequest, VerticalGeometry,
    VerticalIncidenceError, assign_heights, calibrate_steps, find_plateaus, vertical_incidence,
};
#[cfg(feature = "calibrate")]
pub use vision::*;
