//! The noise test of Yao et al. 2023, section 4.3: Gaussian noise on top of an image, as if the camera had been worse.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::scanner::channel::{AnyPlane, Plane};

/// Standard deviations of the noise test, grey levels of an 8-bit scale.
pub const GAMMAS: [f64; 5] = [10.0, 20.0, 30.0, 40.0, 50.0];

/// A noisy copy of a plane, in a reused buffer.
#[derive(Debug, Default)]
pub struct NoisyPlane {
    eight: Vec<u8>,
    sixteen: Vec<u16>,
}

impl NoisyPlane {
    /// Returns `plane` plus Gaussian noise of standard deviation `sigma` in units of its samples, rounded and clipped
    /// to 0 … `full_scale`.
    pub fn add<'a>(
        &'a mut self,
        plane: &AnyPlane<'_>,
        sigma: f64,
        full_scale: u32,
        rng: &mut impl Rng,
    ) -> AnyPlane<'a> {
        let mut noisy = |sample: u32| {
            let deviation: f64 = StandardNormal.sample(rng);
            (f64::from(sample) + sigma * deviation).round().clamp(0.0, f64::from(full_scale))
        };
        match plane {
            AnyPlane::Eight(plane) => {
                fill(&mut self.eight, plane, |sample| noisy(u32::from(sample)) as u8);
                AnyPlane::Eight(packed(plane, &self.eight))
            }
            AnyPlane::Sixteen(plane) => {
                fill(&mut self.sixteen, plane, |sample| noisy(u32::from(sample)) as u16);
                AnyPlane::Sixteen(packed(plane, &self.sixteen))
            }
        }
    }
}

fn fill<S: Copy>(samples: &mut Vec<S>, plane: &Plane<'_, S>, mut noisy: impl FnMut(S) -> S) {
    samples.clear();
    for y in 0..plane.height {
        samples.extend(plane.row(y).iter().map(|&sample| noisy(sample)));
    }
}

const fn packed<'a, S>(plane: &Plane<'_, S>, samples: &'a [S]) -> Plane<'a, S> {
    Plane { width: plane.width, height: plane.height, stride: plane.width, samples }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::noise::frame_rng;

    #[test]
    fn noise_has_the_stated_deviation_is_clipped_and_repeats() {
        let samples = vec![2000_u16; 200 * 101];
        let plane = Plane { width: 200, height: 100, stride: 202, samples: &samples };
        let mut buffer = NoisyPlane::default();
        let mut draw = |sigma, seed| {
            let rng = &mut frame_rng(seed, 3);
            match buffer.add(&AnyPlane::Sixteen(plane), sigma, 4095, rng) {
                AnyPlane::Sixteen(plane) => plane.samples.to_vec(),
                AnyPlane::Eight(_) => Vec::new(),
            }
        };
        let noisy = draw(50.0, 1);
        assert_eq!(noisy.len(), 20_000, "the padding is left out");
        let variance =
            noisy.iter().map(|&s| (f64::from(s) - 2000.0).powi(2)).sum::<f64>() / 20_000.0;
        // 4 standard errors of a variance.
        assert!((variance / 2500.0 - 1.0).abs() < 4.0 * (2.0_f64 / 20_000.0).sqrt(), "{variance}");
        assert_eq!(noisy, draw(50.0, 1));
        assert_ne!(noisy, draw(50.0, 2));
        let wild = draw(1e5, 1);
        assert!(wild.contains(&0) && wild.contains(&4095));
        assert!(wild.iter().all(|&sample| sample <= 4095));
    }
}
