//! Small pictures whose centrelines are computed by hand. The blur is off: blurred and raw samples are equal.

use super::{Centerline, fast::FastExtractor, flag, reference};
use crate::scanner::{
    channel::{Offset, Plane},
    params::{Background, ExtractionParams, GravityWindow, Method, PeakSelection, StripeDirection},
};

fn plain() -> ExtractionParams {
    ExtractionParams {
        method: Method::GrayGravity,
        blur_radius: 0,
        segment_threshold: 1.0,
        min_segment_area: 0,
        width_threshold: 10.0,
        shot_gain: 0.0,
        ..ExtractionParams::default()
    }
}

/// Runs both extractors on rows of `width` samples, for a horizontal stripe.
fn extract(width: usize, picture: &[u8], params: ExtractionParams) -> Centerline {
    let plane = Plane { width, height: picture.len() / width, stride: width, samples: picture };
    let mut line = Centerline::default();
    FastExtractor::new(params, StripeDirection::Horizontal).extract(
        &plane,
        Offset::default(),
        255,
        &mut line,
    );
    let expected =
        reference::extract(&plane, Offset::default(), &params, StripeDirection::Horizontal, 255);
    assert_eq!(format!("{line:?}"), format!("{expected:?}"));
    line
}

/// Returns the centre in a picture of one column.
fn centre_px(column: &[u8], params: ExtractionParams) -> f32 {
    let line = extract(1, column, params);
    assert_eq!(line.len(), 1);
    assert!(line.sigma_px[0] > 0.0 && line.sigma_px[0].is_finite(), "{}", line.sigma_px[0]);
    line.v_px[0]
}

fn assert_close(actual: f32, expected: f64) {
    assert!((f64::from(actual) - expected).abs() < 1e-6, "{actual}, not {expected}");
}

#[test]
fn gray_gravity_is_the_centroid_of_what_exceeds_the_threshold() {
    // (1·10 + 2·30 + 3·20) / 60
    assert_close(centre_px(&[0, 10, 30, 20, 1, 0], plain()), 130.0 / 60.0);
    // (1·10 + 2·30 + 3·20 + 4·2) / 62: now the 2 exceeds it.
    assert_close(centre_px(&[0, 10, 30, 20, 2, 0], plain()), 138.0 / 62.0);
}

#[test]
fn gaussian_fit_finds_the_maximum_of_a_gaussian() {
    let params = ExtractionParams { method: Method::GaussianFit, ..plain() };
    // 128 · 2^(k·t - m·t²) is a Gaussian about k / 2m: every level is a whole number.
    for (column, expected) in [
        ([0, 8, 64, 128, 64, 8, 0], 3.0),
        ([0, 0, 32, 128, 128, 32, 0], 3.5),
        ([0, 0, 16, 128, 64, 2, 0], 3.25),
        ([0, 0, 4, 128, 16, 0, 0], 3.125),
        ([0, 2, 64, 128, 16, 0, 0], 2.75),
    ] {
        assert_close(centre_px(&column, params), expected);
    }
}

/// Logarithms 1, 3, 2, 1 lie on no parabola: the best fit depends on the weights. Solved in rational numbers.
#[test]
fn gaussian_fit_weighs_by_the_square_of_the_level() {
    let params = ExtractionParams { method: Method::GaussianFit, ..plain() };
    assert_close(centre_px(&[0, 2, 8, 4, 2, 0], params), 581.0 / 258.0);
}

#[test]
fn without_a_maximum_inside_the_brightest_sample_stands_in() {
    let params = ExtractionParams { method: Method::GaussianFit, ..plain() };
    for (column, expected) in [
        (&[0, 50, 0, 0][..], 1.0),
        (&[0, 50, 60, 0], 2.0),
        (&[0, 100, 10, 90, 0], 1.0),
        (&[0, 16, 32, 64, 0], 3.0),
        (&[255, 255, 255, 255], 0.0),
    ] {
        assert_close(centre_px(column, params), expected);
    }
}

#[test]
fn the_rounded_window_is_the_papers() {
    let params = ExtractionParams {
        method: Method::ImprovedGravity,
        window: GravityWindow::Rounded,
        ..plain()
    };
    let column = [0, 16, 128, 64, 2, 1, 0];
    // x_max = 2.25, taken as 2; D = 3 samples above 10, L = 2: (1·16 + 2·128 + 3·64 + 4·2) / 210
    assert_close(centre_px(&column, params), 472.0 / 210.0);
    // D = 2 samples above 16, L = 4/3, taken as 1: (1·16 + 2·128 + 3·64) / 208
    let narrow = ExtractionParams { width_threshold: 16.0, ..params };
    assert_close(centre_px(&column, narrow), 464.0 / 208.0);
    // D = 4 samples above 1, L = 8/3, taken as 3: (1·16 + 2·128 + 3·64 + 4·2 + 5·1) / 211
    let wide = ExtractionParams { width_threshold: 1.0, ..params };
    assert_close(centre_px(&column, wide), 477.0 / 211.0);
    // D = 0: L is at least 1.
    let nothing = ExtractionParams { width_threshold: 200.0, ..params };
    assert_close(centre_px(&column, nothing), 464.0 / 208.0);
}

#[test]
fn the_fractional_window_stands_still_on_the_middle_of_symmetric_levels() {
    let params = ExtractionParams { method: Method::ImprovedGravity, ..plain() };
    assert_close(centre_px(&[0, 0, 20, 90, 160, 90, 20, 0, 0], params), 4.0);
    assert_close(centre_px(&[0, 0, 20, 90, 90, 20, 0, 0, 0], params), 3.5);
    assert_close(centre_px(&[7, 7, 20, 90, 90, 20, 7, 7, 7], params), 3.5);
}

/// A window that reaches beyond both borders covers the whole column, wherever its middle is.
#[test]
fn the_fractional_window_ends_at_the_border() {
    let params = ExtractionParams { method: Method::ImprovedGravity, ..plain() };
    // Straight lines from 60 over 120 to 180: ∫ G = 30 + 120 + 90, ∫ x·G = 60/6 + 120 + 5·180/6.
    assert_close(centre_px(&[60, 120, 180], params), 280.0 / 240.0);
    assert_close(centre_px(&[200; 9], params), 4.0);
}

#[test]
fn width_and_intensity_lie_between_samples() {
    let triangle = extract(1, &[0, 64, 128, 64, 0], plain());
    assert_close(triangle.width_px[0], 2.0);
    // Half of 120 lies 20/60 before row 1 and 60/80 behind row 3.
    let skew = extract(1, &[20, 80, 120, 100, 20, 0], plain());
    assert_close(skew.width_px[0], 2.0 + 20.0 / 60.0 + 40.0 / 80.0);
    // A quarter of the way from 128 to 64.
    let params = ExtractionParams { method: Method::GaussianFit, ..plain() };
    assert_close(extract(1, &[0, 16, 128, 64, 2, 0], params).intensity[0], 112.0);
    assert!(extract(1, &[128, 64, 0], plain()).width_px[0].is_nan(), "no edge above row 0");
}

#[test]
fn thresholds_and_areas_must_be_exceeded() {
    let params = ExtractionParams { segment_threshold: 35.0, ..plain() };
    assert!(extract(1, &[0, 35, 35, 0], params).is_empty());
    assert_eq!(extract(1, &[0, 35, 36, 0], params).v_px, [2.0]);
    let column = [0, 90, 90, 90, 0];
    assert_eq!(extract(1, &column, ExtractionParams { min_segment_area: 2, ..params }).len(), 1);
    assert!(extract(1, &column, ExtractionParams { min_segment_area: 3, ..params }).is_empty());
}

#[test]
fn of_equal_candidates_the_first_is_taken() {
    let column = [0, 90, 0, 20, 20, 0, 90, 0, 20, 20, 0];
    for (peak_selection, expected) in [
        (PeakSelection::Brightest, 1.0),
        (PeakSelection::Widest, 3.5),
        (PeakSelection::First, 1.0),
        (PeakSelection::Last, 8.5),
    ] {
        let line = extract(1, &column, ExtractionParams { peak_selection, ..plain() });
        assert_close(line.v_px[0], expected);
        assert!(line.flags[0] & flag::MULTIPLE_PEAKS != 0);
    }
}

#[test]
fn corners_connect_a_stripe_and_gaps_part_it() {
    let picture = [
        9, 0, 0, 0, 0, 30, //
        0, 9, 0, 0, 0, 0, //
        0, 0, 0, 9, 0, 0, //
        0, 0, 0, 0, 9, 9,
    ];
    let line = extract(6, &picture, plain());
    assert_eq!(line.u_px, [0.0, 1.0, 3.0, 4.0, 5.0]);
    assert_eq!(line.v_px, [0.0, 1.0, 2.0, 3.0, 0.0]);
    assert_eq!(line.stripe_start, [0, 2, 4]);
    let (cut, two) = (flag::CLIPPED, flag::MULTIPLE_PEAKS);
    assert_eq!(line.flags, [cut, 0, 0, cut, cut | two]);
}

#[test]
fn full_scale_is_saturated_and_less_is_not() {
    assert_eq!(extract(1, &[0, 90, 255, 90, 0], plain()).flags, [flag::SATURATED]);
    assert_eq!(extract(1, &[0, 90, 254, 90, 0], plain()).flags, [0]);
}

#[test]
fn what_is_low_against_the_noise_is_flagged() {
    let params = ExtractionParams { min_snr: 5.0, read_noise: 4.0, ..plain() };
    // 5 standard deviations of √(16 + 1/12) are 20.05.
    assert_eq!(extract(1, &[0, 20, 0], params).flags, [flag::LOW_CONTRAST]);
    assert_eq!(extract(1, &[0, 21, 0], params).flags, [0]);
}

#[test]
fn limits_of_width_and_contrast_leave_candidates_out() {
    let column = [0, 90, 0, 60, 60, 60, 0, 40, 40, 0];
    let positions = |params| extract(1, &column, params).v_px;
    assert_eq!(positions(plain()), [1.0]);
    assert_eq!(positions(ExtractionParams { min_width_px: 2, ..plain() }), [4.0]);
    let narrow = ExtractionParams { min_width_px: 2, max_width_px: Some(2), ..plain() };
    assert_eq!(positions(narrow), [7.5]);
    assert!(positions(ExtractionParams { min_contrast: 50.0, ..narrow }).is_empty());
}

#[test]
fn several_surfaces_follow_one_another() {
    let picture = [
        0, 0, 0, //
        50, 50, 50, //
        0, 0, 0, //
        90, 90, 0, //
        0, 0, 0,
    ];
    for peak_selection in [PeakSelection::Brightest, PeakSelection::Last] {
        let params = ExtractionParams { peak_selection, max_stripes: 2, ..plain() };
        let line = extract(3, &picture, params);
        assert_eq!(line.u_px, [0.0, 1.0, 2.0, 0.0, 1.0], "{peak_selection:?}");
        assert_eq!(line.v_px, [3.0, 3.0, 1.0, 1.0, 1.0], "{peak_selection:?}");
        assert_eq!(line.stripe_start, [0, 2, 3]);
    }
}

#[test]
fn a_local_background_leaves_the_stripe() {
    let column = [70, 70, 70, 70, 70, 70, 70, 90, 110, 90, 70, 70, 70, 70, 10, 10, 10];
    let params =
        ExtractionParams { background: Background::Local, background_window_px: 5, ..plain() };
    let line = extract(1, &column, params);
    assert_eq!((&line.v_px[..], &line.flags[..]), (&[8.0][..], &[0][..]));
}
