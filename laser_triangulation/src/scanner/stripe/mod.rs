//! From a grey image to the stripe's sub-pixel centreline: the method of Yao et al. 2023 (doi 10.3390/app13179831), each
//! step a function of its own.
//!
//! | step | function |
//! |---|---|
//! | 1 crop | [`channel::window`](super::channel::window) |
//! | 2 grey | [`channel::Decoder::decode`](super::channel::Decoder::decode) |
//! | 3 blur | [`blur::blurred_at`]; fast: [`tile_blur::TileBlur`], where [`tiles`] says that it matters |
//! | 3a background | [`background::BackgroundFilter`], when the scene is not black |
//! | 4 segment | [`segment::Regions`], above [`threshold::NoiseThreshold`] when it is adaptive |
//! | 4a choose | [`select::Selector`] takes one candidate a cross-section, or more: [`split`], [`continuity`], [`tracking`] |
//! | 5 coarse peak | [`gaussian_fit::coarse_peak`] |
//! | 6 width D | [`gravity::width_samples`] |
//! | 7 window L | [`gravity::window_half_length_px`] |
//! | 8 centre | [`fractional::fractional_window_gravity`], [`gravity::rounded_window_gravity`] as printed |
//!
//! [`reference`](mod@reference) runs steps 3 and 4 on every pixel, [`fast`] only where stripe can be; both hand each cross-section to
//! [`measure`], where the estimator is chosen and where a new one is added. [`smooth`] comes after, when it is asked for.

pub mod blur;
pub mod segment;
pub mod section;
pub mod lanes;
pub mod logarithm;
pub mod width;
pub mod broad;
pub mod elementary;
pub mod noise;
pub mod parabola;
pub mod gaussian_fit;
pub mod gaussian_ml;
pub mod log_gaussian;
pub mod fir_peak;
pub mod picture;
pub mod steger;
pub mod noise_estimate;
pub mod gravity;
pub mod fractional;
pub mod background;
pub mod threshold;
pub mod split;
pub mod continuity;
pub mod tracking;
pub mod select;
pub mod measure;
pub mod correlation;
pub mod smooth;
pub mod reference;
pub mod vectors;
pub mod tile_blur;
pub mod tiles;
pub mod columns;
pub mod load;
pub mod work;
pub mod fast;
#[cfg(test)]
mod bad_sections;
#[cfg(test)]
mod pictures;

use super::{
    channel::AnyPlane,
    params::{ExtractionParams, StripeDirection},
};
use fast::FastExtractor;
use smooth::Smoother;

/// Bits of a point's flags, as in `laser_profiler_msgs/msg/Centerline`.
pub mod flag {
    /// At least one pixel of the cross-section at full scale.
    pub const SATURATED: u8 = 1;
    /// Another candidate above the threshold in this cross-section.
    pub const MULTIPLE_PEAKS: u8 = 2;
    /// Cross-section cut by the border of the image or of the region of interest.
    pub const CLIPPED: u8 = 4;
    /// Not measured, filled in from neighbours.
    pub const INTERPOLATED: u8 = 8;
    /// Below the configured signal-to-noise limit.
    pub const LOW_CONTRAST: u8 = 16;
}

/// Sub-pixel middle of the stripe in one frame: one entry a column (row, for a vertical stripe) in which it was found.
///
/// All arrays but `stripe_start` have the same length. Full-image pixel coordinates, pixel centres at integers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Centerline {
    /// Column, pixels; an integer for a horizontal stripe.
    pub u_px: Vec<f32>,
    /// Row, pixels; an integer for a vertical stripe.
    pub v_px: Vec<f32>,
    /// Index of the first point of each connected stripe, ascending from 0; empty when there are no points.
    pub stripe_start: Vec<u32>,
    /// Full width at half maximum across the stripe, pixels, without the blur's share; NaN where the border of the
    /// image or a bright background hides an edge.
    pub width_px: Vec<f32>,
    /// Grey level at the centre before the blur, in units of the source's samples, linear between two of them.
    pub intensity: Vec<f32>,
    /// One standard deviation of the centre across the stripe, pixels, from the stated noise.
    pub sigma_px: Vec<f32>,
    /// Bits of [`flag`].
    pub flags: Vec<u8>,
}

impl Centerline {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.u_px.len()
    }

    /// Whether no stripe was found.
    pub fn is_empty(&self) -> bool {
        self.u_px.is_empty()
    }

    /// Becomes `other`, keeps the memory.
    pub fn copy_from(&mut self, other: &Self) {
        self.u_px.clone_from(&other.u_px);
        self.v_px.clone_from(&other.v_px);
        self.stripe_start.clone_from(&other.stripe_start);
        self.width_px.clone_from(&other.width_px);
        self.intensity.clone_from(&other.intensity);
        self.sigma_px.clone_from(&other.sigma_px);
        self.flags.clone_from(&other.flags);
    }

    /// Forgets all points, keeps the memory.
    pub fn clear(&mut self) {
        self.u_px.clear();
        self.v_px.clear();
        self.stripe_start.clear();
        self.width_px.clear();
        self.intensity.clear();
        self.sigma_px.clear();
        self.flags.clear();
    }
}

/// Extracts centrelines from 8-bit and 16-bit planes.
///
/// ```
/// use laser_profiler::scanner::{
///     channel::{AnyPlane, Plane},
///     params::{ExtractionParams, Method, StripeDirection},
///     stripe::{Centerline, Extractor},
/// };
///
/// let picture = [
///      0,  0,  0,  0,
///     10,  0,  0,  0,
///     30, 20,  0,  0,
///     10, 20,  0, 40,
///      0,  0,  0,  0_u8,
/// ];
/// let plane = AnyPlane::Eight(Plane { width: 4, height: 5, stride: 4, samples: &picture });
/// let params = ExtractionParams {
///     method: Method::GrayGravity,
///     blur_radius: 0,
///     segment_threshold: 5.0,
///     min_segment_area: 0,
///     ..ExtractionParams::default()
/// };
/// let mut line = Centerline::default();
/// Extractor::new(params, StripeDirection::Horizontal).extract(&plane, (0, 0), 255, &mut line);
/// assert_eq!(line.u_px, [0.0, 1.0, 3.0]);
/// assert_eq!(line.v_px, [2.0, 2.5, 3.0]);
/// assert_eq!(line.stripe_start, [0, 2]);
/// ```
#[derive(Debug)]
pub struct Extractor {
    eight: FastExtractor<u8>,
    sixteen: FastExtractor<u16>,
    smoother: Smoother,
}

impl Extractor {
    /// An extractor with these settings.
    pub fn new(params: ExtractionParams, direction: StripeDirection) -> Self {
        Self {
            eight: FastExtractor::new(params, direction),
            sixteen: FastExtractor::new(params, direction),
            smoother: Smoother::new(&params, direction),
        }
    }

    /// Takes this plane for the light without laser, for `background: reference`: the searched part of the frames that
    /// follow, with the same depth.
    pub fn set_ambient(&mut self, plane: &AnyPlane<'_>) {
        match plane {
            AnyPlane::Eight(plane) => self.eight.set_ambient(plane),
            AnyPlane::Sixteen(plane) => self.sixteen.set_ambient(plane),
        }
    }

    /// Forgets the last frame's stripes: the next frame is searched everywhere.
    pub const fn reset(&mut self) {
        self.eight.reset();
        self.sixteen.reset();
    }

    /// Replaces `centerline` by that of a plane whose top-left sample lies at `offset` (column, row) of the image.
    /// `full_scale` is the level of a saturated sample, to which the parameters' grey levels are scaled.
    pub fn extract(
        &mut self,
        plane: &AnyPlane<'_>,
        offset: (usize, usize),
        full_scale: u32,
        centerline: &mut Centerline,
    ) {
        match plane {
            AnyPlane::Eight(plane) => self.eight.extract(plane, offset, full_scale, centerline),
            AnyPlane::Sixteen(plane) => self.sixteen.extract(plane, offset, full_scale, centerline),
        }
        self.smoother.smooth(centerline);
    }
}
