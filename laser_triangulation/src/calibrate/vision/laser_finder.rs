//! The laser's stripe in pictures of boards and markers.

use thiserror::Error;

use crate::scanner::{
    channel::{AnyPlane, Decoder, Plane, RoiError, SearchedRegion},
    image::{Image, PixelFormat},
    params::{
        Background, Channel, ExtractionParams, FullScaleError, Method, Params, PeakSelection,
        Threshold,
    },
    stripe::{Centerline, Extractor},
};

/// The possible colours of a laser.
const COLORS: [Channel; 3] = [Channel::Red, Channel::Green, Channel::Blue];
/// Level of zero difference: noise stays on both sides of it, so that its standard deviation can be estimated.
const MIDDLE: i32 = 64;

/// The grey level in which the stripe is searched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Light {
    /// One channel, or a grey picture unchanged.
    Channel(Channel),
    /// One colour minus the mean of the other two. This separates a laser from a printed board in any room light.
    Over(Channel),
}

impl Light {
    /// Describes the grey level in a few words.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Channel(channel) => format!("channel {}", channel.name()),
            Self::Over(color) => format!("{} over the mean of the other colours", color.name()),
        }
    }
}

/// A stripe, and the grey level in which it was found.
#[derive(Clone, Debug)]
pub struct LitCenterline {
    /// Grey level.
    pub light: Light,
    /// Centreline of the stripe.
    pub centerline: Centerline,
}

/// A picture whose stripe cannot be extracted.
#[derive(Debug, Error)]
pub enum LaserFinderError {
    /// The region of interest reaches beyond the picture.
    #[error(transparent)]
    Roi(#[from] RoiError),
    /// The full scale is larger than the picture's format can hold.
    #[error(transparent)]
    FullScale(#[from] FullScaleError),
}

/// Extracts the stripe from pictures in each possible light of the laser.
#[derive(Clone, Copy, Debug)]
pub struct LaserFinder {
    params: Params,
    channel: Option<Channel>,
}

impl LaserFinder {
    /// Creates a finder. `channel` is the channel to search; `None` searches colour pictures in every laser colour.
    #[must_use]
    pub const fn new(params: Params, channel: Option<Channel>) -> Self {
        Self { params, channel }
    }

    /// Returns extraction parameters for a line on a printed board in room light: background, threshold, smallest
    /// segment, peak selection and method. All others are taken from the given parameters.
    #[must_use]
    pub const fn extraction_on_board(given: ExtractionParams) -> ExtractionParams {
        ExtractionParams {
            background: Background::Local,
            threshold: Threshold::Adaptive,
            min_segment_area: 15,
            threshold_sigmas: 5.0,
            peak_selection: PeakSelection::Brightest,
            method: Method::Steger,
            ..given
        }
    }

    /// Extracts one centreline per light.
    ///
    /// # Errors
    /// A region of interest beyond the picture, or a full scale that its format cannot hold.
    pub fn find(&self, image: &Image<'_>) -> Result<Vec<LitCenterline>, LaserFinderError> {
        let searched = SearchedRegion::new(self.params.roi, image.width(), image.height())?;
        let full_scale = self.params.full_scale_of(image.format())?;
        let find = |light| {
            let centerline = self.extract(image, light, &searched, full_scale);
            LitCenterline { light, centerline }
        };
        Ok(self.lights(image.format()).into_iter().map(find).collect())
    }

    fn lights(&self, format: PixelFormat) -> Vec<Light> {
        match (format, self.channel) {
            (format, _) if !format.has_colors() => vec![Light::Channel(Channel::Auto)],
            (_, Some(channel)) => vec![Light::Channel(channel)],
            (_, None) => COLORS.map(Light::Over).to_vec(),
        }
    }

    fn extract(
        &self,
        image: &Image<'_>,
        light: Light,
        searched: &SearchedRegion,
        full_scale: u32,
    ) -> Centerline {
        let mut extractor = Extractor::new(self.params.extraction, self.params.stripe_direction);
        let mut line = Centerline::default();
        let offset = searched.offset();
        match light {
            Light::Channel(channel) => {
                let mut decoder = Decoder::default();
                let plane = decoder.decode(image, channel, searched);
                extractor.extract_plane(&plane, offset, full_scale, &mut line);
            }
            Light::Over(color) => {
                let samples = over_the_others(image, color, searched, full_scale);
                let &SearchedRegion { width, height, .. } = searched;
                let plane = Plane { width, height, stride: width, samples: &samples };
                extractor.extract_plane(&AnyPlane::Eight(plane), offset, 255, &mut line);
            }
        }
        line
    }
}

/// Returns one colour minus the mean of the other two, on an 8-bit scale about [`MIDDLE`].
fn over_the_others(
    image: &Image<'_>,
    color: Channel,
    searched: &SearchedRegion,
    full_scale: u32,
) -> Vec<u8> {
    let twice = |wanted: Channel| if wanted == color { 2 } else { -1 };
    let mut sums = vec![0_i32; searched.width * searched.height];
    for channel in COLORS {
        let mut add = |at: usize, level: i32| sums[at] += twice(channel) * level;
        match Decoder::default().decode(image, channel, searched) {
            AnyPlane::Eight(plane) => {
                let levels = plane.rows().flatten();
                levels.enumerate().for_each(|(at, &level)| add(at, level.into()));
            }
            AnyPlane::Sixteen(plane) => {
                let levels = plane.rows().flatten();
                levels.enumerate().for_each(|(at, &level)| {
                    add(at, (u32::from(level) * 255 / full_scale.max(1)) as i32);
                });
            }
        }
    }
    sums.into_iter().map(|sum| (MIDDLE + sum / 2).clamp(0, 255) as u8).collect()
}
