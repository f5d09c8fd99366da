//! Extracts the stripe's sub-pixel centreline from a grey image: the method of Yao et al. 2023 (doi
//! 10.3390/app13179831), each step a function of its own.
//!
//! | step | in the code |
//! |---|---|
//! | 1 crop | [`SearchedRegion::new`] |
//! | 2 grey | [`Decoder::decode`] |
//! | 3 blur | `blur::blurred_at`; fast: `tile_blur`, only on the tiles that `tiles` selects |
//! | 3a background | `background`, if the scene is not black |
//! | 4 segment | `segment`, above the level of `threshold` if that is adaptive |
//! | 4a select | `select` takes one candidate of each cross-section, or several: `split`, `valley`, `continuity`, `tracking` |
//! | 5 coarse peak | `gaussian_fit::coarse_peak` |
//! | 6 width D | `gravity::width_samples` |
//! | 7 window L | `gravity::window_half_length_px` |
//! | 8 centre | `fractional`; `gravity::rounded_window_gravity` as printed in the paper |
//!
//! `fast` runs the costly steps only where the stripe can be. `reference`, compiled only for tests, runs them on every
//! pixel and defines the result: both are equal bit for bit. Each cross-section goes to `measure`, which calls the
//! estimator; add new estimators there. `smooth` follows if it is enabled.

pub(super) mod blur;
mod segment;
mod section;
mod lanes;
mod logarithm;
mod width;
mod broad;
mod elementary;
mod noise;
mod parabola;
mod gaussian_fit;
mod gaussian_ml;
mod log_gaussian;
mod fir_peak;
mod picture;
mod steger;
mod noise_estimate;
mod gravity;
mod fractional;
mod background;
mod threshold;
mod valley;
mod split;
mod continuity;
mod tracking;
mod select;
mod shape;
mod misfit;
mod texture;
mod measure;
mod assemble;
pub(crate) mod correlation;
mod smooth;
mod vectors;
mod tile_blur;
mod tiles;
mod columns;
mod load;
mod work;
mod fast;
#[cfg(test)]
mod reference;
#[cfg(test)]
mod bad_sections;
#[cfg(test)]
mod pictures;

use super::{
    channel::{AnyPlane, Decoder, Offset, SearchedRegion},
    image::Image,
    params::{Channel, ExtractionParams, StripeDirection},
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
    /// The cross-section does not look like one stripe: a halo, a reflection or a second line is merged with it. The
    /// stated uncertainty is widened.
    pub const MISFIT: u8 = 32;
    /// In a profile only: outside the volume from which the calibration has data. The uncertainty of the calibration is
    /// an extrapolation there.
    pub const OUTSIDE_CALIBRATION: u8 = 64;
}

/// Sub-pixel centre of the stripe in one frame: one entry per column (row, for a vertical stripe) in which it was
/// found.
///
/// All arrays except `stripe_start` have the same length. Full-image pixel coordinates, pixel centres at integers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Centerline {
    /// Column, pixels; an integer for a horizontal stripe.
    pub u_px: Vec<f32>,
    /// Row, pixels; an integer for a vertical stripe.
    pub v_px: Vec<f32>,
    /// Index of the first point of each connected stripe, ascending from 0; empty when there are no points.
    pub stripe_start: Vec<u32>,
    /// Full width at half maximum across the stripe, pixels, with the blur's contribution removed; NaN where the border
    /// of the image or a bright background hides an edge.
    pub width_px: Vec<f32>,
    /// Grey level at the centre before the blur, in units of the source's samples, linearly interpolated.
    pub intensity: Vec<f32>,
    /// Standard deviation of the centre across the stripe, pixels, from the stated noise.
    pub sigma_px: Vec<f32>,
    /// Bits of [`flag`].
    pub flags: Vec<u8>,
}

impl Centerline {
    /// Returns the number of points.
    pub fn len(&self) -> usize {
        self.u_px.len()
    }

    /// True if no stripe was found.
    pub fn is_empty(&self) -> bool {
        self.u_px.is_empty()
    }

    /// Returns the number of points that carry any of these bits of [`flag`].
    #[must_use]
    pub fn num_flagged(&self, bits: u8) -> usize {
        self.flags.iter().filter(|flags| *flags & bits != 0).count()
    }

    /// Returns the positions along and across stripes of this direction, pixels of the image.
    pub(crate) fn along_and_across(&self, direction: StripeDirection) -> (&[f32], &[f32]) {
        match direction {
            StripeDirection::Horizontal => (&self.u_px, &self.v_px),
            StripeDirection::Vertical => (&self.v_px, &self.u_px),
        }
    }

    /// Copies `other`, reusing the memory.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.u_px.clone_from(&other.u_px);
        self.v_px.clone_from(&other.v_px);
        self.stripe_start.clone_from(&other.stripe_start);
        self.width_px.clone_from(&other.width_px);
        self.intensity.clone_from(&other.intensity);
        self.sigma_px.clone_from(&other.sigma_px);
        self.flags.clone_from(&other.flags);
    }

    /// Removes all points, keeps the memory.
    pub(super) fn clear(&mut self) {
        self.u_px.clear();
        self.v_px.clear();
        self.stripe_start.clear();
        self.width_px.clear();
        self.intensity.clear();
        self.sigma_px.clear();
        self.flags.clear();
    }
}

/// Components of the standard deviation of a frame's centres: medians along the stripe, before smoothing, without what
/// [`flag::MISFIT`] adds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SigmaParts {
    /// Standard deviation from the noise of the pixels, pixels.
    pub noise_px: f32,
    /// Standard deviation from speckle and texture, which that noise does not explain, pixels; 0 if it explains all of the
    /// scatter.
    pub texture_px: f32,
}

/// Extracts centrelines frame after frame. Allocates nothing after the first frame of a size.
///
/// [`extract`](Self::extract) takes a whole image; [`extract_plane`](Self::extract_plane) takes samples that are
/// already decoded and cropped.
///
/// ```
/// use laser_triangulation::scanner::{
///     image::{Image, PixelFormat},
///     params::{ExtractionParams, Method, StripeDirection},
///     stripe::Extractor,
/// };
///
/// let picture = [
///      0,  0,  0,  0,
///     10,  0,  0,  0,
///     30, 20,  0,  0,
///     10, 20,  0, 40,
///      0,  0,  0,  0,
/// ];
/// let image = Image::packed(4, 5, PixelFormat::Mono8, &picture)?;
/// let params = ExtractionParams {
///     method: Method::GrayGravity,
///     blur_radius: 0,
///     segment_threshold: 5.0,
///     min_segment_area: 0,
///     ..ExtractionParams::default()
/// };
/// let mut extractor = Extractor::new(params, StripeDirection::Horizontal);
/// let line = extractor.extract(&image);
/// assert_eq!(line.u_px, [0.0, 1.0, 3.0]);
/// assert_eq!(line.v_px, [2.0, 2.5, 3.0]);
/// assert_eq!(line.stripe_start, [0, 2]);
/// # Ok::<(), laser_triangulation::scanner::image::ImageError>(())
/// ```
#[derive(Debug)]
pub struct Extractor {
    eight: FastExtractor<u8>,
    sixteen: FastExtractor<u16>,
    smoother: Smoother,
    decoder: Decoder,
    centerline: Centerline,
    sigma_parts: Option<SigmaParts>,
}

impl Default for Extractor {
    /// Returns an extractor with default parameters, for a stripe that runs from left to right.
    fn default() -> Self {
        Self::new(ExtractionParams::default(), StripeDirection::Horizontal)
    }
}

impl Extractor {
    /// Creates an extractor with these settings.
    ///
    /// # Panics
    /// A parameter is out of its range: [`ExtractionParams::check_ranges`] returns an error.
    pub fn new(params: ExtractionParams, direction: StripeDirection) -> Self {
        if let Err(error) = params.check_ranges() {
            panic!("{error}");
        }
        Self {
            eight: FastExtractor::new(params, direction),
            sixteen: FastExtractor::new(params, direction),
            smoother: Smoother::new(&params, direction),
            decoder: Decoder::default(),
            centerline: Centerline::default(),
            sigma_parts: None,
        }
    }

    /// Returns the shares of noise and texture in the last frame's [`sigma_px`](Centerline::sigma_px); `None` without
    /// points.
    #[must_use]
    pub const fn sigma_parts(&self) -> Option<SigmaParts> {
        self.sigma_parts
    }

    /// Extracts the centreline of a whole image. Uses grey images as they are, and the largest channel of colour and
    /// Bayer images ([`Channel::Auto`]). Full scale is the format's white level.
    ///
    /// For another channel, a region of interest or a lower full scale, decode the image with [`Decoder`] and call
    /// [`extract_plane`](Self::extract_plane).
    ///
    /// The usual reasons for an empty centreline, and the parameter to change:
    /// - The stripe covers at most [`min_segment_area`](ExtractionParams::min_segment_area) pixels, 500 by default:
    ///   lower it for small images and short stripes.
    /// - The blurred stripe is not brighter than [`segment_threshold`](ExtractionParams::segment_threshold), 35 of 255 by
    ///   default: lower it, or use [`Threshold::Adaptive`](super::params::Threshold::Adaptive). A narrow stripe also gets
    ///   darker by the blur: lower [`blur_radius`](ExtractionParams::blur_radius).
    /// - 10 or 12 bits in samples of 16: thresholds are relative to the full scale, so decode the image as above and set
    ///   `full_scale` to 1023 or 4095.
    /// - Only a few points: the stripe runs in the other direction. Use the other [`StripeDirection`].
    ///
    /// ```
    /// use laser_triangulation::scanner::{
    ///     image::{Image, PixelFormat},
    ///     params::{ExtractionParams, StripeDirection},
    ///     stripe::Extractor,
    /// };
    ///
    /// // A stripe of 40 columns and 3 rows covers 120 pixels.
    /// let mut picture = [0; 40 * 9];
    /// picture[40 * 3..40 * 6].fill(200);
    /// let image = Image::packed(40, 9, PixelFormat::Mono8, &picture)?;
    /// assert!(Extractor::default().extract(&image).is_empty());
    ///
    /// let params = ExtractionParams { min_segment_area: 50, ..ExtractionParams::default() };
    /// let mut extractor = Extractor::new(params, StripeDirection::Horizontal);
    /// assert_eq!(extractor.extract(&image).len(), 40);
    /// # Ok::<(), laser_triangulation::scanner::image::ImageError>(())
    /// ```
    pub fn extract(&mut self, image: &Image<'_>) -> &Centerline {
        let region = SearchedRegion::whole(image);
        let (offset, full_scale) = (region.offset(), image.format().white_level());
        let mut decoder = std::mem::take(&mut self.decoder);
        let mut centerline = std::mem::take(&mut self.centerline);
        let plane = decoder.decode(image, Channel::Auto, &region);
        self.extract_plane(&plane, offset, full_scale, &mut centerline);
        self.decoder = decoder;
        self.centerline = centerline;
        &self.centerline
    }

    /// Replaces `centerline` by that of a plane whose top-left sample lies at `offset` in the image. `full_scale` is the
    /// level of a saturated sample; the grey levels in the parameters are scaled to it.
    pub fn extract_plane(
        &mut self,
        plane: &AnyPlane<'_>,
        offset: Offset,
        full_scale: u32,
        centerline: &mut Centerline,
    ) {
        self.sigma_parts = match plane {
            AnyPlane::Eight(plane) => self.eight.extract(plane, offset, full_scale, centerline),
            AnyPlane::Sixteen(plane) => self.sixteen.extract(plane, offset, full_scale, centerline),
        };
        self.smoother.smooth(centerline);
    }

    /// Sets the frame without laser light that [`Background::Reference`](super::params::Background::Reference) subtracts;
    /// without one it subtracts nothing. The frame must cover the same region and have the same depth as the frames that
    /// follow: another region is subtracted at the wrong place, another depth not at all.
    ///
    /// ```
    /// use laser_triangulation::scanner::{
    ///     channel::{Decoder, SearchedRegion},
    ///     image::{Image, PixelFormat},
    ///     params::{Background, Channel, ExtractionParams, StripeDirection},
    ///     stripe::Extractor,
    /// };
    ///
    /// // A lamp in the first row outshines the stripe in the fourth.
    /// let dark = Image::packed(2, 5, PixelFormat::Mono8, &[90, 90, 0, 0, 0, 0, 0, 0, 0, 0])?;
    /// let lit = Image::packed(2, 5, PixelFormat::Mono8, &[90, 90, 0, 0, 0, 0, 60, 60, 0, 0])?;
    /// let params = ExtractionParams {
    ///     background: Background::Reference,
    ///     blur_radius: 0,
    ///     min_segment_area: 0,
    ///     ..ExtractionParams::default()
    /// };
    /// let mut extractor = Extractor::new(params, StripeDirection::Horizontal);
    /// assert_eq!(extractor.extract(&lit).v_px, [0.0, 0.0]);
    ///
    /// let mut decoder = Decoder::default();
    /// extractor.set_ambient(&decoder.decode(&dark, Channel::Auto, &SearchedRegion::whole(&dark)));
    /// assert_eq!(extractor.extract(&lit).v_px, [3.0, 3.0]);
    /// # Ok::<(), laser_triangulation::scanner::image::ImageError>(())
    /// ```
    pub fn set_ambient(&mut self, plane: &AnyPlane<'_>) {
        match plane {
            AnyPlane::Eight(plane) => self.eight.set_ambient(plane),
            AnyPlane::Sixteen(plane) => self.sixteen.set_ambient(plane),
        }
    }

    /// Discards the stripes of the last frame: tracking ([`ExtractionParams::tracking_margin_px`]) searches the whole
    /// region of the next frame. Call it if that frame does not continue the last one: at the start of a scan, for
    /// another part or another camera. The frame without laser light stays.
    ///
    /// ```
    /// use laser_triangulation::scanner::{
    ///     image::{Image, PixelFormat},
    ///     params::{ExtractionParams, StripeDirection},
    ///     stripe::Extractor,
    /// };
    ///
    /// let one = Image::packed(2, 5, PixelFormat::Mono8, &[60, 60, 0, 0, 0, 0, 0, 0, 0, 0])?;
    /// let two = Image::packed(2, 5, PixelFormat::Mono8, &[60, 60, 0, 0, 0, 0, 90, 90, 0, 0])?;
    /// let params = ExtractionParams {
    ///     tracking_margin_px: Some(1),
    ///     blur_radius: 0,
    ///     min_segment_area: 0,
    ///     ..ExtractionParams::default()
    /// };
    /// let mut extractor = Extractor::new(params, StripeDirection::Horizontal);
    /// assert_eq!(extractor.extract(&one).v_px, [0.0, 0.0]);
    /// assert_eq!(extractor.extract(&two).v_px, [0.0, 0.0]);
    /// extractor.reset();
    /// assert_eq!(extractor.extract(&two).v_px, [3.0, 3.0]);
    /// # Ok::<(), laser_triangulation::scanner::image::ImageError>(())
    /// ```
    pub const fn reset(&mut self) {
        self.eight.reset();
        self.sixteen.reset();
    }
}
