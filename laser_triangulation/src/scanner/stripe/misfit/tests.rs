//! Rendered scenes of one line and its company. Ground truth is the formula of the line.

use super::super::{Centerline, Extractor, flag};
use crate::{
    scanner::{
        image::{Image, PixelFormat},
        params::{ExtractionParams, Method, StripeDirection},
    },
    simulate::speckle::Speckle,
};
use rand::SeedableRng as _;
use rand_distr::Distribution as _;

const WIDTH: usize = 320;
const HEIGHT: usize = 160;
const METHODS: [Method; 4] =
    [Method::ImprovedGravity, Method::GaussianFit, Method::GaussianMl, Method::Steger];

fn truth_px(u: f64) -> f64 {
    70.0 + 10.0 * (u / 60.0).sin()
}

fn gaussian(distance_px: f64, sigma_px: f64) -> f64 {
    (-0.5 * (distance_px / sigma_px).powi(2)).exp()
}

/// Renders the light at each distance from the line under speckle, plus read noise of 2 grey levels, clipped to 8 bits.
fn render(light: impl Fn(f64) -> f64, contrast: f64) -> Vec<u8> {
    let mut rng = rand_chacha::ChaCha8Rng::from_seed([11; 32]);
    let speckle = Speckle { contrast, grain_px: 1.0 }.pattern(&mut rng, (WIDTH, HEIGHT));
    let noise = rand_distr::Normal::new(2.0, 2.0).unwrap();
    let pixel = |i: usize| light((i / WIDTH) as f64 - truth_px((i % WIDTH) as f64));
    let samples =
        (0..WIDTH * HEIGHT).map(|i| pixel(i) * f64::from(speckle[i]) + noise.sample(&mut rng));
    samples.map(|sample| sample.round().clamp(0.0, 255.0) as u8).collect()
}

fn extract(light: impl Fn(f64) -> f64, params: ExtractionParams) -> Centerline {
    extract_under_speckle(light, 0.0, params)
}

fn extract_under_speckle(
    light: impl Fn(f64) -> f64,
    contrast: f64,
    params: ExtractionParams,
) -> Centerline {
    let picture = render(light, contrast);
    let image = Image::packed(WIDTH as u32, HEIGHT as u32, PixelFormat::Mono8, &picture).unwrap();
    Extractor::new(params, StripeDirection::Horizontal).extract(&image).clone()
}

fn with(method: Method) -> ExtractionParams {
    ExtractionParams { method, ..ExtractionParams::default() }
}

fn errors_px(line: &Centerline) -> Vec<f64> {
    let points = line.u_px.iter().zip(&line.v_px);
    points.map(|(&u, &v)| f64::from(v) - truth_px(u.into())).collect()
}

fn share_flagged(line: &Centerline, flag: u8) -> f64 {
    let num = line.flags.iter().filter(|&&flags| flags & flag != 0).count();
    num as f64 / line.len() as f64
}

#[test]
fn a_line_alone_fits_whatever_its_width_and_brightness() {
    for method in METHODS {
        for (level, sigma_px) in
            [(150.0, 2.2), (60.0, 2.2), (240.0, 0.9), (200.0, 5.0), (400.0, 2.2), (2000.0, 3.0)]
        {
            let line = extract(|d| level * gaussian(d, sigma_px), with(method));
            assert_eq!(line.len(), WIDTH);
            let share = share_flagged(&line, flag::MISFIT | flag::MULTIPLE_PEAKS);
            assert!(share <= 0.01, "{method:?} {level} {sigma_px}: {share}");
        }
    }
}

#[test]
fn a_glow_beside_the_line_is_flagged_and_hardly_moves_it() {
    for method in METHODS {
        for (share, distance_px, glow_px) in
            [(0.33, 20.0, 17.0), (0.4, 8.0, 20.0), (0.6, -15.0, 14.0), (0.8, -6.0, 17.0)]
        {
            let light =
                |d| 150.0 * gaussian(d, 2.2) + share * 150.0 * gaussian(d - distance_px, glow_px);
            let line = extract(light, with(method));
            let flagged = share_flagged(&line, flag::MISFIT | flag::MULTIPLE_PEAKS);
            assert!(flagged > 0.99, "{method:?} {share} at {distance_px}: {flagged}");
            for (error, sigma) in errors_px(&line).into_iter().zip(&line.sigma_px) {
                let is_near = error.abs() < 0.6 && error.abs() < 3.0 * f64::from(*sigma) + 0.3;
                assert!(is_near, "{method:?} {share} at {distance_px}: {error} ± {sigma}");
            }
        }
    }
}

#[test]
fn a_one_sided_halo_widens_sigma() {
    for method in METHODS {
        for (level, share) in [(150.0, 0.6), (600.0, 0.3), (1500.0, 0.6)] {
            let light = |d: f64| {
                let halo = if d > 0.0 { share * (-d / 6.0).exp() } else { 0.0 };
                level * (gaussian(d, 2.2) + halo)
            };
            let line = extract(light, with(method));
            assert!(share_flagged(&line, flag::MISFIT) > 0.9, "{method:?} {level} {share}");
            let held = errors_px(&line).into_iter().zip(&line.sigma_px);
            let held = held.filter(|(error, sigma)| error.abs() < 3.0 * f64::from(**sigma));
            assert!(held.count() as f64 > 0.9 * WIDTH as f64, "{method:?} {level} {share}");
        }
    }
}

#[test]
fn two_lines_that_touch_are_two_stripes_or_one_in_doubt() {
    for method in METHODS {
        for (share, distance_px) in [(1.0, 12.0), (0.7, 10.0), (0.5, -12.0)] {
            let light =
                |d| 150.0 * (gaussian(d, 2.5) + share * gaussian(d - distance_px, 2.5)) + 20.0;
            let two = extract(light, ExtractionParams { max_stripes: 2, ..with(method) });
            assert_eq!(two.len(), 2 * WIDTH, "{method:?} {share} at {distance_px}");
            for error in errors_px(&two) {
                let nearest = error.abs().min((error - distance_px).abs());
                assert!(nearest < 0.6, "{method:?} {share} at {distance_px}: {error}");
            }
            let one = extract(light, with(method));
            assert!(share_flagged(&one, flag::MULTIPLE_PEAKS) >= 1.0);
            // Equal lines are not mixed.
            assert_eq!(one.stripe_start, [0], "{method:?} {share} at {distance_px}");
        }
    }
}

#[test]
fn two_lines_without_a_valley_do_not_fit() {
    for method in METHODS {
        for (share, distance_px) in [(1.0, 4.2), (1.0, 5.0), (0.6, 5.0), (0.6, -4.0)] {
            let light = |d| 150.0 * (gaussian(d, 2.2) + share * gaussian(d - distance_px, 2.2));
            let line = extract(light, with(method));
            let doubt = share_flagged(&line, flag::MISFIT | flag::MULTIPLE_PEAKS);
            assert!(doubt > 0.95, "{method:?} {share} at {distance_px}: {doubt}");
        }
    }
}

/// Speckle hides the shape of one cross-section, not the mean of many.
#[test]
fn two_lines_without_a_valley_do_not_fit_in_speckle_either() {
    for method in METHODS {
        for (share, distance_px) in [(1.0, 5.0), (0.8, -5.0), (0.6, 4.5)] {
            let light = |d: f64| 80.0 * (gaussian(d, 2.2) + share * gaussian(d - distance_px, 2.2));
            let line = extract_under_speckle(light, 0.2, with(method));
            let doubt = share_flagged(&line, flag::MISFIT | flag::MULTIPLE_PEAKS);
            assert!(doubt > 0.95, "{method:?} {share} at {distance_px}: {doubt}");
        }
        let line = extract_under_speckle(|d| 80.0 * gaussian(d, 2.2), 0.2, with(method));
        let doubt = share_flagged(&line, flag::MISFIT);
        assert!(doubt < 0.05, "{method:?} alone: {doubt}");
    }
}

/// A good line beside a merged pair, both shorter than a pool: each is judged by its own shapes.
#[test]
fn a_second_stripe_does_not_put_the_first_in_doubt() {
    for method in METHODS {
        let light = |d: f64| {
            let pair = gaussian(d - 40.0, 2.2) + 0.6 * gaussian(d - 43.3, 2.2);
            150.0 * gaussian(d, 2.2) + 100.0 * pair
        };
        let params = ExtractionParams { max_stripes: 2, min_segment_area: 100, ..with(method) };
        let picture = render(light, 0.0);
        let columns = 60;
        let narrow: Vec<u8> =
            picture.chunks_exact(WIDTH).flat_map(|row| &row[..columns]).copied().collect();
        let image =
            Image::packed(columns as u32, HEIGHT as u32, PixelFormat::Mono8, &narrow).unwrap();
        let mut extractor = Extractor::new(params, StripeDirection::Horizontal);
        let line = extractor.extract(&image);
        assert_eq!(line.len(), 2 * columns, "{method:?}");
        let doubted = |points: &[u8]| points.iter().filter(|f| **f & flag::MISFIT != 0).count();
        let (first, second) = line.flags.split_at(columns);
        assert!(doubted(first) <= 3, "{method:?}: {}", doubted(first));
        assert!(doubted(second) >= columns - 3, "{method:?}: {}", doubted(second));
    }
}
