//! Extraction of one frame of 2592 x 2048 beside one read of it (the maximum of all pixels) in the same run.
#![allow(missing_docs, reason = "criterion's macros make undocumented functions")]

use criterion::{Criterion, criterion_group, criterion_main};
use laser_profiler::{
    ros::{node_params::NodeParams, parameters::Parameters},
    scanner::{
        channel::{AnyPlane, Plane},
        stripe::{Centerline, Extractor},
    },
    simulate::stripe::{StripeScene, render_stripe},
};
use std::{hint::black_box, time::Duration};

fn extract(criterion: &mut Criterion) {
    let scene = StripeScene {
        width: 2592,
        height: 2048,
        amplitude: 199.0,
        sigma_px: 2.2,
        read_noise: 2.0,
        ..StripeScene::default()
    };
    let mut samples = Vec::new();
    render_stripe(&scene, |column| 900.0 + 0.05 * f64::from(column), &mut samples);
    let plane =
        AnyPlane::Eight(Plane { width: 2592, height: 2048, stride: 2592, samples: &samples });
    let params =
        NodeParams::new(&Parameters::default()).expect("defaults are valid").cameras[0].scanner;
    let mut extractor = Extractor::new(params.extraction, params.stripe_direction);
    let mut centerline = Centerline::default();

    let mut group = criterion.benchmark_group("frame_2592x2048");
    group.measurement_time(Duration::from_secs(5));
    group.bench_function("read", |bencher| {
        bencher.iter(|| black_box(&samples).iter().copied().max());
    });
    group.bench_function("extract", |bencher| {
        bencher.iter(|| extractor.extract(black_box(&plane), (0, 0), 255, &mut centerline));
    });
    // The worst case: nothing may be left out, and every column is one candidate from border to border.
    let white = vec![255; samples.len()];
    let all = AnyPlane::Eight(Plane { width: 2592, height: 2048, stride: 2592, samples: &white });
    let mut cut = Centerline::default();
    group.sample_size(10).bench_function("extract_white", |bencher| {
        bencher.iter(|| extractor.extract(black_box(&all), (0, 0), 255, &mut cut));
    });
    group.finish();
    assert_eq!(cut.len(), 2592);
    assert_eq!(centerline.len(), 2592);
}

criterion_group!(benches, extract);
criterion_main!(benches);
