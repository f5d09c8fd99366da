//! Extraction of one frame beside one read of it (the maximum of all pixels) in the same run: every method, frames from
//! the cache and from memory, frames in which nothing can be skipped, larger frames and more stripes.
#![allow(missing_docs, reason = "criterion's macros make undocumented functions")]

mod frames;

use criterion::{
    BenchmarkGroup, BenchmarkId, Criterion, criterion_group, criterion_main, measurement::WallTime,
};
use frames::{FULL, Frame, Ring};
use laser_profiler::{
    ros::{node_params::NodeParams, parameters::Parameters},
    scanner::{
        channel::Offset,
        params::{
            ExtractionParams, Method,
            StripeDirection::{self, Horizontal, Vertical},
        },
        stripe::{Centerline, Extractor},
    },
};
use std::{cell::LazyCell, hint::black_box, time::Duration};

/// The default method.
const DEFAULT: &str = "improved_gravity";
/// 85 MB of frames: larger than the last-level cache of the measured processors.
const NUM_COLD: usize = 16;
/// Columns of the stripe in frames of every size.
const SHORT_STRIPE: u32 = 1024;

fn group<'a>(criterion: &'a mut Criterion, name: &str) -> BenchmarkGroup<'a, WallTime> {
    let mut group = criterion.benchmark_group(name);
    group
        .sample_size(20)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_millis(1200));
    group
}

fn params(method: &str) -> ExtractionParams {
    let defaults = NodeParams::new(&Parameters::default()).expect("defaults are valid");
    let method = Method::from_name(method).expect("one of Method::NAMES");
    ExtractionParams { method, ..defaults.cameras[0].scanner.extraction }
}

/// Times a method with one extractor, as in the node, on frames that are rendered only if the benchmark runs. Checks that it
/// finds a minimum number of points: an extraction that finds nothing is fast.
fn time<F: FnOnce() -> Ring>(
    group: &mut BenchmarkGroup<'_, WallTime>,
    id: BenchmarkId,
    (method, direction): (&str, StripeDirection),
    (frames, least): (&LazyCell<Ring, F>, u32),
) {
    let mut extractor = Extractor::new(params(method), direction);
    let mut centerline = Centerline::default();
    let mut extract = |frame: &Frame| {
        let plane = black_box(frame.plane());
        extractor.extract_plane(&plane, Offset::default(), frame.full_scale(), &mut centerline);
        centerline.len()
    };
    group.bench_function(id, |bencher| {
        assert!(extract(frames.turn()) >= least as usize, "the stripe is found");
        bencher.iter(|| extract(frames.turn()));
    });
}

/// Times one read of the same frames.
fn time_read<F: FnOnce() -> Ring>(
    group: &mut BenchmarkGroup<'_, WallTime>,
    id: BenchmarkId,
    frames: &LazyCell<Ring, F>,
) {
    group.bench_function(id, |bencher| bencher.iter(|| frames.turn().read()));
}

/// One read and every method.
fn all_methods<F: FnOnce() -> Ring>(
    group: &mut BenchmarkGroup<'_, WallTime>,
    (frames, least): (&LazyCell<Ring, F>, u32),
) {
    time_read(group, BenchmarkId::from_parameter("read"), frames);
    for &method in Method::NAMES {
        time(group, BenchmarkId::from_parameter(method), (method, Horizontal), (frames, least));
    }
}

/// The same frame repeatedly, so that the processor's cache holds it if it fits.
fn warm(criterion: &mut Criterion) {
    let frame = LazyCell::new(|| Frame::new(Horizontal).alone());
    let mut group = group(criterion, "frame_2592x2048");
    all_methods(&mut group, (&frame, FULL.0));
    group.finish();
}

/// Frames in turn from a ring larger than the cache: they come from memory, as a camera's do.
fn cold(criterion: &mut Criterion) {
    let frames = LazyCell::new(|| Frame::new(Horizontal).times(NUM_COLD));
    let mut group = group(criterion, "cold_2592x2048");
    all_methods(&mut group, (&frames, FULL.0));
    group.finish();
}

/// The default method on a vertical stripe.
fn vertical(criterion: &mut Criterion) {
    let frame = LazyCell::new(|| Frame::new(Vertical).alone());
    let mut group = group(criterion, "vertical_2592x2048");
    time_read(&mut group, BenchmarkId::from_parameter("read"), &frame);
    time(&mut group, BenchmarkId::from_parameter(DEFAULT), (DEFAULT, Vertical), (&frame, FULL.1));
    group.finish();
}

/// The default method on samples of 16 bits.
fn mono16(criterion: &mut Criterion) {
    let frame = LazyCell::new(|| Frame::deep().alone());
    let mut group = group(criterion, "mono16_2592x2048");
    time_read(&mut group, BenchmarkId::from_parameter("read"), &frame);
    time(&mut group, BenchmarkId::from_parameter(DEFAULT), (DEFAULT, Horizontal), (&frame, FULL.0));
    group.finish();
}

/// The same stripe in a frame in which every block must be blurred.
fn dense(criterion: &mut Criterion) {
    let frame = LazyCell::new(|| Frame::new(Horizontal).with_salt().alone());
    let mut group = group(criterion, "dense_2592x2048");
    all_methods(&mut group, (&frame, FULL.0));
    group.finish();
}

/// The worst case: every column is one candidate from border to border. No method finds a stripe in it.
fn white(criterion: &mut Criterion) {
    let frame = LazyCell::new(|| Frame::white().alone());
    let mut group = group(criterion, "white_2592x2048");
    group.sample_size(10);
    all_methods(&mut group, (&frame, 0));
    group.finish();
}

/// The same stripe of 1024 columns in frames of growing size: the time beyond one read must stay constant.
fn frame_sizes(criterion: &mut Criterion) {
    let mut group = group(criterion, "frame_size");
    for (label, size) in [
        ("1_mpx", (1024, 1024)),
        ("2_mpx", (1632, 1224)),
        ("5_mpx", FULL),
        ("12_mpx", (4096, 3000)),
        ("25_mpx", (5120, 5120)),
    ] {
        let frame = LazyCell::new(|| Frame::short_stripe(size, SHORT_STRIPE).alone());
        time_read(&mut group, BenchmarkId::new("read", label), &frame);
        let id = BenchmarkId::new(DEFAULT, label);
        time(&mut group, id, (DEFAULT, Horizontal), (&frame, SHORT_STRIPE));
    }
    group.finish();
}

/// A growing share of bright pixels, compared with the same frame without skipping: skipping must never cost more.
fn bright_shares(criterion: &mut Criterion) {
    let mut group = group(criterion, "bright_share");
    for (label, share, least) in [
        ("0.1_percent", 0.001, 600),
        ("1_percent", 0.01, FULL.0),
        ("3_percent", 0.03, FULL.0),
        ("10_percent", 0.1, FULL.0),
    ] {
        let skipping = LazyCell::new(|| Frame::bright(share).alone());
        let dense = LazyCell::new(|| Frame::bright(share).with_salt().alone());
        let method = (DEFAULT, Horizontal);
        time_read(&mut group, BenchmarkId::new("read", label), &skipping);
        time(&mut group, BenchmarkId::new("skipping", label), method, (&skipping, least));
        time(&mut group, BenchmarkId::new("dense", label), method, (&dense, least));
    }
    group.finish();
}

criterion_group!(benches, warm, cold, vertical, mono16, dense, white, frame_sizes, bright_shares);
criterion_main!(benches);
