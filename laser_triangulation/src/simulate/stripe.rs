//! One stripe around a centre that the caller chooses: the simplest image with a known answer.

use super::{
    exposure::{CrossSection, Exposure},
    noise::frame_rng,
    sensor::{BitDepth, Sensor},
};
use crate::scanner::params::StripeDirection;

/// A stripe over an even background. Grey levels are those of the bit depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StripeScene {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Direction of the stripe.
    pub direction: StripeDirection,
    /// Bits per sample.
    pub bit_depth: BitDepth,
    /// Peak grey level above the background, for infinitely small pixels; may exceed full scale.
    pub amplitude: f64,
    /// Standard deviation across the stripe, pixels.
    pub sigma_px: f64,
    /// Grey level without the stripe.
    pub background: f64,
    /// Standard deviation of the read noise, grey levels.
    pub read_noise: f64,
    /// Variance of the shot noise per grey level, grey levels.
    pub shot_gain: f64,
    /// Seed of the noise.
    pub seed: u64,
}

impl Default for StripeScene {
    /// Returns an 8-bit stripe from left to right in 640 x 480 pixels, without noise.
    fn default() -> Self {
        Self {
            width: 640,
            height: 480,
            direction: StripeDirection::Horizontal,
            bit_depth: BitDepth::Eight,
            amplitude: 183.0,
            sigma_px: 2.3,
            background: 0.0,
            read_noise: 0.0,
            shot_gain: 0.0,
            seed: 0,
        }
    }
}

/// Replaces `samples` by the image of a stripe whose centre in each column is `center(column)`, pixels; NaN: no stripe
/// in that column. For a vertical stripe read "row" for "column". Rows have no padding, samples of more than 8 bits are
/// little endian.
///
/// ```
/// use laser_triangulation::simulate::stripe::{StripeScene, render_stripe};
///
/// let scene = StripeScene { width: 3, height: 5, sigma_px: 0.5, ..StripeScene::default() };
/// let mut samples = Vec::new();
/// render_stripe(&scene, |column| f64::from(column) + 1.0, &mut samples);
/// assert_eq!(samples, [
///      36,   0,   0,
///     157,  36,   0,
///      36, 157,  36,
///       0,  36, 157,
///       0,   0,  36,
/// ]);
/// ```
pub fn render_stripe(scene: &StripeScene, center: impl Fn(u32) -> f64, samples: &mut Vec<u8>) {
    let mut exposure = Exposure::default();
    exposure.reset(scene.width, scene.height, scene.background as f32);
    exposure.add_stripe(scene.direction, |column| CrossSection {
        center_px: center(column),
        amplitude: scene.amplitude,
        sigma_px: scene.sigma_px,
    });
    let sensor = Sensor {
        bit_depth: scene.bit_depth,
        read_noise: scene.read_noise,
        shot_gain: scene.shot_gain,
    };
    sensor.read_out(&exposure, &mut frame_rng(scene.seed, 0), samples);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(scene: &StripeScene) -> Vec<u8> {
        let mut samples = Vec::new();
        render_stripe(scene, |column| 20.0 + 0.01 * f64::from(column), &mut samples);
        samples
    }

    #[test]
    fn the_centroid_of_rounded_samples_is_the_given_centre() {
        let scene = StripeScene {
            height: 48,
            bit_depth: BitDepth::Sixteen,
            amplitude: 50_000.0,
            ..StripeScene::default()
        };
        let bytes = picture(&scene);
        for column in 0..640 {
            let level = |row: usize| {
                let at = 2 * (row * 640 + column);
                f64::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]))
            };
            let flux: f64 = (0..48).map(level).sum();
            let moment: f64 = (0..48).map(|row| row as f64 * level(row)).sum();
            let truth = 20.0 + 0.01 * column as f64;
            assert!((moment / flux - truth).abs() < 1e-3, "{column}: {}", moment / flux - truth);
        }
    }

    #[test]
    fn the_image_depends_on_the_seed() {
        let noisy =
            StripeScene { read_noise: 2.0, shot_gain: 0.1, seed: 7, ..StripeScene::default() };
        assert_eq!(picture(&noisy), picture(&noisy));
        assert_ne!(picture(&noisy), picture(&StripeScene { seed: 8, ..noisy }));
    }

    #[test]
    fn a_bright_stripe_saturates_flat() {
        let bytes = picture(&StripeScene { amplitude: 690.0, ..StripeScene::default() });
        let column: Vec<u8> = bytes.iter().step_by(640).copied().collect();
        // 690·exp(−x²/2s²) > 255 for |x| < 3.2 px about row 20.
        assert!(column[17..=23].iter().all(|&level| level == 255));
        assert!(column[16] < 255 && column[24] < 255);
    }
}
