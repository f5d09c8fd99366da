//! Centrelines of rendered stripes against the centres they were rendered with.

use laser_profiler::{
    scanner::{
        channel::{AnyPlane, Plane},
        params::{ExtractionParams, Method, PeakSelection, StripeDirection, Window},
        stripe::{Centerline, Extractor, flag},
    },
    simulate::stripe::{StripeScene, render_stripe},
};

const PAPER: ExtractionParams = ExtractionParams {
    method: Method::ImprovedGravity,
    window: Window::Fractional,
    blur_radius: 3,
    segment_threshold: 35.0,
    min_segment_area: 500,
    width_threshold: 50.0,
    peak_selection: PeakSelection::Brightest,
    read_noise: 2.0,
    shot_gain: 0.0,
};

/// 2592 columns over which the stripe passes every sub-pixel phase many times.
const SCENE: fn(f64, f64, f64) -> StripeScene = |amplitude, sigma_px, read_noise| StripeScene {
    width: 2592,
    height: 256,
    direction: StripeDirection::Horizontal,
    amplitude,
    sigma_px,
    read_noise,
    seed: 20_231_709,
    ..StripeScene::default()
};

fn truth_px(column: u32) -> f64 {
    let column = f64::from(column);
    110.0 + 0.0137 * column + 4.0 * (column / 211.0).sin()
}

fn extract(scene: &StripeScene, params: ExtractionParams) -> Centerline {
    let mut samples = Vec::new();
    render_stripe(scene, truth_px, &mut samples);
    let (width, height) = (scene.width as usize, scene.height as usize);
    let plane = AnyPlane::Eight(Plane { width, height, stride: width, samples: &samples });
    let mut centerline = Centerline::default();
    Extractor::new(params, scene.direction).extract(&plane, (0, 0), 255, &mut centerline);
    centerline
}

/// Errors of every point, pixels; fails when a column is missing.
fn errors_px(scene: &StripeScene, params: ExtractionParams) -> Vec<f64> {
    let centerline = extract(scene, params);
    assert_eq!(centerline.len(), scene.width as usize, "columns are missing");
    centerline
        .u_px
        .iter()
        .zip(&centerline.v_px)
        .map(|(&u, &v)| f64::from(v) - truth_px(u as u32))
        .collect()
}

fn rms(errors: &[f64]) -> f64 {
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

#[test]
fn improved_gravity_meets_its_limits() {
    for (name, amplitude, sigma_px, read_noise, limit_px) in [
        ("ordinary", 183.0, 2.3, 2.0, 0.017),
        ("thin", 183.0, 0.95, 2.0, 0.016),
        ("saturated", 690.0, 2.9, 2.0, 0.015),
        ("noisy", 123.0, 2.2, 9.0, 0.090),
        ("very noisy", 199.0, 2.2, 30.0, 0.19),
    ] {
        let rms_px = rms(&errors_px(&SCENE(amplitude, sigma_px, read_noise), PAPER));
        eprintln!(
            "{name}: A {amplitude} s {sigma_px} noise {read_noise}: RMS {rms_px:.4} px, limit {limit_px}"
        );
        assert!(rms_px <= limit_px, "{name}: RMS {rms_px:.4} px, limit {limit_px}");
    }
}
