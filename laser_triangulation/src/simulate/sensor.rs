//! From expected grey levels to samples: noise, saturation, rounding.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Deserialize;

use super::exposure::Exposure;

/// Bits per sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
pub enum BitDepth {
    /// One byte, full scale 255.
    #[default]
    #[serde(rename = "8")]
    Eight,
    /// Two bytes, least significant first, full scale 4095.
    #[serde(rename = "12")]
    Twelve,
    /// Two bytes, least significant first, full scale 65535.
    #[serde(rename = "16")]
    Sixteen,
}

impl BitDepth {
    /// Returns the grey level of a saturated sample.
    pub const fn full_scale(self) -> u16 {
        match self {
            Self::Eight => 255,
            Self::Twelve => 4095,
            Self::Sixteen => 65_535,
        }
    }

    /// Returns the number of bytes per sample.
    pub const fn bytes_per_pixel(self) -> u32 {
        match self {
            Self::Eight => 1,
            Self::Twelve | Self::Sixteen => 2,
        }
    }
}

/// A camera sensor: converts light to numbers. Grey levels are those of its bit depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Bits per sample.
    pub bit_depth: BitDepth,
    /// Standard deviation of the noise that does not depend on the light, grey levels.
    pub read_noise: f64,
    /// Variance of the shot noise per grey level, grey levels.
    pub shot_gain: f64,
}

impl Sensor {
    /// Replaces `samples` by the sensor's output, rows without padding.
    ///
    /// Each sample is its expected level plus Gaussian noise of variance `read_noise² + shot_gain · level`, rounded to
    /// the nearest integer, clipped to 0 … full scale.
    pub fn read_out(&self, exposure: &Exposure, rng: &mut impl Rng, samples: &mut Vec<u8>) {
        let full_scale = f32::from(self.bit_depth.full_scale());
        let read_variance = (self.read_noise * self.read_noise) as f32;
        let shot_gain = self.shot_gain as f32;
        let noisy = read_variance > 0.0 || shot_gain > 0.0;
        let quantised = exposure.levels().iter().map(|&level| {
            let mut level = level;
            if noisy {
                let sigma = (read_variance + shot_gain * level.max(0.0)).sqrt();
                let deviation: f32 = StandardNormal.sample(rng);
                level += sigma * deviation;
            }
            level.round().clamp(0.0, full_scale) as u16
        });
        samples.clear();
        match self.bit_depth {
            BitDepth::Eight => samples.extend(quantised.map(|level| level as u8)),
            BitDepth::Twelve | BitDepth::Sixteen => {
                samples.extend(quantised.flat_map(u16::to_le_bytes));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::noise::frame_rng;

    fn even(level: f32) -> Exposure {
        let mut exposure = Exposure::default();
        exposure.reset(200, 200, level);
        exposure
    }

    fn read(sensor: Sensor, level: f32) -> Vec<u8> {
        let mut samples = Vec::new();
        sensor.read_out(&even(level), &mut frame_rng(1, 0), &mut samples);
        samples
    }

    #[test]
    fn without_noise_levels_are_rounded_and_clipped() {
        let quiet = |bit_depth| Sensor { bit_depth, read_noise: 0.0, shot_gain: 0.0 };
        for (level, sample) in [(-3.0, 0), (17.4, 17), (17.6, 18), (254.6, 255), (1e9, 255)] {
            assert!(read(quiet(BitDepth::Eight), level).iter().all(|&s| s == sample));
        }
        for (depth, level, sample) in [
            (BitDepth::Twelve, 9e4, 4095),
            (BitDepth::Sixteen, 9e4, 65_535),
            (BitDepth::Twelve, 300.2, 300),
        ] {
            let bytes = read(quiet(depth), level);
            assert_eq!(bytes.len(), 80_000);
            assert!(bytes.chunks(2).all(|b| u16::from_le_bytes([b[0], b[1]]) == sample));
        }
    }

    #[test]
    fn noise_has_the_stated_variance() {
        let sensor = Sensor { bit_depth: BitDepth::Twelve, read_noise: 3.0, shot_gain: 0.2 };
        let samples: Vec<f64> = read(sensor, 1000.0)
            .chunks(2)
            .map(|b| f64::from(u16::from_le_bytes([b[0], b[1]])))
            .collect();
        let count = samples.len() as f64;
        let mean = samples.iter().sum::<f64>() / count;
        let variance = samples.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / count;
        // 3² + 0.2 · 1000, plus 1/12 from the rounding; 4 standard errors of 40,000 samples.
        assert!((mean - 1000.0).abs() < 4.0 * (209.0_f64 / count).sqrt(), "{mean}");
        assert!((variance - 209.083).abs() < 4.0 * 209.0 * (2.0 / count).sqrt(), "{variance}");
    }
}
