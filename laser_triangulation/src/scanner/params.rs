//! Chosen values: everything about the measurement that a user may set.
//!
//! Names, units, ranges, defaults and descriptions of the ROS parameters stand in one table,
//! `ros::parameters`; these are the values after that table has checked them.

mod motion;

pub use motion::{AxisChoice, MotionParams, MotionSource, ScanDirection};

use crate::named_enum;

use super::{frame_error::FrameError, image::PixelFormat, scan::ScanLimits};

named_enum! {
    /// Which grey level a colour pixel contributes.
    Channel {
        /// Grey images as they are; the largest of the three channels of colour and Bayer images.
        Auto = "auto",
        /// Luma of ITU-R BT.601: 0.299 R + 0.587 G + 0.114 B.
        Gray = "gray",
        /// Red.
        Red = "red",
        /// Green.
        Green = "green",
        /// Blue.
        Blue = "blue",
        /// Largest of red, green and blue.
        Max = "max",
        /// What red has above the larger of green and blue, at least 0: a red laser without white light.
        RedExcess = "red_excess",
        /// What green has above the larger of red and blue, at least 0.
        GreenExcess = "green_excess",
        /// What blue has above the larger of red and green, at least 0.
        BlueExcess = "blue_excess",
    }
}

named_enum! {
    /// Which way the stripe runs through the image.
    StripeDirection {
        /// Left to right: one point a column.
        Horizontal = "horizontal",
        /// Top to bottom: one point a row.
        Vertical = "vertical",
    }
}

named_enum! {
    /// How the centre of a cross-section is estimated.
    Method {
        /// Centroid of the thresholded cross-section, formula 7 of Yao et al. 2023.
        GrayGravity = "gray_gravity",
        /// Maximum of a Gaussian fitted to the thresholded cross-section.
        GaussianFit = "gaussian_fit",
        /// Centroid in a window about that maximum, section 3 of Yao et al. 2023.
        ImprovedGravity = "improved_gravity",
        /// Maximum likelihood for a pixel-integrated Gaussian over a background.
        GaussianMl = "gaussian_ml",
        /// Weighted least squares in the logarithm.
        LogGaussian = "log_gaussian",
        /// Zero crossing of a smoothed derivative.
        FirPeak = "fir_peak",
        /// Ridge of the image by its Hessian.
        Steger = "steger",
    }
}

named_enum! {
    /// How the window of [`Method::ImprovedGravity`] is laid over the pixels.
    GravityWindow {
        /// Ends anywhere between pixels, centred on the result until that stands still: unbiased.
        Fractional = "fractional",
        /// Rounded centre and rounded half length, as printed in the paper: locks to pixels.
        Rounded = "rounded",
    }
}

named_enum! {
    /// Which of several candidates in one cross-section is the stripe.
    PeakSelection {
        /// The one with the brightest sample after the blur.
        Brightest = "brightest",
        /// The one with the lowest row (column, for a vertical stripe).
        First = "first",
        /// The one with the highest row (column, for a vertical stripe).
        Last = "last",
        /// The one with the most samples above the segment threshold.
        Widest = "widest",
        /// The ones that together make the brightest unbroken line along the stripe.
        Continuity = "continuity",
    }
}

named_enum! {
    /// What is taken off the blurred image before the stripe is searched in it.
    Background {
        /// Nothing: the background is black.
        None = "none",
        /// What is wider across the stripe than [`ExtractionParams::background_window_px`].
        Local = "local",
        /// A stored frame without laser.
        Reference = "reference",
    }
}

named_enum! {
    /// Where the segment threshold comes from.
    Threshold {
        /// [`ExtractionParams::segment_threshold`], as in the paper.
        Fixed = "fixed",
        /// The noise of the frame itself, times [`ExtractionParams::threshold_sigmas`].
        Adaptive = "adaptive",
    }
}

named_enum! {
    /// Where the noise model comes from.
    NoiseSource {
        /// [`ExtractionParams::read_noise`] and [`ExtractionParams::shot_gain`].
        Stated = "stated",
        /// The frame itself.
        Estimated = "estimated",
    }
}

named_enum! {
    /// How frames of different exposure times follow one another.
    Exposure {
        /// All frames are exposed alike.
        Single = "single",
        /// A short one after each long one.
        Alternating = "alternating",
    }
}

/// The searched part of the image, pixels; a width or height of 0 reaches to the image's far border.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RegionOfInterest {
    /// First searched column.
    pub x_offset: u32,
    /// First searched row.
    pub y_offset: u32,
    /// Searched columns.
    pub width: u32,
    /// Searched rows.
    pub height: u32,
}

/// How the centreline is found. Grey levels are those of an 8-bit scale; deeper images are scaled to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtractionParams {
    /// Estimator of the centre.
    pub method: Method,
    /// Window of the improved gravity.
    pub window: GravityWindow,
    /// Radius r of the blur, pixels: kernel 2r + 1, 0 is off.
    pub blur_radius: u32,
    /// Blurred grey above which a pixel may be stripe.
    pub segment_threshold: f64,
    /// Smallest area of a connected region that is stripe, pixels (a region must be larger than it).
    pub min_segment_area: u32,
    /// Blurred grey above which a sample counts towards the width D.
    pub width_threshold: f64,
    /// Choice among several candidates of a cross-section.
    pub peak_selection: PeakSelection,
    /// What is taken off before the search.
    pub background: Background,
    /// What is wider across the stripe than this is local background, pixels.
    pub background_window_px: u32,
    /// Where the segment threshold comes from.
    pub threshold: Threshold,
    /// Adaptive threshold, in standard deviations of the searched image's noise above its median.
    pub threshold_sigmas: f64,
    /// Candidates whose blurred peak is less than this above the background are no stripe, grey levels.
    pub min_contrast: f64,
    /// Candidates with fewer samples above the segment threshold are no stripe.
    pub min_width_px: u32,
    /// Candidates with more samples above the segment threshold are no stripe; 0: no limit.
    pub max_width_px: u32,
    /// Points whose amplitude is less than this many standard deviations of the noise are flagged.
    pub min_snr: f64,
    /// Surfaces a cross-section may show at most.
    pub max_stripes: u32,
    /// Farthest that a stripe moves from one line to the next, pixels: for [`PeakSelection::Continuity`].
    pub max_step_px: f64,
    /// How far from the last frame's stripe it is searched, pixels; 0: everywhere.
    pub tracking_margin_px: u32,
    /// Points that are smoothed together along the stripe; 1: none.
    pub smoothing_columns: u32,
    /// Standard deviation of the Gaussian of [`Method::Steger`], pixels.
    pub ridge_sigma_px: f64,
    /// Where the noise model comes from.
    pub noise: NoiseSource,
    /// Standard deviation of the camera's read noise, grey levels.
    pub read_noise: f64,
    /// Variance of the shot noise per grey level, grey levels.
    pub shot_gain: f64,
}

impl Default for ExtractionParams {
    /// The paper's values with the fractional window.
    fn default() -> Self {
        Self {
            method: Method::ImprovedGravity,
            window: GravityWindow::Fractional,
            blur_radius: 3,
            segment_threshold: 35.0,
            min_segment_area: 500,
            width_threshold: 50.0,
            peak_selection: PeakSelection::Brightest,
            background: Background::None,
            background_window_px: 41,
            threshold: Threshold::Fixed,
            threshold_sigmas: 8.0,
            min_contrast: 0.0,
            min_width_px: 1,
            max_width_px: 0,
            min_snr: 3.0,
            max_stripes: 1,
            max_step_px: 3.0,
            tracking_margin_px: 0,
            smoothing_columns: 1,
            ridge_sigma_px: 2.2,
            noise: NoiseSource::Stated,
            read_noise: 2.0,
            shot_gain: 0.01,
        }
    }
}

/// Everything the measurement can be told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// Grey level of a colour pixel.
    pub channel: Channel,
    /// Which way the stripe runs.
    pub stripe_direction: StripeDirection,
    /// Level at which a sample is saturated, in units of the image; 0: 255 or 65535 by encoding.
    pub full_scale: u32,
    /// Searched part of the image.
    pub roi: RegionOfInterest,
    /// How frames of different exposure times follow one another.
    pub exposure: Exposure,
    /// How the centreline is found.
    pub extraction: ExtractionParams,
    /// How the part moves.
    pub motion: MotionParams,
    /// Profiles a slice.
    pub slice_profiles: u32,
    /// Points of a slice at most, missing ones included; a slice of one profile may have more.
    pub slice_max_points: usize,
    /// Profiles a scan: at so many it ends with its height map and the next begins. Bounds the memory.
    pub scan_max_profiles: u32,
}

impl Params {
    /// Where slices and scans end.
    pub const fn scan_limits(&self) -> ScanLimits {
        ScanLimits {
            slice_profiles: self.slice_profiles,
            slice_points: self.slice_max_points,
            scan_profiles: self.scan_max_profiles,
        }
    }

    /// Level at which samples of that format are saturated.
    ///
    /// # Errors
    /// A chosen level that the format cannot hold.
    pub const fn full_scale_of(&self, format: PixelFormat) -> Result<u32, FrameError> {
        let max_level = format.max_level();
        match self.full_scale {
            0 => Ok(max_level),
            chosen if chosen <= max_level => Ok(chosen),
            full_scale => Err(FrameError::FullScale { full_scale, max_level }),
        }
    }
}
