//! The estimators of single cross-sections against the Cramér–Rao bound, and the uncertainties that they state.

use laser_profiler::{
    evaluate::bound::{Samples, of_scene},
    scanner::{
        image::{Image, PixelFormat},
        params::{ExtractionParams, Method, NoiseSource, StripeDirection},
        stripe::Extractor,
    },
    simulate::stripe::{StripeScene, render_stripe},
};

/// Columns of a frame; four frames are more than 10⁴ points.
const COLUMNS: u32 = 2592;
const FRAMES: u64 = 4;

/// Smallest possible standard deviation of the centre of one column, pixels, for rounded and clipped samples.
fn bound_px(scene: &StripeScene) -> f64 {
    of_scene(scene, 0.0, Samples::Exact)
}

/// Passes every sub-pixel phase many times.
fn truth_px(column: u32) -> f64 {
    let column = f64::from(column);
    40.0 + 0.0137 * column + 4.0 * (column / 211.0).sin()
}

fn scene(amplitude: f64, sigma_px: f64, read_noise: f64) -> StripeScene {
    StripeScene {
        width: COLUMNS,
        height: 120,
        amplitude,
        sigma_px,
        read_noise,
        ..StripeScene::default()
    }
}

/// Names and scenes.
fn scenes() -> [(&'static str, StripeScene); 6] {
    [
        ("clean", scene(183.0, 2.3, 2.0)),
        ("thin", scene(183.0, 0.95, 2.0)),
        ("wide", scene(183.0, 4.2, 2.0)),
        ("noise 9", scene(123.0, 2.2, 9.0)),
        ("noise 30", scene(199.0, 2.2, 30.0)),
        ("saturated", scene(690.0, 2.9, 2.0)),
    ]
}

/// The defaults, and the scene's own noise.
fn params(method: Method, scene: &StripeScene) -> ExtractionParams {
    ExtractionParams {
        method,
        read_noise: scene.read_noise,
        shot_gain: scene.shot_gain,
        ..ExtractionParams::default()
    }
}

/// Errors of the points of a scene.
struct Found {
    rms_px: f64,
    bias_px: f64,
    /// Shares of the points within one and two stated standard deviations.
    within: [f64; 2],
}

/// Extracts four frames; fails when a column is missing.
fn extract(scene: &StripeScene, params: ExtractionParams) -> Found {
    let mut extractor = Extractor::new(params, scene.direction);
    let mut samples = Vec::new();
    let mut errors = Vec::new();
    for seed in 0..FRAMES {
        render_stripe(&StripeScene { seed, ..*scene }, truth_px, &mut samples);
        let image = Image::packed(scene.width, scene.height, PixelFormat::Mono8, &samples).unwrap();
        let centerline = extractor.extract(&image);
        let (along, across, lines) = match scene.direction {
            StripeDirection::Horizontal => (&centerline.u_px, &centerline.v_px, scene.width),
            StripeDirection::Vertical => (&centerline.v_px, &centerline.u_px, scene.height),
        };
        assert_eq!(along.len(), lines as usize, "columns are missing");
        let points = along.iter().zip(across).zip(&centerline.sigma_px);
        errors.extend(points.map(|((&line, &at), &sigma_px)| {
            assert!(sigma_px > 0.0, "sigma {sigma_px} in column {line}");
            (f64::from(at) - truth_px(line as u32), f64::from(sigma_px))
        }));
    }
    let mean =
        |of: &dyn Fn(&(f64, f64)) -> f64| errors.iter().map(of).sum::<f64>() / errors.len() as f64;
    let within = |sigmas: f64| {
        mean(&|&(error, sigma)| if error.abs() <= sigmas * sigma { 1.0 } else { 0.0 })
    };
    Found {
        rms_px: mean(&|(error, _)| error * error).sqrt(),
        bias_px: mean(&|(error, _)| *error),
        within: [within(1.0), within(2.0)],
    }
}

fn print(method: Method, name: &str, found: &Found, bound_px: f64) {
    let Found { rms_px, bias_px, within: [one, two] } = found;
    eprintln!(
        "{} {name}: RMS {rms_px:.4} px, {:.3} of the bound, bias {bias_px:+.4} px, within 1 sigma {:.1} %, 2 sigma {:.1} %",
        method.name(),
        rms_px / bound_px,
        100.0 * one,
        100.0 * two,
    );
}

#[test]
fn gaussian_ml_reaches_the_bound_and_its_sigma_is_true() {
    for ((name, scene), limit) in scenes().into_iter().zip([1.06, 1.06, 1.06, 1.08, 1.10, 1.10]) {
        let bound_px = bound_px(&scene);
        let found = extract(&scene, params(Method::GaussianMl, &scene));
        print(Method::GaussianMl, name, &found, bound_px);
        assert!(found.rms_px <= limit * bound_px, "{name}: {:.3}", found.rms_px / bound_px);
        assert!(found.rms_px >= 0.96 * bound_px, "{name}: below the bound");
        assert!((found.within[0] - 0.68).abs() <= 0.03, "{name}: {:?}", found.within);
        assert!((found.within[1] - 0.95).abs() <= 0.015, "{name}: {:?}", found.within);
    }
}

/// Light that brings its own noise, a background, saturation times ten, a stripe of 0.6 px.
#[test]
fn gaussian_ml_holds_beyond_the_usual_scenes() {
    let lit = StripeScene { shot_gain: 0.3, background: 20.0, ..scene(183.0, 2.3, 2.0) };
    let tenfold = StripeScene { background: 5.0, ..scene(2550.0, 2.3, 2.0) };
    let vertical = StripeScene {
        direction: StripeDirection::Vertical,
        width: 120,
        height: COLUMNS,
        ..scene(183.0, 2.3, 2.0)
    };
    for (name, scene) in [
        ("shot noise", lit),
        ("ten times full scale", tenfold),
        ("0.6 px", scene(183.0, 0.6, 2.0)),
        ("vertical", vertical),
    ] {
        let bound_px = bound_px(&scene);
        let found = extract(&scene, params(Method::GaussianMl, &scene));
        print(Method::GaussianMl, name, &found, bound_px);
        assert!(found.rms_px <= 1.06 * bound_px, "{name}: {:.3}", found.rms_px / bound_px);
        assert!((found.within[0] - 0.68).abs() <= 0.03, "{name}: {:?}", found.within);
        assert!((found.within[1] - 0.95).abs() <= 0.015, "{name}: {:?}", found.within);
    }
}

/// Limits in pixels: the figures of public implementations on such scenes, or better.
fn meets(method: Method, limits_px: [f64; 6], unbiased: &[&str]) {
    for ((name, scene), limit_px) in scenes().into_iter().zip(limits_px) {
        let found = extract(&scene, params(method, &scene));
        print(method, name, &found, bound_px(&scene));
        assert!(found.rms_px <= limit_px, "{name}: RMS {:.4} px", found.rms_px);
        if unbiased.contains(&name) {
            assert!((0.60..=0.76).contains(&found.within[0]), "{name}: {:?}", found.within);
        }
    }
}

#[test]
fn log_gaussian_meets_its_limits() {
    let all = ["clean", "thin", "wide", "noise 9", "noise 30", "saturated"];
    meets(Method::LogGaussian, [0.019, 0.013, 0.026, 0.125, 0.30, 0.0125], &all);
}

/// Few samples of a thin stripe are neither faint nor clipped: often no parabola goes through them, yet the centre is known.
#[test]
fn log_gaussian_states_its_scatter_where_it_has_few_samples() {
    for (name, scene) in [
        ("thin, at full scale", scene(300.0, 0.95, 2.0)),
        ("thin, clipped", scene(400.0, 0.95, 2.0)),
        ("thin, faint", scene(60.0, 0.7, 4.0)),
    ] {
        let faint = ExtractionParams {
            blur_radius: 1,
            segment_threshold: 12.0,
            ..params(Method::LogGaussian, &scene)
        };
        let found = extract(&scene, faint);
        print(Method::LogGaussian, name, &found, bound_px(&scene));
        assert!((0.62..=0.80).contains(&found.within[0]), "{name}: {:?}", found.within);
        assert!((0.91..=0.98).contains(&found.within[1]), "{name}: {:?}", found.within);
    }
}

/// With steep flanks or a flat top, the pixel grid shifts the zero crossing by some hundredths of a pixel.
#[test]
fn fir_peak_meets_its_limits() {
    let smooth = ["clean", "wide", "noise 9", "noise 30"];
    meets(Method::FirPeak, [0.019, 0.0145, 0.026, 0.125, 0.26, 0.018], &smooth);
}

/// Averages columns, so it may lie below the bound of one; its uncertainty is true where samples are many to a stripe's width.
#[test]
fn steger_meets_its_limits() {
    let smooth = ["wide", "noise 9", "noise 30"];
    meets(Method::Steger, [0.0136, 0.015, 0.015, 0.050, 0.110, 0.024], &smooth);
}

/// The estimated noise replaces the stated one; the coverage of `sigma` shows that it is the frame's.
#[test]
fn estimated_noise_makes_uncertainties_true() {
    let lit = StripeScene { shot_gain: 0.3, background: 20.0, ..scene(183.0, 2.3, 2.0) };
    let scenes = scenes().into_iter().chain([("shot noise", lit)]);
    for (name, scene) in scenes {
        let params = ExtractionParams {
            method: Method::GaussianMl,
            noise: NoiseSource::Estimated,
            read_noise: 50.0,
            shot_gain: 5.0,
            ..ExtractionParams::default()
        };
        let found = extract(&scene, params);
        let bound_px = bound_px(&scene);
        print(Method::GaussianMl, name, &found, bound_px);
        assert!(found.rms_px <= 1.10 * bound_px, "{name}: {:.3}", found.rms_px / bound_px);
        assert!((found.within[0] - 0.68).abs() <= 0.04, "{name}: {:?}", found.within);
        assert!((found.within[1] - 0.95).abs() <= 0.02, "{name}: {:?}", found.within);
    }
}
