//! Pictures of the hard scenes.

use rand_chacha::ChaCha8Rng;

use super::{ACROSS_PX, HardScene, LENGTH_PX, Texture};
use crate::{
    scanner::{
        image::{Image, PixelFormat},
        params::StripeDirection,
    },
    simulate::{
        exposure::{CrossSection, Exposure},
        noise::frame_rng,
        sensor::{BitDepth, Sensor},
        speckle::Speckle,
        texture::mottle,
    },
};

/// Standard deviation of the read noise, grey levels.
pub(super) const READ_NOISE: f64 = 2.0;
/// Variance of the shot noise per grey level.
pub(super) const SHOT_GAIN: f64 = 0.05;
const FULL_SCALE: f64 = 255.0;
/// Grey level of the room.
const ROOM: f32 = 6.0;
/// Light of the line that the other colours' filters pass, as a share of its own colour's.
const CROSSTALK: f64 = 0.25;
/// The same for the halo, which is scattered in the surface and keeps more of the laser's colour.
const HALO_CROSSTALK: f64 = 0.05;

/// A rendered picture; its buffers are reused.
#[derive(Debug, Default)]
pub(super) struct Picture {
    own: Exposure,
    others: Exposure,
    plane: Vec<u8>,
    samples: Vec<u8>,
    size_px: [u32; 2],
    is_colour: bool,
}

impl Picture {
    /// The picture as a camera delivers it; `None` before the first scene.
    pub(super) fn image(&self) -> Option<Image<'_>> {
        let [width, height] = self.size_px;
        let format = if self.is_colour { PixelFormat::Rgb8 } else { PixelFormat::Mono8 };
        Image::packed(width, height, format, &self.samples).ok()
    }

    /// Renders a scene.
    pub(super) fn render(&mut self, scene: &HardScene) {
        self.is_colour = scene.halo.is_some();
        self.size_px = match scene.direction {
            StripeDirection::Horizontal => [LENGTH_PX, ACROSS_PX],
            StripeDirection::Vertical => [ACROSS_PX, LENGTH_PX],
        };
        let mut rng = frame_rng(u64::from(scene.seed), 0);
        let unevenness = scene.texture.map(|texture| factors(texture, scene.seed, &mut rng));
        for (exposure, crosstalk, halo_crosstalk) in
            [(&mut self.own, 1.0, 1.0), (&mut self.others, CROSSTALK, HALO_CROSSTALK)]
        {
            exposure.reset(LENGTH_PX, ACROSS_PX, 0.0);
            add_lines(exposure, scene, crosstalk);
            add_halo(exposure, scene, halo_crosstalk);
            if let Some(factors) = &unevenness {
                exposure.multiply(factors);
            }
            exposure.add(|_, _| ROOM);
            if !self.is_colour {
                break;
            }
        }
        let num_planes = if self.is_colour { 3 } else { 1 };
        self.samples.resize((LENGTH_PX * ACROSS_PX) as usize * num_planes, 0);
        let sensor =
            Sensor { bit_depth: BitDepth::Eight, read_noise: READ_NOISE, shot_gain: SHOT_GAIN };
        // The laser is red, green or blue.
        let own = scene.number as usize % num_planes;
        for channel in 0..num_planes {
            let exposure = if channel == own { &self.own } else { &self.others };
            sensor.read_out(exposure, &mut rng, &mut self.plane);
            self.place(scene.direction, channel, num_planes);
        }
    }

    /// Copies the plane to its channel, turned for a vertical line.
    fn place(&mut self, direction: StripeDirection, channel: usize, num_planes: usize) {
        let (length, across) = (LENGTH_PX as usize, ACROSS_PX as usize);
        for (row, line) in self.plane.chunks_exact(length).enumerate() {
            for (column, &sample) in line.iter().enumerate() {
                let at = match direction {
                    StripeDirection::Horizontal => row * length + column,
                    StripeDirection::Vertical => column * across + row,
                };
                self.samples[at * num_planes + channel] = sample;
            }
        }
    }
}

/// Adds the line, the second line and the glow.
fn add_lines(exposure: &mut Exposure, scene: &HardScene, crosstalk: f64) {
    let light = FULL_SCALE * scene.saturation;
    let mut add = |offset_px: f64, amplitude: f64, sigma_px: f64| {
        exposure.add_stripe(StripeDirection::Horizontal, |column| CrossSection {
            center_px: scene.center_px(column) + offset_px,
            amplitude: crosstalk * amplitude,
            sigma_px,
        });
    };
    add(0.0, light, scene.sigma_px);
    if let Some(second) = scene.second {
        add(second.distance_px, second.share * light, scene.sigma_px);
    }
    if let Some(glow) = scene.glow {
        add(glow.distance_px, glow.share * light.min(FULL_SCALE), glow.sigma_px);
    }
}

fn add_halo(exposure: &mut Exposure, scene: &HardScene, crosstalk: f64) {
    let Some(halo) = scene.halo else { return };
    exposure.add(|column, row| {
        let distance = (f64::from(row) - scene.center_px(column)) / halo.length_px;
        let shape =
            if distance > 0.0 { libm::exp(-distance) } else { 0.5 * libm::exp(2.0 * distance) };
        (FULL_SCALE * halo.share * crosstalk * shape) as f32
    });
}

/// Returns the brightness of every pixel as a share of the even one, row by row.
fn factors(texture: Texture, seed: u32, rng: &mut ChaCha8Rng) -> Vec<f32> {
    match texture {
        Texture::Speckle { contrast, grain_px } => {
            Speckle { contrast, grain_px }.pattern(rng, (LENGTH_PX as usize, ACROSS_PX as usize))
        }
        Texture::Patches { depth, size_px } => {
            let pixels =
                (0..ACROSS_PX).flat_map(|row| (0..LENGTH_PX).map(move |column| [column, row]));
            let share = |at| 1.0 - depth * (0.5 + 0.5 * mottle(seed.into(), size_px, at));
            pixels.map(|at| share(at) as f32).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::hard::{Halo, grid};

    /// Returns the level of a channel at a distance across from the line, rounded to pixels.
    fn level(picture: &Picture, scene: &HardScene, along: u32, offset: f64, channel: usize) -> u8 {
        let across = (scene.center_px(along) + offset).round() as usize;
        let [width, _] = picture.size_px.map(|side| side as usize);
        let at = match scene.direction {
            StripeDirection::Horizontal => across * width + along as usize,
            StripeDirection::Vertical => along as usize * width + across,
        };
        let num_planes = if picture.is_colour { 3 } else { 1 };
        picture.samples[at * num_planes + channel]
    }

    #[test]
    fn the_line_lies_at_its_true_centre_in_both_directions() {
        for direction in [StripeDirection::Horizontal, StripeDirection::Vertical] {
            let scene = HardScene { direction, saturation: 0.7, ..grid(0)[1] };
            let mut picture = Picture::default();
            picture.render(&scene);
            assert!(picture.image().is_some());
            for along in (0..LENGTH_PX).step_by(37) {
                let (mut flux, mut moment) = (0.0, 0.0);
                for offset in -8..=8 {
                    let across = (scene.center_px(along) + f64::from(offset)).round();
                    let of = level(&picture, &scene, along, f64::from(offset), 0);
                    let light = f64::from(of) - f64::from(ROOM);
                    flux += light;
                    moment += light * across;
                }
                assert!((moment / flux - scene.center_px(along)).abs() < 0.4, "{along}");
            }
        }
    }

    #[test]
    fn the_halo_is_one_sided_and_in_the_laser_s_colour() {
        for number in 0..3 {
            let halo = Some(Halo { share: 0.5, length_px: 8.0 });
            let scene = HardScene {
                number,
                direction: StripeDirection::Horizontal,
                saturation: 3.5,
                halo,
                ..grid(0)[0]
            };
            let mut picture = Picture::default();
            picture.render(&scene);
            let own = number as usize % 3;
            let mean = |offset: f64, channel: usize| {
                let sum: u32 = (0..LENGTH_PX)
                    .map(|along| u32::from(level(&picture, &scene, along, offset, channel)))
                    .sum();
                sum / LENGTH_PX
            };
            assert!(mean(12.0, own) > 25 && mean(-12.0, own) < 12);
            assert!(mean(12.0, (own + 1) % 3) < 12);
            assert!(mean(0.0, own) == 255 && mean(0.0, (own + 1) % 3) > 180);
        }
    }
}
