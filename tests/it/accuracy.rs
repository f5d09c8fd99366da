//! Centrelines of rendered stripes against the centres they were rendered with.

use laser_profiler::{
    ros::{node_params::NodeParams, parameters::Parameters},
    scanner::{
        calibration::Calibration,
        channel::{Offset, Plane},
        frame_index::FrameIndex,
        image::{Frame, Image, PixelFormat},
        params::{
            ExtractionParams, GravityWindow, Method, Params, PeakSelection, RegionOfInterest,
            StripeDirection,
        },
        pipeline::Pipeline,
        stripe::{Centerline, Extractor, flag},
    },
    simulate::stripe::{StripeScene, render_stripe},
};

/// The defaults, which are the paper's values with the fractional window.
fn paper() -> ExtractionParams {
    NodeParams::new(&Parameters::default()).unwrap().cameras[0].scanner.extraction
}

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
    extract_stripe(scene, truth_px, params)
}

/// The centreline of a stripe about `center(column)`.
fn extract_stripe(
    scene: &StripeScene,
    center: impl Fn(u32) -> f64,
    params: ExtractionParams,
) -> Centerline {
    let mut samples = Vec::new();
    render_stripe(scene, center, &mut samples);
    extract_samples(scene, &samples, params)
}

/// The centreline of 8-bit samples as large as that scene.
fn extract_samples(scene: &StripeScene, samples: &[u8], params: ExtractionParams) -> Centerline {
    let image = Image::packed(scene.width, scene.height, PixelFormat::Mono8, samples).unwrap();
    Extractor::new(params, scene.direction).extract(&image).clone()
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
        let rms_px = rms(&errors_px(&SCENE(amplitude, sigma_px, read_noise), paper()));
        eprintln!(
            "{name}: A {amplitude} s {sigma_px} noise {read_noise}: RMS {rms_px:.4} px, limit {limit_px}"
        );
        assert!(rms_px <= limit_px, "{name}: RMS {rms_px:.4} px, limit {limit_px}");
    }
}

/// Error of a noise-free stripe with the same sub-pixel phase in every column, for 50 phases.
fn error_by_phase_px(params: ExtractionParams) -> Vec<f64> {
    let scene = StripeScene {
        width: 128,
        height: 64,
        amplitude: 183.0,
        sigma_px: 2.3,
        ..StripeScene::default()
    };
    let errors = (0..50).map(|step| {
        let truth = 30.0 + f64::from(step) / 50.0;
        let centerline = extract_stripe(&scene, |_| truth, params);
        assert_eq!(centerline.len(), 128);
        f64::from(centerline.v_px[64]) - truth
    });
    errors.collect()
}

fn half_amplitude(errors: &[f64]) -> f64 {
    let (low, high) =
        errors.iter().fold((f64::MAX, f64::MIN), |(low, high), &e| (low.min(e), high.max(e)));
    (high - low) / 2.0
}

/// The window as printed in the paper pulls the result to whole pixels; the fractional one, the default, does not.
#[test]
fn rounded_window_locks_to_pixels() {
    let rounded = half_amplitude(&error_by_phase_px(ExtractionParams {
        window: GravityWindow::Rounded,
        ..paper()
    }));
    let fractional = half_amplitude(&error_by_phase_px(paper()));
    eprintln!(
        "half amplitude over the phase: rounded {rounded:.4} px, fractional {fractional:.4} px"
    );
    assert!((0.05..0.15).contains(&rounded), "rounded: {rounded:.4} px");
    assert!(fractional < 0.012, "fractional: {fractional:.4} px");
}

#[test]
fn the_compared_methods_find_every_column_too() {
    for (method, limit_px) in [(Method::GrayGravity, 0.08), (Method::GaussianFit, 0.03)] {
        let errors = errors_px(&SCENE(183.0, 2.3, 2.0), ExtractionParams { method, ..paper() });
        let rms_px = rms(&errors);
        eprintln!("{}: RMS {rms_px:.4} px", method.name());
        assert!(rms_px <= limit_px, "{}: RMS {rms_px:.4} px", method.name());
    }
}

/// `sigma` is the error that the stated noise makes: their ratio is near one for every method, thin stripes and wide.
#[test]
fn sigma_is_true() {
    for (method, sigma_px) in [
        (Method::ImprovedGravity, 1.2),
        (Method::ImprovedGravity, 2.2),
        (Method::ImprovedGravity, 4.0),
        (Method::GaussianFit, 2.2),
    ] {
        let scene = SCENE(183.0, sigma_px, 6.0);
        let params = ExtractionParams { method, read_noise: 6.0, ..paper() };
        let centerline = extract(&scene, params);
        let errors = errors_px(&scene, params);
        let bias = errors.iter().sum::<f64>() / errors.len() as f64;
        let ratios: Vec<f64> = errors
            .iter()
            .zip(&centerline.sigma_px)
            .map(|(e, &s)| (e - bias) / f64::from(s))
            .collect();
        let ratio = rms(&ratios);
        eprintln!("{} s {sigma_px}: RMS of error / sigma {ratio:.3}", method.name());
        assert!(
            (0.8..1.25).contains(&ratio),
            "{} s {sigma_px}: RMS of error / sigma {ratio:.3}",
            method.name()
        );
    }
}

#[test]
fn a_vertical_stripe_is_as_good_as_a_horizontal_one() {
    let scene = StripeScene {
        width: 256,
        height: 2592,
        direction: StripeDirection::Vertical,
        ..SCENE(183.0, 2.3, 2.0)
    };
    let centerline = extract(&scene, paper());
    assert_eq!(centerline.len(), 2592);
    let errors: Vec<f64> = centerline
        .v_px
        .iter()
        .zip(&centerline.u_px)
        .map(|(&v, &u)| f64::from(u) - truth_px(v as u32))
        .collect();
    assert!(rms(&errors) <= 0.017, "RMS {:.4} px", rms(&errors));
}

#[test]
fn deep_images_measure_the_same_thresholds() {
    use laser_profiler::simulate::sensor::BitDepth;
    let scene = StripeScene {
        width: 640,
        height: 256,
        bit_depth: BitDepth::Twelve,
        amplitude: 183.0 * 4095.0 / 255.0,
        read_noise: 2.0 * 4095.0 / 255.0,
        ..StripeScene::default()
    };
    let mut bytes = Vec::new();
    render_stripe(&scene, truth_px, &mut bytes);
    let samples: Vec<u16> =
        bytes.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
    let plane = Plane::new(640, 256, 640, &samples).unwrap().into();
    let mut centerline = Centerline::default();
    Extractor::new(paper(), StripeDirection::Horizontal).extract_plane(
        &plane,
        Offset::default(),
        4095,
        &mut centerline,
    );
    let errors: Vec<f64> = centerline
        .u_px
        .iter()
        .zip(&centerline.v_px)
        .map(|(&u, &v)| f64::from(v) - truth_px(u as u32))
        .collect();
    assert_eq!(errors.len(), 640);
    assert!(rms(&errors) <= 0.017, "RMS {:.4} px", rms(&errors));
    assert!(
        centerline.intensity.iter().all(|&level| (2500.0..3400.0).contains(&level)),
        "intensity in sample units"
    );
}

#[test]
fn width_saturation_and_borders_are_reported() {
    // Full width at half maximum of a Gaussian: 2.3548 s.
    for (sigma_px, tolerance) in [(1.2_f64, 0.12), (2.3, 0.03), (4.0, 0.03)] {
        let centerline = extract(&SCENE(183.0, sigma_px, 0.0), paper());
        let mean = centerline.width_px.iter().map(|&w| f64::from(w)).sum::<f64>() / 2592.0;
        assert!(
            (mean / (2.3548 * sigma_px) - 1.0).abs() < tolerance,
            "s {sigma_px}: width {mean:.3} px"
        );
        assert!(centerline.flags.iter().all(|&flags| flags == 0));
    }
    let saturated = extract(&SCENE(690.0, 2.9, 0.0), paper());
    assert!(saturated.flags.iter().all(|&flags| flags == flag::SATURATED));
    assert_eq!(saturated.stripe_start, [0], "one connected stripe");

    let scene = StripeScene { width: 128, height: 64, ..StripeScene::default() };
    let centerline = extract_stripe(&scene, |_| 1.0, paper());
    assert!(centerline.flags.iter().all(|&flags| flags == flag::CLIPPED));
    assert!(centerline.width_px.iter().all(|width| width.is_nan()), "the border hides an edge");
}

#[test]
fn of_two_stripes_the_selected_one_is_found_and_the_other_flagged() {
    let scene = StripeScene { width: 256, height: 128, ..StripeScene::default() };
    let (mut one, mut two) = (Vec::new(), Vec::new());
    render_stripe(&StripeScene { amplitude: 120.0, sigma_px: 3.5, ..scene }, |_| 30.2, &mut one);
    render_stripe(&StripeScene { amplitude: 200.0, sigma_px: 1.5, ..scene }, |_| 90.7, &mut two);
    let samples: Vec<u8> = one.iter().zip(&two).map(|(&a, &b)| a.max(b)).collect();
    for (peak_selection, expected_px) in [
        (PeakSelection::Brightest, 90.7),
        (PeakSelection::First, 30.2),
        (PeakSelection::Last, 90.7),
        (PeakSelection::Widest, 30.2),
    ] {
        let params = ExtractionParams { peak_selection, ..paper() };
        let centerline = extract_samples(&scene, &samples, params);
        assert_eq!(centerline.len(), 256);
        assert!(
            centerline.v_px.iter().all(|&v| (f64::from(v) - expected_px).abs() < 0.02),
            "{peak_selection:?}"
        );
        assert!(centerline.flags.iter().all(|&flags| flags == flag::MULTIPLE_PEAKS));
    }
}

#[test]
fn a_gap_starts_another_stripe() {
    let scene = StripeScene { width: 400, height: 64, ..StripeScene::default() };
    let center = |column| if (180..220).contains(&column) { f64::NAN } else { 30.0 };
    let centerline = extract_stripe(&scene, center, paper());
    // The blur carries the stripe up to its radius into the gap.
    let second = centerline.stripe_start[1] as usize;
    assert_eq!(centerline.stripe_start.len(), 2);
    assert!(
        (centerline.u_px[second - 1] - 179.0).abs() <= 3.0
            && (centerline.u_px[second] - 220.0).abs() <= 3.0
    );
}

/// A region of interest changes which columns are searched, not where the stripe is; the profile has one entry for each.
#[test]
fn a_region_of_interest_keeps_the_images_pixels() {
    let scanner = NodeParams::new(&Parameters::default()).unwrap().cameras[0].scanner;
    let roi = RegionOfInterest { x_offset: 70, y_offset: 20, width: Some(66), height: Some(65) };
    let calibration = Calibration::from_yaml(
        "{type: vertical_incidence, frame_id: laser_plane, image_distance_m: 0.026, object_distance_m: 0.3,
        beta_rad: 0.5, pixel_pitch_m: 4.8e-6, base_row_px: 60.0, center_column_px: 60.0, height_sign: -1}",
    )
    .unwrap();
    for stripe_direction in [StripeDirection::Horizontal, StripeDirection::Vertical] {
        let (center_px, first, count) = match stripe_direction {
            StripeDirection::Horizontal => (50.3, 70, 66),
            StripeDirection::Vertical => (100.3, 20, 65),
        };
        let scene = StripeScene {
            width: 200,
            height: 120,
            direction: stripe_direction,
            ..StripeScene::default()
        };
        let mut samples = Vec::new();
        render_stripe(&scene, |_| center_px, &mut samples);
        let image = Image::new(200, 120, 200, PixelFormat::Mono8, &samples).unwrap();
        let params = Params { stripe_direction, roi, ..scanner };
        let mut pipeline = Pipeline::new(params, Some(calibration.clone()));
        let frame = Frame { stamp_ns: 1, image };
        let output = pipeline.process(&frame, FrameIndex::default(), |_| ()).unwrap();
        let line = output.centerline;
        let (along, across) = match stripe_direction {
            StripeDirection::Horizontal => (&line.u_px, &line.v_px),
            StripeDirection::Vertical => (&line.v_px, &line.u_px),
        };
        let searched: Vec<f32> = (first..first + count).map(|at: u16| f32::from(at)).collect();
        assert_eq!(along, &searched, "{stripe_direction:?}");
        assert!(across.iter().all(|&at| (f64::from(at) - center_px).abs() < 0.02));
        let profile = output.profile.unwrap();
        assert_eq!((profile.x_m.len(), profile.valid_count), (count.into(), count.into()));
        // Formula 6 at the stripe, and x growing with the image's column (row) from the axis at 60.
        let s_m = (60.0 - center_px) * 4.8e-6;
        let (sin, cos) = 0.5_f64.sin_cos();
        let z_m = s_m * 0.3 / (0.026 * sin + s_m * cos);
        assert!(profile.z_m.iter().all(|&z| (f64::from(z) - z_m).abs() < 3e-6));
        let x_m = (f64::from(first) - 60.0) * 4.8e-6 * (0.3 - z_m * cos) / 0.026;
        assert!((f64::from(profile.x_m[0]) - x_m).abs() < 1e-8, "{} {x_m}", profile.x_m[0]);
    }
}
