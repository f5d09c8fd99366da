//! Once every buffer has been used the measurement allocates nothing: not for a frame, a slice or a scan.

use laser_profiler::{
    ros::{node_params::NodeParams, parameters::Parameters},
    scanner::{
        axis::{AxisTravel, RawPosition},
        calibration::Calibration,
        frame_index::FrameIndex,
        image::{Frame, Image, PixelFormat},
        motion::{
            frames::{FramePair, FrameTree, Stated},
            reading::Reading,
            track::{Limits, Track},
        },
        params::{
            Background, Channel, Exposure, ExtractionParams, Method, NoiseSource, Params,
            PeakSelection, StripeDirection, Threshold,
        },
        pipeline::Pipeline,
    },
    simulate::stripe::{StripeScene, render_stripe},
};

const RIG: &str = "{type: vertical_incidence, frame_id: laser_plane, image_distance_m: 0.026, object_distance_m: 0.3,
    beta_rad: 0.5236, pixel_pitch_m: 4.8e-6, base_row_px: 60.0, center_column_px: 319.5, height_sign: -1,
    steps_quality: {rms_m: 1.0e-6, heights_used: 5, covariance: [1.0e-10, 0, 0, 0, 0, 1.0e-8, 0, 0, 0, 0, 1.0e-6, 0, 0, 0, 0, 0.1]}}";

#[test]
fn frames_slices_and_scans_allocate_nothing() {
    let plain = ExtractionParams::default();
    let smoothed = ExtractionParams { smoothing_columns: 9, ..plain };
    for (direction, exposure, extraction) in [
        (StripeDirection::Horizontal, Exposure::Single, plain),
        (StripeDirection::Vertical, Exposure::Single, plain),
        (StripeDirection::Horizontal, Exposure::Alternating, smoothed),
    ] {
        allocates_nothing(direction, exposure, extraction, PixelFormat::Mono8);
    }
}

/// Every scan chooses its channel anew.
#[test]
fn the_choice_of_a_channel_allocates_nothing() {
    for direction in [StripeDirection::Horizontal, StripeDirection::Vertical] {
        let plain = ExtractionParams::default();
        allocates_nothing(direction, Exposure::Single, plain, PixelFormat::Rgb8);
    }
}

#[test]
fn no_method_allocates_in_a_real_scenes_configuration() {
    for direction in [StripeDirection::Horizontal, StripeDirection::Vertical] {
        for method in Method::NAMES {
            let extraction = ExtractionParams {
                method: Method::from_name(method).unwrap(),
                background: Background::Local,
                threshold: Threshold::Adaptive,
                peak_selection: PeakSelection::Continuity,
                max_stripes: 2,
                tracking_margin_px: Some(16),
                noise: NoiseSource::Estimated,
                ..ExtractionParams::default()
            };
            allocates_nothing(direction, Exposure::Single, extraction, PixelFormat::Mono8);
        }
    }
}

/// Every other selection, with limits that every candidate is held against.
#[test]
fn no_selection_allocates() {
    for selection in PeakSelection::NAMES {
        let extraction = ExtractionParams {
            peak_selection: PeakSelection::from_name(selection).unwrap(),
            min_contrast: 10.0,
            max_width_px: Some(60),
            ..ExtractionParams::default()
        };
        let direction = StripeDirection::Horizontal;
        allocates_nothing(direction, Exposure::Single, extraction, PixelFormat::Mono8);
    }
}

/// Samples arrive and frames look up positions long after the first samples have been discarded.
#[test]
fn positions_allocate_nothing() {
    const FRAMES: FramePair<'_> = FramePair { target: "table", source: "camera" };
    let limits = Limits { max_gap_ns: None, max_step: Some(1.0) };
    let mut track = Track::new(limits, 100);
    let mut tree = FrameTree::new(limits);
    let mut found = 0;
    let mut step = |number: i64| {
        let stamp_ns = number * 1000;
        let position = number as f64;
        let reading = Reading {
            position: RawPosition(position),
            travel: AxisTravel::Metres(position),
            counts: number,
        };
        track.push(stamp_ns, stamp_ns, reading).unwrap();
        let pose = |parent, child| Stated {
            parent,
            child,
            stamp_ns,
            received_ns: stamp_ns,
            origin_m: [number as f64, 0.0, 0.0],
            rotation: [0.0, 0.0, 0.0, 1.0],
            is_static: false,
        };
        tree.take(&pose("table", "arm")).unwrap();
        tree.take(&pose("arm", "camera")).unwrap();
        let time_ns = stamp_ns - 500;
        let is_known = track.at(time_ns, i64::MAX).is_some()
            && tree.has_reached(FRAMES, time_ns)
            && tree.at(FRAMES, time_ns, i64::MAX).is_ok();
        found += u32::from(is_known);
    };
    (1..3000).for_each(&mut step);
    let counted = allocation_counter::measure(|| (3000..6000).for_each(&mut step));
    assert_eq!((counted.count_total, counted.bytes_total), (0, 0), "{counted:?}");
    assert_eq!(found, 5998);
}

fn allocates_nothing(
    direction: StripeDirection,
    exposure: Exposure,
    extraction: ExtractionParams,
    format: PixelFormat,
) {
    let scanner = NodeParams::new(&Parameters::default()).unwrap().cameras[0].scanner;
    let params = Params {
        stripe_direction: direction,
        exposure,
        extraction,
        channel: Channel::Auto,
        slice_profiles: 4,
        scan_max_profiles: 10,
        ..scanner
    };
    let (width, height) = match direction {
        StripeDirection::Horizontal => (640, 128),
        StripeDirection::Vertical => (128, 640),
    };
    let scene = StripeScene { width, height, direction, read_noise: 2.0, ..StripeScene::default() };
    let frames: Vec<Vec<u8>> = (0..5_u32)
        .map(|i| {
            let mut samples = Vec::new();
            let centre = move |along: u32| 40.0 + f64::from(i) * 3.0 + 0.02 * f64::from(along);
            // Two exposures in turn, dim and saturated.
            let amplitude = if i % 2 == 0 { 90.0 } else { 400.0 };
            render_stripe(
                &StripeScene { seed: i.into(), amplitude, ..scene },
                centre,
                &mut samples,
            );
            // In colour, the stripe is red and clips there first.
            match format {
                PixelFormat::Rgb8 => {
                    samples.into_iter().flat_map(|red| [red, red / 2, red / 4]).collect()
                }
                _ => samples,
            }
        })
        .collect();
    let mut pipeline = Pipeline::new(params, Some(Calibration::from_yaml(RIG).unwrap()));
    let (mut points, mut choices) = (0, 0);
    let mut process = |number: usize| {
        let image = Image::packed(width, height, format, &frames[number % 5]).unwrap();
        let index = FrameIndex { frame_number: number as u64, ..FrameIndex::default() };
        let output =
            pipeline.process(&Frame { stamp_ns: number as i64, image }, index, |_| ()).unwrap();
        points += output.slice.map_or(0, |slice| slice.account.points);
        choices += u32::from(output.channel_choice.is_some());
        if number % 20 == 19 {
            let last = pipeline.finish(0, 0).slice;
            points += last.map_or(0, |slice| slice.account.points);
        }
    };
    // Two whole scans: every buffer has been both of a pair that takes turns.
    (0..25).for_each(&mut process);
    let counted = allocation_counter::measure(|| (25..125).for_each(&mut process));
    assert_eq!(
        (counted.count_total, counted.bytes_total),
        (0, 0),
        "{direction:?} {extraction:?}: {counted:?}"
    );
    assert!(points > 100 * 600, "the frames were measured: {points} points");
    assert_eq!(choices, if format == PixelFormat::Rgb8 { 125 } else { 0 });
}
