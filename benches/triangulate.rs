//! Triangulation of one frame's 2592 points beside their extraction in the same run.
#![allow(missing_docs, reason = "criterion's macros make undocumented functions")]

#[allow(dead_code, reason = "the other benchmark uses the rest")]
mod frames;

use std::{hint::black_box, time::Duration};

use criterion::{Criterion, criterion_group, criterion_main};
use frames::{FULL, Frame};
use laser_profiler::{
    ros::{node_params::NodeParams, parameters::Parameters},
    scanner::{
        calibration::{Calibration, Lines, VerticalIncidence},
        camera::Distortion,
        channel::Offset,
        params::StripeDirection::Horizontal,
        profile::Profile,
        stripe::{Centerline, Extractor},
    },
};

const RIG: VerticalIncidence = VerticalIncidence {
    frame_id: String::new(),
    image_distance_m: 0.026,
    object_distance_m: 0.3,
    beta_rad: 0.523,
    pixel_pitch_m: 4.8e-6,
    base_row_px: 1024.0,
    center_column_px: 1295.5,
    height_sign: -1,
    quality: None,
};

/// The same rig with lens distortion.
fn bent(distortion: Distortion, tilt_rad: [f64; 2]) -> Calibration {
    let mut rig = RIG.camera_and_plane(Horizontal, FULL);
    rig.camera.distortion = distortion;
    rig.camera.tilt_rad = tilt_rad;
    Calibration::CameraAndPlane(Box::new(rig))
}

fn triangulate(criterion: &mut Criterion) {
    let defaults = NodeParams::new(&Parameters::default()).expect("defaults are valid");
    let frame = Frame::new(Horizontal);
    let mut extractor = Extractor::new(defaults.cameras[0].scanner.extraction, Horizontal);
    let mut centerline = Centerline::default();
    let mut group = criterion.benchmark_group("triangulate_2592");
    group
        .sample_size(20)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_millis(1200));
    group.bench_function("extract", |bencher| {
        bencher.iter(|| {
            let plane = black_box(frame.plane());
            extractor.extract_plane(&plane, Offset::default(), frame.full_scale(), &mut centerline);
        });
    });
    let plane = frame.plane();
    extractor.extract_plane(&plane, Offset::default(), frame.full_scale(), &mut centerline);
    assert_eq!(centerline.len(), FULL.0 as usize);
    let plumb_bob = Distortion::PlumbBob { k1: -0.2, k2: 0.1, p1: 0.001, p2: -0.002, k3: -0.02 };
    let rational = Distortion::RationalPolynomial {
        k1: 0.9,
        k2: -0.3,
        p1: 0.001,
        p2: -0.001,
        k3: 0.02,
        k4: 1.2,
        k5: 0.1,
        k6: 0.01,
    };
    let equidistant = Distortion::Equidistant { k1: -0.01, k2: 0.02, k3: -0.01, k4: 0.001 };
    let lines = Lines { direction: Horizontal, first: 0, count: FULL.0 as usize };
    let mut profile = Profile::default();
    for (name, calibration) in [
        ("vertical_incidence", Calibration::VerticalIncidence(RIG)),
        ("pinhole", bent(Distortion::None, [0.0; 2])),
        ("plumb_bob", bent(plumb_bob, [0.0; 2])),
        ("rational_polynomial", bent(rational, [0.0; 2])),
        ("equidistant", bent(equidistant, [0.0; 2])),
        ("rational_polynomial_tilted", bent(rational, [0.1, -0.05])),
    ] {
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                calibration.triangulate(black_box(&centerline), &lines, 255, &mut profile);
                profile.valid_count
            });
        });
        assert_eq!(profile.valid_count, FULL.0, "{name}");
    }
    group.finish();
}

criterion_group!(benches, triangulate);
criterion_main!(benches);
