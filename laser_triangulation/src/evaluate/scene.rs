//! A stripe with a known centre in every column, as a camera sees it.

use rand_chacha::ChaCha8Rng;

use crate::{
    scanner::{
        channel::{AnyPlane, Plane},
        params::StripeDirection,
    },
    simulate::{
        exposure::{CrossSection, Exposure},
        noise::frame_rng,
        sensor::Sensor,
        speckle::Speckle,
        stripe::StripeScene,
    },
};

/// Number of parts in which each column of a sloping stripe is rendered.
const SUB_COLUMNS: u32 = 16;

/// The centre of the stripe as a function of the column, pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Course {
    /// A slow wave that covers every sub-pixel phase many times: 110 + 0.0137 u + 4 sin(u / 211).
    Wave,
    /// Constant.
    Level {
        /// Centre.
        center_px: f64,
    },
    /// Straight and inclined.
    Slope {
        /// Centre at column 0.
        start_px: f64,
        /// Rise, pixels per column: the tangent of the angle.
        rise_px: f64,
    },
    /// Constant, with a step at one column.
    Step {
        /// Centre before the step.
        start_px: f64,
        /// First column after the step.
        column: u32,
        /// Rise, pixels.
        rise_px: f64,
    },
}

impl Course {
    /// Returns the centre of the stripe at a position along it.
    pub(crate) fn center_px(&self, column: f64) -> f64 {
        match *self {
            Self::Wave => 110.0 + 0.0137 * column + 4.0 * libm::sin(column / 211.0),
            Self::Level { center_px } => center_px,
            Self::Slope { start_px, rise_px } => start_px + rise_px * column,
            Self::Step { start_px, column: first, rise_px } => {
                start_px + if column < f64::from(first) { 0.0 } else { rise_px }
            }
        }
    }

    /// Returns the rise, pixels per column, where it matters within a column.
    pub(crate) const fn slope_px(&self) -> f64 {
        match *self {
            Self::Slope { rise_px, .. } => rise_px,
            _ => 0.0,
        }
    }
}

/// One stripe in 8-bit images: light, course and speckle. Frames of a scene differ only in their noise and in their
/// speckle pattern.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scene {
    /// Size, light and noise. The stripe runs from left to right.
    pub(crate) stripe: StripeScene,
    /// Centre of the stripe.
    pub(crate) course: Course,
    /// Speckle of the stripe.
    pub(crate) speckle: Option<Speckle>,
}

impl Scene {
    /// Renders frame `number` into reused buffers.
    ///
    /// A sloping stripe has the standard deviation `sigma_px` at right angles to its course; its light is integrated
    /// over the pixels in both directions.
    pub(crate) fn render(&self, number: u32, picture: &mut Picture) {
        let StripeScene { width, height, amplitude, sigma_px, background, .. } = self.stripe;
        let mut rng = frame_rng(self.stripe.seed, u64::from(number));
        let exposure = &mut picture.exposure;
        exposure.reset(width, height, 0.0);
        let slope_px = self.course.slope_px();
        let parts = if slope_px == 0.0 { 1 } else { SUB_COLUMNS };
        for part in 0..parts {
            let offset = (f64::from(part) + 0.5) / f64::from(parts) - 0.5;
            exposure.add_stripe(StripeDirection::Horizontal, |column| CrossSection {
                center_px: self.course.center_px(f64::from(column) + offset),
                amplitude: amplitude / f64::from(parts),
                sigma_px: sigma_px * slope_px.hypot(1.0),
            });
        }
        self.make_granular(exposure, &mut rng);
        exposure.add(|_, _| background as f32);
        let StripeScene { bit_depth, read_noise, shot_gain, .. } = self.stripe;
        let sensor = Sensor { bit_depth, read_noise, shot_gain };
        sensor.read_out(exposure, &mut rng, &mut picture.samples);
        picture.size_px = (width as usize, height as usize);
    }

    fn make_granular(&self, exposure: &mut Exposure, rng: &mut ChaCha8Rng) {
        if let Some(speckle) = &self.speckle {
            let size_px = (self.stripe.width as usize, self.stripe.height as usize);
            exposure.multiply(&speckle.pattern(rng, size_px));
        }
    }
}

/// A rendered frame.
#[derive(Debug, Default)]
pub(crate) struct Picture {
    exposure: Exposure,
    samples: Vec<u8>,
    size_px: (usize, usize),
}

impl Picture {
    /// Its samples.
    pub(crate) fn plane(&self) -> AnyPlane<'_> {
        let (width, height) = self.size_px;
        AnyPlane::Eight(Plane { width, height, stride: width, samples: &self.samples })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::stripe::render_stripe;

    fn samples(scene: &Scene, number: u32) -> Vec<u8> {
        let mut picture = Picture::default();
        scene.render(number, &mut picture);
        picture.samples
    }

    #[test]
    fn a_plain_scene_equals_the_renderers_stripe() {
        let stripe = StripeScene {
            width: 300,
            height: 256,
            read_noise: 3.0,
            shot_gain: 0.1,
            seed: 4,
            ..StripeScene::default()
        };
        let scene = Scene { stripe, course: Course::Wave, speckle: None };
        let mut expected = Vec::new();
        render_stripe(&stripe, |column| Course::Wave.center_px(f64::from(column)), &mut expected);
        assert_eq!(samples(&scene, 0), expected);
        assert_ne!(samples(&scene, 1), expected, "every frame has noise of its own");
    }

    /// Returns centroid and variance of the light in a column, from samples without noise.
    #[test]
    fn a_sloping_stripe_keeps_its_centre_and_gets_wider() {
        for rise_px in [0.5, 1.0, 3.0_f64.sqrt()] {
            let course = Course::Slope { start_px: 40.3, rise_px };
            let stripe = StripeScene { width: 60, height: 200, ..StripeScene::default() };
            let bytes = samples(&Scene { stripe, course, speckle: None }, 0);
            let level = |row: usize| f64::from(bytes[row * 60 + 30]);
            let flux: f64 = (0..200).map(level).sum();
            let center = (0..200).map(|row| row as f64 * level(row)).sum::<f64>() / flux;
            let variance =
                (0..200).map(|row| (row as f64 - center).powi(2) * level(row)).sum::<f64>() / flux;
            assert!((center - course.center_px(30.0)).abs() < 0.02, "{rise_px}: {center}");
            // The oblique cut s / cos, plus the box that the stripe crosses within the column and within the pixel.
            let expected =
                2.3_f64.powi(2) * (1.0 + rise_px * rise_px) + (rise_px * rise_px + 1.0) / 12.0;
            assert!((variance / expected - 1.0).abs() < 0.02, "{rise_px}: {variance} {expected}");
        }
    }

    #[test]
    fn a_step_and_speckle_appear_in_the_right_columns() {
        let course = Course::Step { start_px: 30.0, column: 20, rise_px: 7.0 };
        assert!((course.center_px(19.0) - 30.0).abs() < 1e-12);
        assert!((course.center_px(20.0) - 37.0).abs() < 1e-12);
        let stripe =
            StripeScene { width: 50, height: 64, background: 10.0, ..StripeScene::default() };
        let speckle = Some(Speckle { contrast: 0.5, grain_px: 1.0 });
        let granular = samples(&Scene { stripe, course, speckle }, 0);
        let even = samples(&Scene { stripe, course, speckle: None }, 0);
        assert_ne!(granular, even);
        assert_eq!(granular[..50], even[..50], "the ambient light is not the laser's");
    }
}
