//! The fast extractor equals the reference bit for bit, at every level of vector instructions.

use super::*;
use crate::scanner::{
    params::{Background, GravityWindow, PeakSelection},
    stripe::{
        reference::{self, LitFrame},
        tile_blur::{COLUMNS, ROWS},
    },
};
use proptest::prelude::*;

const OFFSET: Offset = Offset { column: 3, row: 7 };

/// Width, height, stride and samples.
type OwnedPlane<S> = (usize, usize, usize, Vec<S>);

/// Generates every value of a choice from its names, so that a new estimator is tested automatically.
fn any_of<T: Clone + std::fmt::Debug + 'static>(
    names: &'static [&'static str],
    from_name: fn(&str) -> Option<T>,
) -> impl Strategy<Value = T> {
    prop::sample::select(names.iter().filter_map(|name| from_name(name)).collect::<Vec<_>>())
}

fn any_params() -> impl Strategy<Value = ExtractionParams> {
    let choices = (
        any_of(Method::NAMES, Method::from_name),
        any_of(GravityWindow::NAMES, GravityWindow::from_name),
        any_of(PeakSelection::NAMES, PeakSelection::from_name),
    );
    // The reference takes (2r + 1)² steps a pixel: large radii only rarely.
    let radius = prop_oneof![3 => 0..4_u32, 1 => 4..=15_u32];
    // Half grey levels: samples can lie exactly on a threshold and between two thresholds.
    let threshold = prop_oneof![0..20_u32, 0..200_u32];
    (choices, radius, threshold, 0..40_u32, 0..255_u32, any_scene()).prop_map(
        |((method, window, peak_selection), blur_radius, threshold, area, width, scene)| {
            ExtractionParams {
                method,
                window,
                blur_radius,
                segment_threshold: f64::from(threshold) / 2.0,
                min_segment_area: area,
                width_threshold: f64::from(width),
                peak_selection,
                ..scene
            }
        },
    )
}

/// Parameters for scenes that are not black, each switched on half of the time.
fn any_scene() -> impl Strategy<Value = ExtractionParams> {
    let choices = (
        any_of(Background::NAMES, Background::from_name),
        any_of(Threshold::NAMES, Threshold::from_name),
    );
    let widths = (prop_oneof![Just(1), 1..9_u32], prop_oneof![Just(0), 0..40_u32]);
    let lines = (1..4_u32, 1..20_u32, prop_oneof![Just(0), 0..30_u32]);
    let contrast = prop_oneof![Just(0), 0..255_u32];
    (choices, 3..60_u32, 2..40_u32, contrast, widths, lines).prop_map(
        |((background, threshold), window_px, sigmas, contrast, widths, lines)| ExtractionParams {
            background,
            background_window_px: window_px,
            threshold,
            threshold_sigmas: f64::from(sigmas) / 2.0,
            min_contrast: f64::from(contrast),
            min_width_px: widths.0,
            max_width_px: (widths.1 > 0).then_some(widths.1),
            max_stripes: lines.0,
            max_step_px: f64::from(lines.1) / 2.0,
            tracking_margin_px: (lines.2 > 0).then_some(lines.2),
            ..ExtractionParams::default()
        },
    )
}

/// A side length of 1 to `tiles` tiles and a little more, half of the values near a tile border.
fn any_side(tile: usize, tiles: usize) -> impl Strategy<Value = usize> {
    let about_borders = (1..=tiles, 0..=2_usize);
    prop_oneof![
        about_borders.prop_map(move |(count, beyond)| count * tile + beyond - 1),
        1..=tiles * tile + 8,
    ]
}

/// Any level, or one near the lower thresholds.
fn any_level<S: Sample + Arbitrary + From<u8>>() -> impl Strategy<Value = S> {
    prop_oneof![any::<S>(), (0..12_u8).prop_map(S::from)]
}

/// An even background with a few blocks that leave most tiles cold, or dense noise; a stride wider than the rows.
fn any_plane<S: Sample + Arbitrary + From<u8>>(
    (width, height, padding): (usize, usize, usize),
) -> impl Strategy<Value = OwnedPlane<S>> {
    let stride = width + padding;
    let block = (0..stride, 0..height, 1..9_usize, 1..17_usize, any_level::<S>());
    let few = prop::collection::vec(block, 0..5);
    let many = (1..50_usize).prop_flat_map(move |sparsity| {
        let pixel = (0..stride, 0..height, Just(1), Just(1), any_level::<S>());
        prop::collection::vec(pixel, stride * height / sparsity)
    });
    let background = prop_oneof![Just(0), 0..12_u8];
    (background, prop_oneof![few, many]).prop_map(move |(background, blocks)| {
        let mut samples = vec![S::from(background); stride * height];
        for (x, y, columns, rows, level) in blocks {
            for row in y..(y + rows).min(height) {
                let end = (x + columns).min(stride);
                samples[row * stride + x..row * stride + end].fill(level);
            }
        }
        (width, height, stride, samples)
    })
}

/// Frames of one size, then frames of another.
fn any_planes<S: Sample + Arbitrary + From<u8>>() -> impl Strategy<Value = Vec<OwnedPlane<S>>> {
    let size = || (any_side(COLUMNS, 2), any_side(ROWS, 5), 0..5_usize);
    let frames = |size| prop::collection::vec(any_plane(size), 1..4);
    (size().prop_flat_map(frames), size().prop_flat_map(frames))
        .prop_map(|(one, other)| one.into_iter().chain(other).collect())
}

/// Converts to bits, so that NaN equals itself.
fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

fn assert_equal(fast: &Centerline, reference: &Centerline) {
    assert_eq!(bits(&fast.u_px), bits(&reference.u_px));
    assert_eq!(bits(&fast.v_px), bits(&reference.v_px));
    assert_eq!(fast.stripe_start, reference.stripe_start);
    assert_eq!(bits(&fast.width_px), bits(&reference.width_px));
    assert_eq!(bits(&fast.intensity), bits(&reference.intensity));
    assert_eq!(bits(&fast.sigma_px), bits(&reference.sigma_px));
    assert_eq!(fast.flags, reference.flags);
}

fn check<S: Sample>(params: ExtractionParams, full_scale: u32, planes: &[OwnedPlane<S>]) {
    for direction in [StripeDirection::Horizontal, StripeDirection::Vertical] {
        // One extractor per vector level for all frames: leftovers of an earlier frame must not show.
        let mut fast: Vec<_> = Vectors::all()
            .into_iter()
            .map(|vectors| FastExtractor { vectors, ..FastExtractor::new(params, direction) })
            .collect();
        let mut selector = Selector::new(params);
        let mut centerline = Centerline::default();
        let mut previous: Option<Plane<'_, S>> = None;
        for (width, height, stride, samples) in planes {
            let plane = Plane { width: *width, height: *height, stride: *stride, samples };
            // The previous frame serves as the frame without laser, if it has the same size.
            let ambient = previous.filter(|p| (p.width, p.height) == (*width, *height));
            let ambient = ambient.unwrap_or(plane);
            let frame = LitFrame { plane: &plane, ambient: Some(&ambient), full_scale };
            let expected =
                reference::extract_next(&frame, OFFSET, &params, &mut selector, direction);
            for fast in &mut fast {
                fast.set_ambient(&ambient);
                fast.extract(&plane, OFFSET, full_scale, &mut centerline);
                assert_equal(&centerline, &expected);
            }
            previous = Some(plane);
        }
    }
}

proptest! {
    #[test]
    fn fast_equals_reference_on_8_bit(
        params in any_params(),
        planes in any_planes::<u8>(),
    ) {
        check(params, 255, &planes);
    }

    #[test]
    fn fast_equals_reference_on_16_bit(
        params in any_params(),
        planes in any_planes::<u16>(),
        full_scale in prop::sample::select(vec![1023_u32, 4095, 65_535]),
    ) {
        check(params, full_scale, &planes);
    }
}

/// One run every second pixel: joined into one region (a checkerboard), or each a region of its own (dots).
#[test]
fn the_densest_patterns_are_measured_too() {
    let (width, height) = (130, 70);
    let pattern = |is_bright: fn(usize, usize) -> bool| {
        let samples = (0..width * height)
            .map(|at| if is_bright(at % width, at / width) { 255_u8 } else { 0 })
            .collect();
        (width, height, width, samples)
    };
    let planes = [pattern(|x, y| (x + y) % 2 == 0), pattern(|x, y| x % 2 == 0 && y % 2 == 0)];
    for min_segment_area in [0, 1, 4549, 4550] {
        let params =
            ExtractionParams { blur_radius: 0, min_segment_area, ..ExtractionParams::default() };
        check(params, 255, &planes);
    }
}
