//! Every parameter of the measurement, one row each: field, type, default, name, range, unit and description.
//!
//! The ROS table, the parameter file and `docs/parameters.md` are made from these rows.

mod motion;

pub use motion::{AxisChoice, MotionParams, MotionSource, ScanDirection};

use thiserror::Error;

use crate::{named_enum, parameter_group};

use super::{
    image::{MAX_SIDE_PX, PixelFormat},
    scan::{MAX_SLICE_POINTS, ScanLimits},
};

const MAX_SIDE: i64 = MAX_SIDE_PX as i64;

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

parameter_group! {
    /// The searched part of the image, pixels.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct RegionOfInterest {
        /// First searched column. A region without reflections is both safer and faster.
        x_offset: u32 = 0 => ["roi.x_offset", 0..=MAX_SIDE, "px"],
        /// First searched row.
        y_offset: u32 = 0 => ["roi.y_offset", 0..=MAX_SIDE, "px"],
        /// Searched columns; 0 reaches to the right border.
        width: Option<u32> = None => ["roi.width", 0..=MAX_SIDE, "px"],
        /// Searched rows; 0 reaches to the lower border. Time grows with width x height.
        height: Option<u32> = None => ["roi.height", 0..=MAX_SIDE, "px"],
    }
}

parameter_group! {
    /// How the centreline is found. Grey levels are those of an 8-bit scale; deeper images are scaled to it.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct ExtractionParams {
        /// Estimator of the stripe's centre in a cross-section. improved_gravity: centroid in a window about a fitted
        /// maximum, the paper's. gaussian_fit suits narrow, unsaturated stripes; gray_gravity is the plain centroid,
        /// which background pulls aside. gaussian_ml: maximum likelihood, the most accurate of one cross-section
        /// alone, saturated or not. log_gaussian: its fast approximation. fir_peak: zero of the derivative, for
        /// stripes of uneven flanks. steger: ridge of the image, averages along the stripe.
        method: Method = Method::ImprovedGravity => ["extraction.method"],
        /// Window of improved_gravity. fractional: unbiased. rounded: as printed in the paper, locks to whole pixels;
        /// only to compare with it.
        window: GravityWindow = GravityWindow::Fractional => ["extraction.window"],
        /// Radius r of the Gaussian blur, kernel 2r + 1; 0 is off. Suppresses speckle and noise; a stripe narrower
        /// than r is smeared. Time grows with r.
        blur_radius: u32 = 3 => ["extraction.blur_radius", 0..=15, "px"],
        /// Blurred grey above which a pixel may belong to the stripe; deeper images are scaled to 8 bits. Fixed, as
        /// in the paper: above the ambient light, below the stripe's weakest part. Too low lets the background in.
        segment_threshold: f64 = 35.0 => ["extraction.segment_threshold", 0.0..=255.0, "grey levels of an 8-bit scale"],
        /// Connected regions of this area or less are no stripe. Removes speckle and small reflections; lower it for
        /// short stripes and small images.
        min_segment_area: u32 = 500 => ["extraction.min_segment_area", 0..=10_000_000, "px"],
        /// Blurred grey above which a sample counts towards the width D of the stripe, whose two thirds are the
        /// window of improved_gravity.
        width_threshold: f64 = 50.0 => ["extraction.width_threshold", 0.0..=255.0, "grey levels of an 8-bit scale"],
        /// Which of several candidates in a cross-section is the stripe. brightest suits most scenes; first or last
        /// when a reflection always lies on the other side; continuity takes those that make one line, for scenes
        /// with bright clutter, and parts a stripe from the halo that it stands on.
        peak_selection: PeakSelection = PeakSelection::Brightest => ["extraction.peak_selection"],
        /// What is taken off before the search. local: what is wider across the stripe than background_window (white
        /// top-hat), for ambient light and bright objects; takes some times longer, because every pixel counts.
        /// reference: background_file, a frame without laser from the same place.
        background: Background = Background::None => ["extraction.background"],
        /// What is wider across the stripe than this is local background; even ones count as the next odd one. Twice
        /// the widest stripe or more; lower lets less clutter through.
        background_window_px: u32 = 41 => ["extraction.background_window", 3..=1001, "px"],
        /// Where the segment threshold comes from. fixed: segment_threshold. adaptive: threshold_sigmas times the
        /// noise of the searched image above its median, frame by frame; width_threshold moves along. Wants a
        /// background that is even or taken off.
        threshold: Threshold = Threshold::Fixed => ["extraction.threshold"],
        /// Adaptive threshold: so many standard deviations of the searched image's noise above its median.
        threshold_sigmas: f64 = 8.0 => ["extraction.threshold_sigmas", 1.0..=1000.0, "standard deviations"],
        /// Candidates whose blurred peak is less than this above the background are no stripe.
        min_contrast: f64 = 0.0 => ["extraction.min_contrast", 0.0..=255.0, "grey levels of an 8-bit scale"],
        /// Candidates with fewer samples above the threshold are no stripe.
        min_width_px: u32 = 1 => ["extraction.min_width", 1..=MAX_SIDE, "px"],
        /// Candidates with more samples above the threshold are no stripe; 0: no limit.
        max_width_px: Option<u32> = None => ["extraction.max_width", 0..=MAX_SIDE, "px"],
        /// Points whose amplitude is less than so many standard deviations of the noise are flagged LOW_CONTRAST.
        min_snr: f64 = 3.0 => ["extraction.min_snr", 0.0..=1000.0, "standard deviations"],
        /// Surfaces that a cross-section may show: glass, a film over a part, a wall behind. Further ones follow as
        /// stripes of their own; the profile holds the first.
        max_stripes: u32 = 1 => ["extraction.max_stripes", 1..=8, "stripes"],
        /// For peak_selection continuity: what moves further from one column to the next is a break in the line.
        max_step_px: f64 = 3.0 => ["extraction.max_step", 0.1..=1000.0, "px"],
        /// Search only so far from the last frame's stripe, and everywhere again when less than half of its points
        /// are found there. 0: everywhere.
        tracking_margin_px: Option<u32> = None => ["extraction.tracking_margin", 0..=MAX_SIDE, "px"],
        /// Points that are smoothed together along the stripe, an odd number; 1: none. Noise falls with their root;
        /// steps and grooves above the noise stay as they are.
        smoothing_columns: u32 = 1 => ["extraction.smoothing_columns", 1..=255, "points"],
        /// Standard deviation of the Gaussian of the method steger: the stripe's standard deviation, about.
        ridge_sigma_px: f64 = 2.2 => ["extraction.ridge_sigma", 0.5..=10.0, "px"],
        /// Noise model of gaussian_ml and of the stated uncertainty. stated: read_noise and shot_gain. estimated:
        /// from the frame itself.
        noise: NoiseSource = NoiseSource::Stated => ["extraction.noise"],
        /// Standard deviation of the camera's noise in the dark, for gaussian_ml and for the stated uncertainty
        /// (sigma); measure it with the lens covered.
        read_noise: f64 = 2.0 => ["extraction.read_noise", 0.0..=100.0, "grey levels of an 8-bit scale"],
        /// Variance of the shot noise per grey level: 255 / full-well electrons. For gaussian_ml and for sigma.
        shot_gain: f64 = 0.01 => ["extraction.shot_gain", 0.0..=10.0, "grey levels of an 8-bit scale"],
    }
}

parameter_group! {
    /// Every parameter of the measurement.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Params {
        /// Grey level of a colour or Bayer pixel, the latter after bilinear demosaicing. auto: grey images as they
        /// are, the largest of the three colours otherwise. gray: luma, BT.601. The laser's own colour has the best
        /// contrast in ambient light; red_excess, green_excess and blue_excess are what it has above the larger of
        /// the other two, so that white and grey things vanish. Grey images are taken as they are, whatever stands
        /// here.
        channel: Channel = Channel::Auto => ["channel"],
        /// Which way the stripe runs through the image. horizontal: one point a column; vertical: one point a row.
        stripe_direction: StripeDirection = StripeDirection::Horizontal => ["stripe_direction"],
        /// Level at which a sample counts as saturated. 0: by encoding, 255 or 65535. Set 4095 for 12 bits in mono16,
        /// or thresholds and saturation are wrong.
        full_scale: Option<u32> = None => ["full_scale", 0..=65_535, "grey levels of the image"],
        /// Searched part of the image.
        roi: RegionOfInterest = RegionOfInterest::default() => group,
        /// How frames of different exposure times follow one another. alternating: short and long ones in turn; each
        /// is merged with the one before it: points that are saturated or missing in the long one are the short
        /// one's. The two are a period apart, so points lie up to one step of the motion off. Intensities are the
        /// long one's.
        exposure: Exposure = Exposure::Single => ["exposure"],
        /// Search and measurement of the centreline.
        extraction: ExtractionParams = ExtractionParams::default() => group,
        /// Motion of the part and its source.
        motion: MotionParams = MotionParams::default() => group,
        /// Profiles in one published slice of the point cloud. Fewer: less delay and smaller messages; 100 is a slice
        /// of some megabytes. A slice also ends before it has 2^26 points, 1 GiB.
        slice_profiles: u32 = 100 => ["slice.profiles", 1..=10_000, "profiles"],
        /// Most points in a slice, missing ones included; a slice of one profile may have more. Computed, not set by a user.
        slice_max_points: usize = MAX_SLICE_POINTS => computed,
        /// Profiles in a scan; the next one begins a new scan with its own height map. Bounds the memory: four bytes
        /// a point of every profile. A scan also ends before it has 2^28 points, 1 GiB of heights.
        scan_max_profiles: u32 = 5_000 => ["scan.max_profiles", 1..=1_000_000, "profiles"],
    }
}

/// A saturation level above the largest level of the image.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("full_scale is {full_scale}, but samples of this encoding end at {max_level}")]
pub struct FullScaleError {
    /// The parameter.
    pub full_scale: u32,
    /// Largest level of the encoding.
    pub max_level: u32,
}

impl Params {
    /// Where slices and scans end.
    pub(crate) const fn scan_limits(&self) -> ScanLimits {
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
    pub const fn full_scale_of(&self, format: PixelFormat) -> Result<u32, FullScaleError> {
        let max_level = format.max_level();
        match self.full_scale {
            None => Ok(max_level),
            Some(chosen) if chosen <= max_level => Ok(chosen),
            Some(full_scale) => Err(FullScaleError { full_scale, max_level }),
        }
    }
}
