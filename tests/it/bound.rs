//! The Cramér–Rao bound of rendered stripes, by numbers alone: nothing of the code under test is in it.

use laser_profiler::simulate::stripe::StripeScene;
use nalgebra::{Matrix4, Vector4};

/// Smallest standard deviation of the centre of one cross-section with A, c, s and B unknown, pixels: root of the mean
/// square over sub-pixel phases. Samples are rounded and clipped to 8 bits, and say no more than that.
pub(crate) fn bound_px(scene: &StripeScene) -> f64 {
    const PHASES: u32 = 8;
    let variances = (0..PHASES).map(|phase| {
        let unknown = [scene.amplitude, f64::from(phase) / f64::from(PHASES), scene.sigma_px];
        variance_px2(scene, unknown)
    });
    (variances.sum::<f64>() / f64::from(PHASES)).sqrt()
}

fn variance_px2(scene: &StripeScene, [a, c, s]: [f64; 3]) -> f64 {
    const H: f64 = 1e-5;
    let reach = (8.0 * s + 4.0) as i32;
    let mut fisher = Matrix4::zeros();
    for pixel in -reach..=reach {
        let level = |a: f64, c: f64, s: f64| {
            let edge = |at: f64| share_below((f64::from(pixel) + at - c) / s);
            a * s * std::f64::consts::TAU.sqrt() * (edge(0.5) - edge(-0.5)) + scene.background
        };
        let gradient = Vector4::new(
            level(a + H, c, s) - level(a - H, c, s),
            level(a, c + H, s) - level(a, c - H, s),
            level(a, c, s + H) - level(a, c, s - H),
            2.0 * H,
        ) / (2.0 * H);
        fisher += information(scene, level(a, c, s)) * gradient * gradient.transpose();
    }
    fisher.try_inverse().unwrap()[(1, 1)]
}

/// Σ (dP/dμ)² / P over the 256 values that a sample may have.
fn information(scene: &StripeScene, level: f64) -> f64 {
    const H: f64 = 1e-4;
    let probability = |value: i32, level: f64| {
        let sigma = (scene.read_noise.powi(2) + scene.shot_gain * level.max(0.0)).sqrt();
        let below = |edge: f64| share_below((f64::from(value) + edge - level) / sigma);
        let to = if value == 255 { 1.0 } else { below(0.5) };
        let from = if value == 0 { 0.0 } else { below(-0.5) };
        to - from
    };
    let of_value = |value: i32| {
        let p = probability(value, level);
        let slope = (probability(value, level + H) - probability(value, level - H)) / (2.0 * H);
        if p > 1e-12 { slope * slope / p } else { 0.0 }
    };
    (0..=255).map(of_value).sum()
}

fn share_below(x: f64) -> f64 {
    0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2)
}
