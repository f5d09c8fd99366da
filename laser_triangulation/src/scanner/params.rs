//! All parameters of the measurement, one row each: field, type, default, name, range, unit and description.
//!
//! These rows define the ROS parameters, the parameter file and `docs/parameters.md`.

mod motion;

pub use motion::{AxisChoice, MotionParams, MotionSource, ScanDirection};

use thiserror::Error;

use crate::{named_enum, parameter_group};

use super::{
    image::{MAX_SIDE_PX, PixelFormat},
    scan::{MAX_SLICE_POINTS, ScanLimits},
};

// Largest side in the rows below, which the documentation of a field shows as a number.
const _: () = assert!(MAX_SIDE_PX == 65_535);

named_enum! {
    /// Grey level of a colour pixel.
    Channel {
        /// Of colour and Bayer images, the channel that shows the line least clipped, chosen once for a scan; outside a
        /// pipeline, the largest of the three colours. Grey images unchanged.
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
        /// Red minus the larger of green and blue, at least 0: a red laser without white light.
        RedExcess = "red_excess",
        /// Green minus the larger of red and blue, at least 0.
        GreenExcess = "green_excess",
        /// Blue minus the larger of red and green, at least 0.
        BlueExcess = "blue_excess",
    }
}

named_enum! {
    /// Direction of the stripe in the image.
    StripeDirection {
        /// Left to right: one point per column.
        Horizontal = "horizontal",
        /// Top to bottom: one point per row.
        Vertical = "vertical",
    }
}

named_enum! {
    /// Estimator of the centre of a cross-section.
    Method {
        /// Centroid of the thresholded cross-section, formula 7 of Yao et al. 2023.
        GrayGravity = "gray_gravity",
        /// Maximum of a Gaussian fitted to the thresholded cross-section.
        GaussianFit = "gaussian_fit",
        /// Centroid in a window around that maximum, section 3 of Yao et al. 2023.
        ImprovedGravity = "improved_gravity",
        /// Maximum likelihood for a pixel-integrated Gaussian over a background.
        GaussianMl = "gaussian_ml",
        /// Weighted least squares on the logarithm of the samples.
        LogGaussian = "log_gaussian",
        /// Zero crossing of a smoothed derivative.
        FirPeak = "fir_peak",
        /// Ridge of the image by its Hessian.
        Steger = "steger",
    }
}

named_enum! {
    /// Position of the window of [`Method::ImprovedGravity`] relative to the pixels.
    GravityWindow {
        /// Fractional ends, centred on the result by iteration until it converges: unbiased.
        Fractional = "fractional",
        /// Rounded centre and rounded half length, as printed in the paper: biased towards whole pixels.
        Rounded = "rounded",
    }
}

named_enum! {
    /// Selection of the stripe among several candidates in one cross-section.
    PeakSelection {
        /// The candidate with the brightest sample after the blur.
        Brightest = "brightest",
        /// The candidate with the lowest row (column, for a vertical stripe).
        First = "first",
        /// The candidate with the highest row (column, for a vertical stripe).
        Last = "last",
        /// The candidate with the most samples above the segment threshold.
        Widest = "widest",
        /// The candidates that together form the brightest unbroken line along the stripe.
        Continuity = "continuity",
    }
}

named_enum! {
    /// Background subtracted from the blurred image before the search.
    Background {
        /// No subtraction: the background is black.
        None = "none",
        /// Everything wider across the stripe than [`ExtractionParams::background_window_px`].
        Local = "local",
        /// A stored frame without laser.
        Reference = "reference",
    }
}

named_enum! {
    /// Source of the segment threshold.
    Threshold {
        /// [`ExtractionParams::segment_threshold`], as in the paper.
        Fixed = "fixed",
        /// The noise of each frame, times [`ExtractionParams::threshold_sigmas`].
        Adaptive = "adaptive",
    }
}

named_enum! {
    /// Source of the noise model.
    NoiseSource {
        /// [`ExtractionParams::read_noise`] and [`ExtractionParams::shot_gain`].
        Stated = "stated",
        /// Estimated from each frame.
        Estimated = "estimated",
    }
}

named_enum! {
    /// Sequence of exposure times.
    Exposure {
        /// All frames have the same exposure time.
        Single = "single",
        /// Short and long exposures in turn.
        Alternating = "alternating",
    }
}

parameter_group! {
    /// Region of interest: the searched part of the image, pixels.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct RegionOfInterest {
        /// First column of the region of interest. A region without reflections is more robust and faster.
        x_offset: u32 = 0 => ["roi.x_offset", 0..=65_535, "px"],
        /// First row of the region of interest.
        y_offset: u32 = 0 => ["roi.y_offset", 0..=65_535, "px"],
        /// Width of the region of interest; 0: up to the right border.
        width: Option<u32> = None => ["roi.width", 0..=65_535, "px"],
        /// Height of the region of interest; 0: down to the lower border. Processing time grows with width x height.
        height: Option<u32> = None => ["roi.height", 0..=65_535, "px"],
    }
}

parameter_group! {
    /// Parameters of the extraction. Grey levels are those of an 8-bit scale; deeper images are scaled to it. In a field
    /// of type `Option`, `None` stands for the 0 of the parameter. [`check_ranges`](Self::check_ranges) tests the ranges.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct ExtractionParams {
        /// Estimator of the stripe's centre in a cross-section. improved_gravity: centroid in a window around a fitted
        /// maximum; gaussian_fit: for narrow, unsaturated stripes; gray_gravity: plain centroid, biased by background;
        /// gaussian_ml: maximum likelihood, the most accurate for single cross-sections, saturated or not;
        /// log_gaussian: its fast approximation; fir_peak: zero of the derivative, for asymmetric stripes; steger:
        /// ridge of the image, averages along the stripe.
        method: Method = Method::ImprovedGravity => ["extraction.method"],
        /// Window of improved_gravity. fractional: unbiased; rounded: as printed in the paper, biased towards whole
        /// pixels, for comparison only.
        window: GravityWindow = GravityWindow::Fractional => ["extraction.window"],
        /// Radius r of the Gaussian blur that suppresses speckle and noise, kernel size 2r + 1; 0: off. A stripe
        /// narrower than r is smeared, and processing time grows with r.
        blur_radius: u32 = 3 => ["extraction.blur_radius", 0..=15, "px"],
        /// Grey level of the blurred image above which a pixel may belong to the stripe, for threshold fixed. Set it
        /// above the ambient light and below the weakest part of the stripe; deeper images are scaled to 8 bits.
        segment_threshold: f64 = 35.0 => ["extraction.segment_threshold", 0.0..=255.0, "grey levels of an 8-bit scale"],
        /// Connected regions of at most this area are rejected, which removes speckle and small reflections. Lower it
        /// for short stripes and small images.
        min_segment_area: u32 = 500 => ["extraction.min_segment_area", 0..=10_000_000, "px"],
        /// Grey level of the blurred image above which a sample counts towards the stripe width D. The window of
        /// improved_gravity is two thirds of D.
        width_threshold: f64 = 50.0 => ["extraction.width_threshold", 0.0..=255.0, "grey levels of an 8-bit scale"],
        /// Selects the stripe among several candidates in a cross-section. brightest: most scenes; first, last: if
        /// reflections always lie on the other side; widest: most samples above the threshold; continuity: the
        /// candidates that form the brightest unbroken line, for scenes with bright clutter or a halo around the
        /// stripe.
        peak_selection: PeakSelection = PeakSelection::Brightest => ["extraction.peak_selection"],
        /// Background subtracted before the search. none: no subtraction; local: everything wider across the stripe
        /// than background_window (white top-hat), for ambient light and bright objects, several times slower;
        /// reference: background_file, a frame without laser from the same place.
        background: Background = Background::None => ["extraction.background"],
        /// Structures wider across the stripe than this count as local background; even values are rounded up to odd
        /// ones. At least twice the width of the widest stripe; lower values reject more clutter.
        background_window_px: u32 = 41 => ["extraction.background_window", 3..=1001, "px"],
        /// Source of the segment threshold. fixed: segment_threshold; adaptive: threshold_sigmas times the noise of
        /// each frame above its median, which scales width_threshold too and requires an even or subtracted background.
        threshold: Threshold = Threshold::Fixed => ["extraction.threshold"],
        /// Adaptive threshold: distance from the median of the searched image, in standard deviations of its noise.
        /// Higher values give fewer false positives, but miss weak stripes.
        threshold_sigmas: f64 = 8.0 => ["extraction.threshold_sigmas", 1.0..=1000.0, "standard deviations"],
        /// Candidates whose blurred peak is less than this above the background are rejected; 0: no limit.
        min_contrast: f64 = 0.0 => ["extraction.min_contrast", 0.0..=255.0, "grey levels of an 8-bit scale"],
        /// Candidates with fewer samples above the threshold are rejected.
        min_width_px: u32 = 1 => ["extraction.min_width", 1..=65_535, "px"],
        /// Candidates with more samples above the threshold are rejected; 0: no limit.
        max_width_px: Option<u32> = None => ["extraction.max_width", 0..=65_535, "px"],
        /// Signal-to-noise ratio below which a point is flagged LOW_CONTRAST: its amplitude in standard deviations of
        /// the noise.
        min_snr: f64 = 3.0 => ["extraction.min_snr", 0.0..=1000.0, "standard deviations"],
        /// Largest number of stripes in a cross-section, for surfaces such as glass, a film over a part or a wall
        /// behind it. Additional ones are published as separate stripes; the profile contains the first.
        max_stripes: u32 = 1 => ["extraction.max_stripes", 1..=8, "stripes"],
        /// For peak_selection continuity: a larger step of the stripe from one column (row, if vertical) to the next is
        /// a break in the line.
        max_step_px: f64 = 3.0 => ["extraction.max_step", 0.1..=1000.0, "px"],
        /// Searches only within this distance of the last frame's stripe, and the whole region again if less than half
        /// of its points are found. 0: always the whole region.
        tracking_margin_px: Option<u32> = None => ["extraction.tracking_margin", 0..=65_535, "px"],
        /// Number of points smoothed together along the stripe, odd; 1: no smoothing. Noise falls with its square root;
        /// steps and grooves above the noise are preserved.
        smoothing_columns: u32 = 1 => ["extraction.smoothing_columns", 1..=255, "points"],
        /// Standard deviation of the Gaussian of method steger: approximately that of the stripe.
        ridge_sigma_px: f64 = 2.2 => ["extraction.ridge_sigma", 0.5..=10.0, "px"],
        /// Noise model of gaussian_ml and of the stated uncertainty. stated: read_noise and shot_gain; estimated: from
        /// each frame.
        noise: NoiseSource = NoiseSource::Stated => ["extraction.noise"],
        /// Standard deviation of the camera's noise in the dark, for gaussian_ml and the stated uncertainty (sigma).
        /// Measure it with the lens covered.
        read_noise: f64 = 2.0 => ["extraction.read_noise", 0.0..=100.0, "grey levels of an 8-bit scale"],
        /// Variance of the shot noise per grey level, for gaussian_ml and the stated uncertainty (sigma): 255 /
        /// full-well capacity in electrons.
        shot_gain: f64 = 0.01 => ["extraction.shot_gain", 0.0..=10.0, "grey levels of an 8-bit scale"],
    }
}

parameter_group! {
    /// All parameters of the measurement.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Params {
        /// Grey level of a colour or Bayer pixel, the latter after bilinear demosaicing; grey images are used
        /// unchanged; of YUV images only the luma is read. auto: of red, green, blue and gray the one that clips
        /// the line least, chosen in the first frame that shows it and held for the scan; max: the largest of the three
        /// colours; gray: luma of BT.601; red, green, blue: best contrast if it is the laser's colour and not saturated;
        /// red_excess, green_excess, blue_excess: that colour minus the larger of the other two, which removes white
        /// light, but also the core of a saturated line.
        channel: Channel = Channel::Auto => ["channel"],
        /// Direction of the stripe in the image. horizontal: one point per column; vertical: one point per row.
        stripe_direction: StripeDirection = StripeDirection::Horizontal => ["stripe_direction"],
        /// Grey level from which a sample counts as saturated, and to which thresholds are scaled; 0: the maximum of the
        /// encoding, 255 or 65535, and 235 for YUV, the white of its limited range. Set 4095 for 12-bit data in mono16,
        /// otherwise thresholds and saturation are wrong, and 255 for a YUV camera of full range.
        full_scale: Option<u32> = None => ["full_scale", 0..=65_535, "grey levels of the image"],
        /// Region of interest.
        roi: RegionOfInterest = RegionOfInterest::default() => group,
        /// Sequence of exposure times. alternating: short and long frames in turn; points saturated or missing in the
        /// long frame come from the short one a period earlier, and are off by up to one motion step.
        exposure: Exposure = Exposure::Single => ["exposure"],
        /// Search and measurement of the centreline.
        extraction: ExtractionParams = ExtractionParams::default() => group,
        /// Motion of the part and its source.
        motion: MotionParams = MotionParams::default() => group,
        /// Profiles in one published slice of the point cloud; 100 profiles are some megabytes. Fewer give less delay
        /// and smaller messages; a slice never exceeds 2^26 points (1 GiB).
        slice_profiles: u32 = 100 => ["slice.profiles", 1..=10_000, "profiles"],
        /// Largest number of points in a slice, missing ones included; a slice of one profile may have more. Computed,
        /// not set by a user.
        slice_max_points: usize = MAX_SLICE_POINTS => computed,
        /// Profiles in one scan; the next profile starts a new scan with its own height map. Limits the memory to four
        /// bytes per point; a scan never exceeds 2^28 points (1 GiB of heights).
        scan_max_profiles: u32 = 5_000 => ["scan.max_profiles", 1..=1_000_000, "profiles"],
    }
}

/// A saturation level above the largest level of the image.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("full_scale is {full_scale}, but samples of this encoding end at {max_level}")]
pub struct FullScaleError {
    /// Value of the parameter.
    pub full_scale: u32,
    /// Largest level of the encoding.
    pub max_level: u32,
}

impl Params {
    /// Returns the limits of slices and scans.
    pub(crate) const fn scan_limits(&self) -> ScanLimits {
        ScanLimits {
            slice_profiles: self.slice_profiles,
            slice_points: self.slice_max_points,
            scan_profiles: self.scan_max_profiles,
        }
    }

    /// Returns the level from which samples of that format are saturated.
    ///
    /// # Errors
    /// `full_scale` exceeds the largest level of the format.
    pub const fn full_scale_of(&self, format: PixelFormat) -> Result<u32, FullScaleError> {
        let max_level = format.max_level();
        match self.full_scale {
            None => Ok(format.white_level()),
            Some(chosen) if chosen <= max_level => Ok(chosen),
            Some(full_scale) => Err(FullScaleError { full_scale, max_level }),
        }
    }
}

#[cfg(test)]
mod tests;
