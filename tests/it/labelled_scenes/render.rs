//! From the description of a scene to its picture and its labels.

use std::io::Cursor;

use image::{
    DynamicImage, ImageFormat, RgbImage,
    codecs::jpeg::{JpegEncoder, PixelDensity},
};
use laser_profiler::{
    scanner::params::StripeDirection,
    simulate::{
        exposure::{CrossSection, Exposure},
        noise::{frame_rng, speckle},
        sensor::{BitDepth, Sensor},
    },
};

pub(crate) const WIDTH: u32 = 320;
pub(crate) const HEIGHT: u32 = 240;

/// The stripe on a line (column, or row of a vertical stripe): its position and its surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lit {
    pub(crate) section: CrossSection,
    pub(crate) surface: &'static str,
}

/// Light of one colour: the ambient level of each pixel, and its share of the laser light.
pub(crate) struct Colour {
    pub(crate) background: Box<dyn Fn([u32; 2]) -> f64>,
    pub(crate) laser: f64,
}

/// Description of a scene. Grey levels of 8 bits.
pub(crate) struct Scene {
    pub(crate) name: &'static str,
    pub(crate) direction: StripeDirection,
    /// One for grey, three for red, green and blue.
    pub(crate) colours: Vec<Colour>,
    /// Lit surfaces that a person would label, nearest first.
    pub(crate) stripe: Vec<Box<dyn Fn(u32) -> Option<Lit>>>,
    /// Light of the laser that is no line: halos and reflections.
    pub(crate) stray: Vec<Box<dyn Fn(u32) -> Option<CrossSection>>>,
    /// Share of the laser's light that a pixel sends back.
    pub(crate) reflectance: Box<dyn Fn([u32; 2]) -> f64>,
    /// Contrast of the speckle and its size along the stripe, pixels.
    pub(crate) speckle: (f64, f64),
    pub(crate) read_noise: f64,
    pub(crate) shot_gain: f64,
    /// Quality of the camera's JPEG; `None`: uncompressed.
    pub(crate) jpeg_quality: Option<u8>,
    pub(crate) seed: u64,
}

/// A picture and where its lines are.
pub(crate) struct Rendered {
    pub(crate) picture: DynamicImage,
    /// Line, position across the stripe in pixels (NaN: none) and surface.
    pub(crate) labels: Vec<(u32, f64, &'static str)>,
}

impl Scene {
    pub(crate) fn render(&self) -> Rendered {
        let mut rng = frame_rng(self.seed, 0);
        let shares = speckle(&mut rng, self.num_lines(), self.speckle.0, self.speckle.1);
        let mut light = Exposure::default();
        light.reset(WIDTH, HEIGHT, 0.0);
        let none = CrossSection { center_px: f64::NAN, amplitude: 0.0, sigma_px: 1.0 };
        for stripe in &self.stripe {
            light.add_stripe(self.direction, |line| {
                let section = stripe(line).map_or(none, |lit| lit.section);
                let amplitude = section.amplitude * shares[line as usize];
                CrossSection { amplitude, ..section }
            });
        }
        for stray in &self.stray {
            light.add_stripe(self.direction, |line| stray(line).unwrap_or(none));
        }
        let sensor = Sensor {
            bit_depth: BitDepth::Eight,
            read_noise: self.read_noise,
            shot_gain: self.shot_gain,
        };
        let planes: Vec<Vec<u8>> = (self.colours.iter())
            .map(|colour| {
                let mut exposure = Exposure::default();
                exposure.reset(WIDTH, HEIGHT, 0.0);
                exposure.add(|column, row| {
                    let at = [column, row];
                    let level = f64::from(light.levels()[(row * WIDTH + column) as usize]);
                    ((colour.background)(at) + colour.laser * (self.reflectance)(at) * level) as f32
                });
                let mut samples = Vec::new();
                sensor.read_out(&exposure, &mut rng, &mut samples);
                samples
            })
            .collect();
        Rendered { picture: self.compressed(&planes), labels: self.labels() }
    }

    fn num_lines(&self) -> u32 {
        match self.direction {
            StripeDirection::Horizontal => WIDTH,
            StripeDirection::Vertical => HEIGHT,
        }
    }

    /// The picture after JPEG compression in the camera.
    fn compressed(&self, planes: &[Vec<u8>]) -> DynamicImage {
        let rgb = RgbImage::from_fn(WIDTH, HEIGHT, |column, row| {
            let at = (row * WIDTH + column) as usize;
            [0, 1, 2].map(|colour: usize| planes[colour.min(planes.len() - 1)][at]).into()
        });
        let picture = DynamicImage::from(rgb);
        let with_channels = |picture: DynamicImage| {
            if planes.len() == 1 { DynamicImage::from(picture.into_luma8()) } else { picture }
        };
        let picture = with_channels(picture);
        let Some(quality) = self.jpeg_quality else { return picture };
        let mut bytes = Vec::new();
        let mut encoder = JpegEncoder::new_with_quality(&mut bytes, quality);
        encoder.set_pixel_density(PixelDensity::dpi(96));
        encoder.encode_image(&picture).unwrap();
        with_channels(image::load(Cursor::new(bytes), ImageFormat::Jpeg).unwrap())
    }

    /// Every line, nearest surface first; a line without any is NaN.
    fn labels(&self) -> Vec<(u32, f64, &'static str)> {
        let mut labels = Vec::new();
        for line in 0..self.num_lines() {
            let lit: Vec<_> = self.stripe.iter().filter_map(|stripe| stripe(line)).collect();
            labels.extend(lit.iter().map(|lit| (line, lit.section.center_px, lit.surface)));
            if lit.is_empty() {
                labels.push((line, f64::NAN, "none"));
            }
        }
        labels
    }
}

/// The labels as a table.
pub(crate) fn csv(labels: &[(u32, f64, &'static str)]) -> String {
    let rows = labels
        .iter()
        .map(|(line, position_px, surface)| format!("{line},{position_px:.3},{surface}\n"));
    ["line,position_px,surface\n".to_owned()].into_iter().chain(rows).collect()
}
