//! The stripe in pictures of boards and markers, by the node's own extraction.

use crate::{
    cli::settings::Settings,
    ros::camera_params::CameraParams,
    scanner::{
        channel::{AnyPlane, Decoder, Plane, SearchedRegion},
        image::{Image, PixelFormat},
        params::{Background, Channel, ExtractionParams, Method, Params, PeakSelection, Threshold},
        stripe::{Centerline, Extractor},
    },
};

/// How the stripe is looked for.
pub(super) struct Stripes {
    params: Params,
    is_channel_set: bool,
}

/// The grey level in which a stripe is looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Light {
    /// As the parameter says, or a grey picture as it is.
    Channel(Channel),
    /// What a colour has above the mean of the other two: a laser on a printed board, whatever the room's light.
    Over(Channel),
}

impl Light {
    /// In one word or two.
    pub(super) fn name(self) -> String {
        match self {
            Self::Channel(channel) => format!("channel {}", channel.name()),
            Self::Over(colour) => format!("{} over the mean of the other colours", colour.name()),
        }
    }
}

/// The colours a laser may have.
const COLOURS: [Channel; 3] = [Channel::Red, Channel::Green, Channel::Blue];
/// Where noise swings about, so that the frame's own noise can be told.
const MIDDLE: i32 = 64;

impl Stripes {
    /// The node's parameters; where the user set none, those that find a line on a printed board in room light.
    pub(super) fn new(settings: &Settings, camera: &CameraParams) -> Self {
        let is_set = |name: &str| settings.values.is_set(&camera.full_name(name));
        let given = camera.scanner.extraction;
        let mut extraction = ExtractionParams {
            background: Background::Local,
            threshold: Threshold::Adaptive,
            min_segment_area: 15,
            threshold_sigmas: 5.0,
            peak_selection: PeakSelection::Brightest,
            method: Method::Steger,
            ..given
        };
        if is_set("extraction.background") {
            extraction.background = given.background;
        }
        if is_set("extraction.threshold_sigmas") {
            extraction.threshold_sigmas = given.threshold_sigmas;
        }
        if is_set("extraction.threshold") || is_set("extraction.segment_threshold") {
            extraction.threshold = given.threshold;
        }
        if is_set("extraction.min_segment_area") {
            extraction.min_segment_area = given.min_segment_area;
        }
        if is_set("extraction.peak_selection") {
            extraction.peak_selection = given.peak_selection;
        }
        if is_set("extraction.method") {
            extraction.method = given.method;
        }
        let params = Params { extraction, ..camera.scanner };
        Self { params, is_channel_set: is_set("channel") }
    }

    /// The grey levels in which the stripe is looked for: the one that the user chose, or every colour a laser may have.
    fn lights(&self, format: PixelFormat) -> Vec<Light> {
        match format {
            PixelFormat::Mono8 | PixelFormat::Mono16(_) => vec![Light::Channel(Channel::Auto)],
            _ if self.is_channel_set => vec![Light::Channel(self.params.channel)],
            _ => COLOURS.map(Light::Over).to_vec(),
        }
    }

    /// The centreline, in each light that it may have.
    ///
    /// # Errors
    /// A region of interest outside the picture, or a full scale that it cannot hold.
    pub(super) fn extract(&self, image: &Image<'_>) -> Result<Vec<(Light, Centerline)>, String> {
        let searched = SearchedRegion::new(self.params.roi, image.width(), image.height());
        let searched = searched.map_err(|error| error.to_string())?;
        let full_scale = self.params.full_scale_of(image.format());
        let full_scale = full_scale.map_err(|error| error.to_string())?;
        let line = |light: Light| {
            let mut extractor =
                Extractor::new(self.params.extraction, self.params.stripe_direction);
            let mut line = Centerline::default();
            let offset = searched.offset();
            match light {
                Light::Channel(channel) => {
                    let mut decoder = Decoder::default();
                    let plane = decoder.decode(image, channel, &searched);
                    extractor.extract_plane(&plane, offset, full_scale, &mut line);
                }
                Light::Over(colour) => {
                    let samples = over_the_others(image, colour, &searched, full_scale);
                    let SearchedRegion { width, height, .. } = searched;
                    let plane = Plane::new(width, height, width, &samples);
                    let plane = plane.map_err(|error| error.to_string())?.into();
                    extractor.extract_plane(&plane, offset, 255, &mut line);
                }
            }
            Ok((light, line))
        };
        self.lights(image.format()).into_iter().map(line).collect()
    }
}

/// What a colour has above the mean of the other two, on an 8-bit scale about [`MIDDLE`].
fn over_the_others(
    image: &Image<'_>,
    colour: Channel,
    searched: &SearchedRegion,
    full_scale: u32,
) -> Vec<u8> {
    let twice = |wanted: Channel| if wanted == colour { 2 } else { -1 };
    let mut sums = vec![0_i32; searched.width * searched.height];
    for channel in COLOURS {
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
