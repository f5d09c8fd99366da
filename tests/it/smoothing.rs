//! Smoothing along the stripe on rendered stripes whose centre is known: noise, its stated uncertainty, steps.

use laser_profiler::{
    scanner::{
        image::{Image, PixelFormat},
        params::{ExtractionParams, Method, StripeDirection},
        stripe::{Centerline, Extractor, SigmaParts},
    },
    simulate::stripe::{StripeScene, render_stripe},
};

const WIDTH: u32 = 2592;

/// A noisy stripe as wide as the paper's.
fn scene() -> StripeScene {
    StripeScene {
        width: WIDTH,
        height: 160,
        amplitude: 183.0,
        sigma_px: 2.2,
        read_noise: 6.0,
        seed: 61,
        ..StripeScene::default()
    }
}

fn extract(truth_px: impl Fn(u32) -> f64, params: ExtractionParams) -> Centerline {
    extract_with_parts(truth_px, params).0
}

fn extract_with_parts(
    truth_px: impl Fn(u32) -> f64,
    params: ExtractionParams,
) -> (Centerline, SigmaParts) {
    let scene = scene();
    let mut samples = Vec::new();
    render_stripe(&scene, truth_px, &mut samples);
    let image = Image::packed(scene.width, scene.height, PixelFormat::Mono8, &samples).unwrap();
    let mut extractor = Extractor::new(params, StripeDirection::Horizontal);
    let centerline = extractor.extract(&image).clone();
    assert_eq!(centerline.len(), scene.width as usize, "columns are missing");
    (centerline, extractor.sigma_parts().unwrap())
}

fn params(method: Method, blur_radius: u32, smoothing_columns: u32) -> ExtractionParams {
    ExtractionParams {
        method,
        blur_radius,
        smoothing_columns,
        read_noise: 6.0,
        ..ExtractionParams::default()
    }
}

fn wave_px(column: u32) -> f64 {
    let column = f64::from(column);
    70.0 + 0.0137 * column + 4.0 * (column / 211.0).sin()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, num) = values.fold((0.0, 0), |(sum, num), value| (sum + value * value, num + 1));
    (sum / f64::from(num)).sqrt()
}

/// RMS of the error, pixels, and of the error as a share of its σ.
fn error(method: Method, blur_radius: u32, smoothing_columns: u32) -> [f64; 2] {
    let line = extract(wave_px, params(method, blur_radius, smoothing_columns));
    let errors = || line.v_px.iter().zip(0..).map(|(&v, column)| f64::from(v) - wave_px(column));
    let bias = errors().sum::<f64>() / f64::from(WIDTH);
    let shares = errors().zip(&line.sigma_px).map(|(e, &s)| (e - bias) / f64::from(s));
    [rms(errors()), rms(shares)]
}

#[test]
fn noise_falls_and_sigma_stays_true() {
    for (method, blur_radius, falls) in [
        (Method::GaussianFit, 0, true),
        (Method::GaussianFit, 3, false),
        (Method::ImprovedGravity, 3, false),
    ] {
        let name = method.name();
        let [alone_px, _] = error(method, blur_radius, 1);
        for num in [5, 9, 21] {
            let [rms_px, share] = error(method, blur_radius, num);
            let gain = alone_px / rms_px;
            eprintln!(
                "{name}, blur {blur_radius}, {num} points: RMS {alone_px:.4} to {rms_px:.4} px, {gain:.2} of {:.2}; \
                 error / sigma {share:.3}",
                f64::from(num).sqrt()
            );
            // Columns that the blur has already averaged gain little from more averaging.
            let expected = if falls { 0.85 * f64::from(num).sqrt() } else { 1.02 };
            assert!(gain > expected, "{name} {num}: {gain}");
            assert!((0.75..1.3).contains(&share), "{name} {num}: {share}");
        }
    }
}

#[test]
fn a_step_of_seven_pixels_moves_no_column() {
    let step_px = |column| if column < 1300 { 70.3 } else { 77.3 };
    for num in [1, 5, 9, 21] {
        let line = extract(step_px, params(Method::GaussianFit, 0, num));
        let off = |point: &(&f32, u32)| (f64::from(*point.0) - step_px(point.1)).abs() > 0.5;
        let num_off = line.v_px.iter().zip(0..).filter(off).count();
        eprintln!("{num} points: {num_off} columns more than 0.5 px off a step of 7 px");
        assert!(num_off <= 1, "{num} points: {num_off} columns");
    }
}

/// Twelve uniform numbers from a linear congruential generator (Knuth's) add up to a normal one of variance 1.
fn normal(column: u32) -> f64 {
    let mut state = u64::from(column) + 1;
    let mut uniform = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from((state >> 32) as u32) / f64::from(u32::MAX)
    };
    (0..12).map(|_| uniform()).sum::<f64>() - 6.0
}

/// Smoothing reduces sigma, but not its shares.
#[test]
fn the_shares_of_sigma_are_those_before_smoothing() {
    const TEXTURE_PX: f32 = 0.2;
    let rough = |column: u32| wave_px(column) + f64::from(TEXTURE_PX) * normal(column);
    for truth_px in [&wave_px as &dyn Fn(u32) -> f64, &rough] {
        let of = |columns| extract_with_parts(truth_px, params(Method::GaussianMl, 3, columns));
        let ((plain, parts), (smooth, parts_of_smooth)) = (of(1), of(9));
        assert_eq!(parts, parts_of_smooth);
        let median = |line: &Centerline| {
            let mut sigmas_px = line.sigma_px.clone();
            sigmas_px.sort_by(f32::total_cmp);
            sigmas_px[sigmas_px.len() / 2]
        };
        let whole_px = parts.noise_px.hypot(parts.texture_px);
        assert!((whole_px / median(&plain) - 1.0).abs() < 0.01, "{parts:?} {}", median(&plain));
        assert!(median(&smooth) < 0.7 * whole_px, "{}", median(&smooth));
    }
    let parts = |truth_px| extract_with_parts(truth_px, params(Method::GaussianMl, 3, 1)).1;
    let (smooth, rough) = (parts(&wave_px as &dyn Fn(u32) -> f64), parts(&rough));
    assert!((rough.noise_px / smooth.noise_px - 1.0).abs() < 0.1, "{smooth:?} {rough:?}");
    assert!((rough.texture_px / TEXTURE_PX - 1.0).abs() < 0.15, "{rough:?}");
    assert!(smooth.texture_px < 0.3 * smooth.noise_px, "{smooth:?}");
    let black = Image::packed(8, 8, PixelFormat::Mono8, &[0; 64]).unwrap();
    let mut extractor = Extractor::default();
    extractor.extract(&black);
    assert_eq!(extractor.sigma_parts(), None);
}
