use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};

use crate::scanner::{
    image::{ByteOrder, Image, PixelFormat},
    params::{
        Background, Channel, ExtractionParams, Params, RegionOfInterest, StripeDirection, Threshold,
    },
};

use super::{Diagnosis, Reason, diagnose};

const WIDTH: usize = 320;
const HEIGHT: usize = 240;

/// A picture of a line, or of none. Levels are shares of full scale.
#[derive(Clone, Copy)]
struct Scene {
    direction: StripeDirection,
    /// Light of the line.
    line: f64,
    /// Cross-sections that the line covers, from the 20th on.
    length: usize,
    background: f64,
    noise: f64,
    seed: u8,
}

const PLAIN: Scene = Scene {
    direction: StripeDirection::Horizontal,
    line: 0.7,
    length: usize::MAX,
    background: 0.01,
    noise: 0.005,
    seed: 1,
};

impl Scene {
    /// Samples from 0 to `full_scale`.
    fn samples(&self, full_scale: u32) -> Vec<u16> {
        let mut rng = ChaCha8Rng::from_seed([self.seed; 32]);
        let noise = Normal::new(0.0, self.noise).unwrap();
        let mut samples = Vec::with_capacity(WIDTH * HEIGHT);
        for row in 0..HEIGHT {
            for column in 0..WIDTH {
                let (along, across) = match self.direction {
                    StripeDirection::Horizontal => (column, row),
                    StripeDirection::Vertical => (row, column),
                };
                let center = 110.0 + 0.04 * along as f64 + f64::from(self.seed);
                let distance = across as f64 - center;
                let is_lit = along >= 20 && along - 20 < self.length || self.length == usize::MAX;
                let line =
                    if is_lit { self.line * libm::exp(-distance * distance / 10.0) } else { 0.0 };
                let level = self.background + line + noise.sample(&mut rng);
                samples.push((f64::from(full_scale) * level.clamp(0.0, 1.0)).round() as u16);
            }
        }
        samples
    }

    fn explain(&self, params: &Params) -> Diagnosis {
        let samples: Vec<u8> = self.samples(255).into_iter().map(|level| level as u8).collect();
        diagnose(&grey(&samples), params, None)
    }

    fn explain_deep(&self, full_scale: u32, params: &Params) -> Diagnosis {
        let samples: Vec<u8> =
            self.samples(full_scale).into_iter().flat_map(u16::to_le_bytes).collect();
        let format = PixelFormat::Mono16(ByteOrder::Little);
        let image = Image::packed(WIDTH as u32, HEIGHT as u32, format, &samples).unwrap();
        diagnose(&image, params, None)
    }
}

fn grey(samples: &[u8]) -> Image<'_> {
    Image::packed(WIDTH as u32, HEIGHT as u32, PixelFormat::Mono8, samples).unwrap()
}

fn seeds() -> impl Iterator<Item = Scene> {
    (1..=3).map(|seed| Scene { seed, ..PLAIN })
}

fn extraction(change: impl Fn(&mut ExtractionParams)) -> Params {
    let mut params = Params::default();
    change(&mut params.extraction);
    params
}

#[test]
fn fewer_bits_than_the_encoding_holds() {
    // A brighter line of 14 bits exceeds the threshold at the wrong full scale, too.
    for (scene, (bits, line)) in seeds().zip([(10, 0.7), (12, 0.7), (14, 0.4)]) {
        let scene = Scene { line, ..scene };
        let full_scale = (1 << bits) - 1;
        let found = scene.explain_deep(full_scale, &Params::default());
        let Reason::FullScale { stated, full_scale: proposed, .. } = found.reason else {
            panic!("{found:?}")
        };
        assert_eq!((stated, proposed, found.turned), (65_535, full_scale, None), "{found}");
        assert!(found.to_string().ends_with(&format!("set full_scale: {full_scale}")), "{found}");
        let turned = Scene { direction: StripeDirection::Vertical, ..scene };
        let found = turned.explain_deep(full_scale, &Params::default());
        assert!(matches!(found.reason, Reason::FullScale { .. }), "{found:?}");
        assert!(found.to_string().ends_with("set stripe_direction: vertical"), "{found}");
    }
}

#[test]
fn samples_above_the_stated_full_scale() {
    for scene in seeds() {
        let params = Params { full_scale: Some(1023), ..Params::default() };
        let scene = Scene { background: 0.4, line: 0.55, ..scene };
        let found = scene.explain_deep(4095, &params);
        assert!(
            matches!(found.reason, Reason::Saturated { .. } | Reason::FullScale { .. }),
            "{found:?}"
        );
    }
}

#[test]
fn a_line_in_the_other_direction() {
    for scene in seeds() {
        for direction in [StripeDirection::Horizontal, StripeDirection::Vertical] {
            let params = Params { stripe_direction: super::turned(direction), ..Params::default() };
            let found = Scene { direction, ..scene }.explain(&params);
            assert_eq!((found.reason, found.turned), (Reason::Direction, Some(direction)));
            assert_eq!(
                found.to_string(),
                format!(
                    "the line runs in the other direction: set stripe_direction: {}",
                    direction.name()
                )
            );
        }
    }
}

#[test]
fn a_dark_picture() {
    for (scene, background) in seeds().zip([0.0, 0.02, 0.04]) {
        let scene = Scene { line: 0.0, background, ..scene };
        let found = scene.explain(&Params::default());
        assert!(matches!(found.reason, Reason::Dark { .. }), "{found:?}");
    }
}

#[test]
fn a_saturated_picture() {
    for (scene, background) in seeds().zip([1.0, 1.005, 1.1]) {
        let found = Scene { background, ..scene }.explain(&Params::default());
        let Reason::Saturated { percent } = found.reason else { panic!("{found:?}") };
        assert!(percent > 50, "{found}");
    }
}

#[test]
fn a_line_below_the_threshold() {
    for (scene, line) in seeds().zip([0.08, 0.1, 0.12]) {
        let found = Scene { line, ..scene }.explain(&Params::default());
        let Reason::ThresholdTooHigh { line: level, full_scale: 255 } = found.reason else {
            panic!("{found:?}")
        };
        let expected = 255.0 * (line + scene.background);
        assert!((f64::from(level) - expected).abs() < 6.0, "{found}, not {expected}");
        // The remedy works.
        let remedy = "set extraction.threshold: adaptive and extraction.threshold_sigmas: 6.0";
        assert!(found.to_string().ends_with(remedy), "{found}");
        let adaptive = extraction(|params| {
            (params.threshold, params.threshold_sigmas) = (Threshold::Adaptive, 6.0);
        });
        let samples = Scene { line, ..scene }.samples(255);
        let samples: Vec<u8> = samples.into_iter().map(|level| level as u8).collect();
        assert!(super::Trials::new(&grey(&samples)).find(&adaptive).share > 0.9);
    }
}

#[test]
fn surroundings_above_the_threshold() {
    for (scene, background) in seeds().zip([0.25, 0.35, 0.45]) {
        let found = Scene { background, line: 0.4, ..scene }.explain(&Params::default());
        let Reason::ThresholdTooLow { percent } = found.reason else { panic!("{found:?}") };
        assert!(percent > 90, "{found}");
        let remedy = "set extraction.background: local, extraction.threshold: adaptive and extraction.threshold_sigmas: 6.0";
        assert!(found.to_string().ends_with(remedy), "{found}");
    }
}

#[test]
fn a_line_smaller_than_the_least_area() {
    for (scene, length) in seeds().zip([36, 42, 48]) {
        let found = Scene { length, ..scene }.explain(&Params::default());
        let Reason::Area { limit_px: 500, area_px } = found.reason else { panic!("{found:?}") };
        assert!(area_px < 500, "{found}");
    }
}

#[test]
fn a_bright_line_of_a_few_columns() {
    for (scene, length) in seeds().zip([14, 16, 18]) {
        let found = Scene { length, ..scene }.explain(&Params::default());
        let Reason::Area { limit_px: 500, area_px } = found.reason else { panic!("{found:?}") };
        let area = extraction(|params| params.min_segment_area = area_px);
        let samples: Vec<u8> =
            Scene { length, ..scene }.samples(255).into_iter().map(|level| level as u8).collect();
        assert!(super::Trials::new(&grey(&samples)).find(&area).points > 0, "{found}");
    }
}

#[test]
fn limits_that_reject_the_line() {
    let limits = [
        extraction(|params| params.max_width_px = Some(2)),
        extraction(|params| params.min_width_px = 40),
        extraction(|params| params.min_contrast = 230.0),
    ];
    for (scene, params) in seeds().zip(limits) {
        let found = scene.explain(&params);
        assert_eq!((found.reason, found.turned), (Reason::Limits, None), "{found}");
    }
}

#[test]
fn a_line_outside_the_region() {
    for (scene, y_offset) in seeds().zip([140, 150, 160]) {
        let roi = RegionOfInterest { y_offset, ..RegionOfInterest::default() };
        let found = scene.explain(&Params { roi, ..Params::default() });
        assert_eq!(found.reason, Reason::Region, "{found}");
    }
}

#[test]
fn a_line_in_another_channel() {
    for (at, scene) in seeds().enumerate() {
        let samples = scene.samples(255);
        let mut pixels = vec![2_u8; 3 * samples.len()];
        for (pixel, &level) in pixels.chunks_exact_mut(3).zip(&samples) {
            pixel[at] = level as u8;
        }
        let image = Image::packed(WIDTH as u32, HEIGHT as u32, PixelFormat::Rgb8, &pixels).unwrap();
        let laser = [Channel::Red, Channel::Green, Channel::Blue];
        let params = Params { channel: laser[(at + 1) % 3], ..Params::default() };
        let reason = Reason::Channel { channel: laser[at], background: None };
        assert_eq!(diagnose(&image, &params, None).reason, reason);
    }
}

#[test]
fn a_line_above_a_bright_background_in_another_channel() {
    for (scene, background) in seeds().zip([0.3, 0.35, 0.4]) {
        let samples = Scene { line: 0.5, background, ..scene }.samples(255);
        let pixels: Vec<u8> = samples.into_iter().flat_map(|level| [level as u8, 2, 3]).collect();
        let image = Image::packed(WIDTH as u32, HEIGHT as u32, PixelFormat::Rgb8, &pixels).unwrap();
        let params = Params { channel: Channel::Blue, ..Params::default() };
        let found = diagnose(&image, &params, None);
        let expected =
            "another channel shows the line: set channel: red and extraction.background: local";
        assert_eq!(found.to_string(), expected);
    }
}

/// The line is in the reference, too; the reference is of a brighter room; the reference is right.
#[test]
fn a_reference_that_hides_the_line() {
    for scene in seeds() {
        let picture = |scene: Scene| -> Vec<u8> {
            scene.samples(255).into_iter().map(|level| level as u8).collect()
        };
        let lit = picture(Scene { background: 0.2, ..scene });
        let found = |reference: Scene, change: fn(&mut ExtractionParams)| {
            let params = extraction(|params| {
                params.background = Background::Reference;
                change(params);
            });
            let reference = picture(reference);
            diagnose(&grey(&lit), &params, Some(&grey(&reference)))
        };
        let room = Scene { background: 0.2, line: 0.0, seed: 9, ..scene };
        for reference in [Scene { line: scene.line, ..room }, Scene { background: 0.95, ..room }] {
            let reference = Scene { seed: scene.seed, ..reference };
            let found = found(reference, |_| {});
            assert_eq!((found.reason, found.turned), (Reason::Reference, None), "{found}");
            assert!(found.to_string().ends_with("take it again without laser"), "{found}");
        }
        let found = found(room, |params| params.segment_threshold = 240.0);
        assert!(matches!(found.reason, Reason::ThresholdTooHigh { .. }), "{found:?}");
    }
}

#[test]
fn a_picture_without_a_line() {
    for (scene, background) in seeds().zip([0.1, 0.11, 0.12]) {
        let scene = Scene { line: 0.0, noise: 0.03, background, ..scene };
        let found = scene.explain(&Params::default());
        assert_eq!(found.reason, Reason::NoLine, "{found}");
    }
}
