//! Reasons to reject a frame.

use thiserror::Error;

use super::{
    ambient::AmbientError,
    channel::{ChannelError, RoiError},
    params::FullScaleError,
};

/// Reason why a frame cannot be measured with these parameters.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum FrameError {
    /// The region of interest does not fit.
    #[error(transparent)]
    Roi(#[from] RoiError),
    /// The reference frame without laser does not fit.
    #[error(transparent)]
    Ambient(#[from] AmbientError),
    /// The image is not of the calibrated size.
    #[error(
        "the image has {} x {} pixels, the calibration is of {} x {}: calibrate at this size, or state binning and roi \
         in camera_info", .image.0, .image.1, .calibrated.0, .calibrated.1
    )]
    Size {
        /// Columns and rows of the image.
        image: (u32, u32),
        /// Columns and rows of the calibrated images.
        calibrated: (u32, u32),
    },
    /// The image does not have the channel.
    #[error(transparent)]
    Channel(#[from] ChannelError),
    /// The saturation level exceeds the range of the samples.
    #[error(transparent)]
    FullScale(#[from] FullScaleError),
}
