use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};

use crate::scanner::{
    frame_index::FrameIndex,
    image::{Frame, Image, PixelFormat},
    params::{Channel, Params, StripeDirection},
    pipeline::Pipeline,
    stripe::{Centerline, flag},
};

use super::ChannelChoice;

const LENGTH: usize = 320;
const ACROSS: usize = 240;

/// A line as a colour camera sees it: a core that is clipped to white, and a halo on one side in the laser's colour.
#[derive(Clone, Copy)]
struct Scene {
    /// 0 red, 1 green, 2 blue.
    laser: usize,
    /// Light of the core in the laser's colour, times full scale.
    exposure: f64,
    /// Share of the light that the other colours see.
    crosstalk: f64,
    /// Light of the halo over that of the core.
    halo: f64,
    /// Brighter side of the halo, 1 or -1.
    side: f64,
    direction: StripeDirection,
}

const RED: Scene = Scene {
    laser: 0,
    exposure: 3.5,
    crosstalk: 0.25,
    halo: 0.22,
    side: 1.0,
    direction: StripeDirection::Horizontal,
};

/// True centre across the line.
fn center_px(along: usize) -> f64 {
    120.0 + 0.05 * along as f64
}

impl Scene {
    fn light(&self, along: usize, across: usize, colour: usize) -> f64 {
        let distance = across as f64 - center_px(along);
        let core = libm::exp(-distance * distance / 8.0);
        let beside = self.side * distance;
        let halo =
            if beside > 0.0 { libm::exp(-beside / 8.0) } else { 0.5 * libm::exp(beside / 4.0) };
        let (of_core, of_halo) =
            if colour == self.laser { (1.0, 1.0) } else { (self.crosstalk, 0.05) };
        255.0 * self.exposure * (of_core * core + of_halo * self.halo * halo)
    }

    fn render(&self) -> Vec<u8> {
        let mut rng = ChaCha8Rng::from_seed([7; 32]);
        let noise = Normal::new(0.0, 2.0).unwrap();
        let (width, height) = self.size();
        let mut samples = Vec::with_capacity(3 * width * height);
        for row in 0..height {
            for column in 0..width {
                let (along, across) = match self.direction {
                    StripeDirection::Horizontal => (column, row),
                    StripeDirection::Vertical => (row, column),
                };
                for colour in 0..3 {
                    let level = self.light(along, across, colour) + noise.sample(&mut rng);
                    samples.push(level.clamp(0.0, 255.0) as u8);
                }
            }
        }
        samples
    }

    const fn size(&self) -> (usize, usize) {
        match self.direction {
            StripeDirection::Horizontal => (LENGTH, ACROSS),
            StripeDirection::Vertical => (ACROSS, LENGTH),
        }
    }

    fn params(&self, channel: Channel) -> Params {
        Params { channel, stripe_direction: self.direction, ..Params::default() }
    }

    fn measure(&self, channel: Channel) -> (Centerline, Channel, Option<ChannelChoice>) {
        let mut pipeline = Pipeline::new(self.params(channel), None);
        measure(&mut pipeline, &self.render(), self.size())
    }
}

fn measure(
    pipeline: &mut Pipeline,
    samples: &[u8],
    (width, height): (usize, usize),
) -> (Centerline, Channel, Option<ChannelChoice>) {
    let image = Image::packed(width as u32, height as u32, PixelFormat::Rgb8, samples).unwrap();
    let frame = Frame { stamp_ns: 0, image };
    let output = pipeline.process(&frame, FrameIndex::default(), |_| ()).unwrap();
    (output.centerline.clone(), output.channel, output.channel_choice)
}

/// Median error of the points that carry no flag of doubt, and their share of all cross-sections.
fn error_px(line: &Centerline, direction: StripeDirection) -> (f64, f64) {
    let (along, across) = line.along_and_across(direction);
    let sound = flag::SATURATED;
    let mut errors: Vec<f64> = along
        .iter()
        .zip(across)
        .zip(&line.flags)
        .filter(|(_, flags)| *flags & !sound == 0)
        .map(|((&along, &across), _)| f64::from(across) - center_px(along as usize))
        .collect();
    let share = errors.len() as f64 / LENGTH as f64;
    errors.sort_by(f64::total_cmp);
    (errors.get(errors.len() / 2).copied().unwrap_or(0.0), share)
}

/// Scenes of every laser and side of the halo, at this exposure.
fn scenes(exposure: f64) -> impl Iterator<Item = Scene> {
    let of_laser = move |laser| [1.0, -1.0].map(|side| Scene { laser, exposure, side, ..RED });
    (0..3).flat_map(of_laser)
}

#[test]
fn a_clipped_line_is_measured_in_a_channel_that_holds_its_shape() {
    let mut worst_of_max = 0.0_f64;
    for (exposure, limit_px) in [(1.0, 0.1), (2.0, 0.1), (3.5, 0.1), (5.0, 0.1), (10.0, 0.15)] {
        for scene in scenes(exposure) {
            let (line, channel, choice) = scene.measure(Channel::Auto);
            let (error, share) = error_px(&line, scene.direction);
            let own = [Channel::Red, Channel::Green, Channel::Blue][scene.laser];
            assert!(channel != own && channel != Channel::Gray, "{exposure} {channel:?}");
            assert!(share > 0.9, "{exposure} {channel:?}: {share}");
            assert!(error.abs() <= limit_px, "{exposure} {channel:?}: {error} px");
            let choice = choice.unwrap();
            assert_eq!(choice.channel, channel);
            assert!(choice.brightest_clipped > 0.9, "{choice:?}");
            worst_of_max = worst_of_max.max(error_of_all(&scene, Channel::Max));
        }
    }
    assert!(worst_of_max > 1.0, "the scenes tell good from bad: {worst_of_max} px");
}

/// Median error of all points of a scene, pixels, without regard to flags.
fn error_of_all(scene: &Scene, channel: Channel) -> f64 {
    let (mut line, ..) = scene.measure(channel);
    line.flags.fill(0);
    error_px(&line, scene.direction).0.abs()
}

#[test]
fn a_line_within_range_is_measured_in_its_own_colour() {
    for scene in scenes(0.8) {
        let scene = Scene { halo: 0.0, ..scene };
        let own = [Channel::Red, Channel::Green, Channel::Blue][scene.laser];
        let (line, channel, _) = scene.measure(Channel::Auto);
        assert_eq!(channel, own);
        let (error, share) = error_px(&line, scene.direction);
        assert!(error.abs() < 0.02 && share > 0.9, "{error} px, {share}");
    }
}

#[test]
fn vertical_lines_are_judged_across_their_direction() {
    for laser in 0..3 {
        let scene = Scene { laser, direction: StripeDirection::Vertical, ..RED };
        let (line, channel, _) = scene.measure(Channel::Auto);
        let own = [Channel::Red, Channel::Green, Channel::Blue][laser];
        assert_ne!(channel, own);
        let (error, share) = error_px(&line, scene.direction);
        assert!(error.abs() < 0.1 && share > 0.9, "{error} px, {share}");
    }
}

#[test]
fn colours_that_are_equal_count_as_gray() {
    let scene = Scene { crosstalk: 1.0, halo: 0.0, exposure: 0.7, ..RED };
    let samples: Vec<u8> = scene.render().chunks_exact(3).flat_map(|pixel| [pixel[0]; 3]).collect();
    let mut pipeline = Pipeline::new(scene.params(Channel::Auto), None);
    assert_eq!(measure(&mut pipeline, &samples, scene.size()).1, Channel::Gray);
}

#[test]
fn a_named_channel_is_measured_as_named() {
    let (_, channel, choice) = RED.measure(Channel::Red);
    assert_eq!((channel, choice), (Channel::Red, None));
}

#[test]
fn the_choice_waits_for_a_line_and_holds_until_the_scan_ends() {
    let dark = Scene { exposure: 0.0, ..RED }.render();
    let (bright, dim) = (RED.render(), Scene { exposure: 0.6, ..RED }.render());
    let mut pipeline = Pipeline::new(RED.params(Channel::Auto), None);
    let used = |pipeline: &mut Pipeline, samples| measure(pipeline, samples, RED.size()).1;
    assert_eq!(used(&mut pipeline, &dark), Channel::Max, "nothing to choose by");
    assert_eq!(used(&mut pipeline, &bright), Channel::Green);
    assert_eq!(used(&mut pipeline, &dim), Channel::Green, "held");
    pipeline.finish(0, 0);
    assert_eq!(used(&mut pipeline, &dim), Channel::Red, "another scan");
    // A new threshold does not change what the channels show; another region does.
    let mut params = RED.params(Channel::Auto);
    params.extraction.segment_threshold = 40.0;
    pipeline.reconfigure(params);
    assert_eq!(used(&mut pipeline, &bright), Channel::Red);
    params.roi.x_offset = 8;
    pipeline.reconfigure(params);
    assert_eq!(used(&mut pipeline, &bright), Channel::Green);
}

#[test]
fn grey_images_are_measured_as_they_are() {
    let image = Image::packed(4, 4, PixelFormat::Mono8, &[9; 16]).unwrap();
    let mut pipeline = Pipeline::new(RED.params(Channel::Auto), None);
    let frame = Frame { stamp_ns: 0, image };
    let output = pipeline.process(&frame, FrameIndex::default(), |_| ()).unwrap();
    assert_eq!((output.channel, output.channel_choice), (Channel::Auto, None));
}
