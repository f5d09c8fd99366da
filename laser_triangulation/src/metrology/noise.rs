//! Surfaces with known noise, for tests.

use nalgebra::Point3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::surface::Surface;

/// Returns noise of unit standard deviation, smoothed over `smooth` neighbours along the rows.
pub(super) fn noise(width: usize, height: usize, smooth: usize, seed: u64) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = Vec::with_capacity(width * height);
    for _ in 0..height {
        let white: Vec<f64> =
            (0..width + smooth - 1).map(|_| StandardNormal.sample(&mut random)).collect();
        let norm = (smooth as f64).sqrt();
        noise.extend(white.windows(smooth).map(|window| window.iter().sum::<f64>() / norm));
    }
    noise
}

/// 60 x 50 points 0.1 mm apart about the origin, from a height over (x, y); noise of `sigma_m` along z, smoothed.
pub(super) fn surface(
    height_m: impl Fn(f64, f64) -> f64,
    sigma_m: f64,
    smooth: usize,
    seed: u64,
) -> Surface {
    let (width, height) = (60, 50);
    let noise = noise(width, height, smooth, seed);
    let points = (0..width * height).map(|at| {
        let x = (at % width) as f64 * 1e-4 - 2.95e-3;
        let y = (at / width) as f64 * 1e-4 - 2.45e-3;
        Point3::new(x, y, height_m(x, y) + sigma_m * noise[at])
    });
    Surface { width, points: points.collect() }
}

/// Returns the share of seeds for which `is_covered` returns true.
pub(super) fn share(num: u64, is_covered: impl Fn(u64) -> bool) -> f64 {
    (0..num).filter(|seed| is_covered(*seed)).count() as f64 / num as f64
}
