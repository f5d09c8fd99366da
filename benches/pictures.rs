//! Pictures a second: a replay of a folder of PNG files to a bag of results, beside the decoding of the same files on all
//! cores and nothing else.
#![allow(missing_docs, reason = "criterion's macros make undocumented functions")]

use std::{
    fs,
    hint::black_box,
    io::Cursor,
    path::{Path, PathBuf},
    sync::atomic::{AtomicUsize, Ordering},
    thread,
    time::Duration,
};

use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use image::{ExtendedColorType, ImageDecoder, ImageEncoder, codecs::png};
use laser_profiler::{
    cli::replaying::replay,
    node::{replay::ReplayRequest, stop::Stop},
    simulate::stripe::{StripeScene, render_stripe},
};

const WIDTH: u32 = 2592;
const HEIGHT: u32 = 2048;
/// Different pictures, each with its own noise and stripe.
const NUM_DIFFERENT: u32 = 8;
/// Enough that the start and the end of a replay do not count.
const NUM_PICTURES: u32 = 1000;

/// Writes the pictures, the calibration and the parameters; returns the pictures.
fn write(directory: &Path) -> Vec<PathBuf> {
    let folder = directory.join("pictures");
    fs::create_dir(&folder).expect("a folder");
    let scene = StripeScene {
        width: WIDTH,
        height: HEIGHT,
        amplitude: 199.0,
        sigma_px: 2.2,
        read_noise: 2.0,
        ..StripeScene::default()
    };
    let file = |number: u32| {
        let mut samples = Vec::new();
        let centre =
            |column| 0.44 * f64::from(HEIGHT) + f64::from(3 * number) + 0.05 * f64::from(column);
        render_stripe(&StripeScene { seed: number.into(), ..scene }, centre, &mut samples);
        let mut file = Vec::new();
        png::PngEncoder::new(&mut file)
            .write_image(&samples, WIDTH, HEIGHT, ExtendedColorType::L8)
            .expect("a picture");
        file
    };
    let path = |number: u32| folder.join(format!("{number}.png"));
    let paths: Vec<_> = (1..=NUM_PICTURES).map(path).collect();
    for (number, path) in (0..).zip(&paths) {
        if number < NUM_DIFFERENT {
            fs::write(path, file(number)).expect("a picture");
        } else {
            fs::hard_link(&paths[(number % NUM_DIFFERENT) as usize], path).expect("a picture");
        }
    }
    let calibration = "{type: vertical_incidence, frame_id: laser_plane, image_distance_m: 0.026, \
                       object_distance_m: 0.3, beta_rad: 0.5236, pixel_pitch_m: 4.8e-6, base_row_px: 1024.0, \
                       center_column_px: 1295.5, height_sign: -1}";
    fs::write(directory.join("calibration.yaml"), calibration).expect("a calibration");
    let values = "calibration_file: calibration.yaml, motion: {source: constant, step: 0.0001}";
    let parameters = format!("/**: {{ros__parameters: {{{values}}}}}");
    fs::write(directory.join("parameters.yaml"), parameters).expect("parameters");
    paths
}

/// Decodes every file on as many threads as there are cores.
fn decode_all(paths: &[PathBuf]) {
    let next = AtomicUsize::new(0);
    let num_threads = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        for _ in 0..num_threads {
            scope.spawn(|| {
                let mut pixels = Vec::new();
                while let Some(path) = paths.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let file = fs::read(path).expect("a picture");
                    let decoder = png::PngDecoder::new(Cursor::new(&file)).expect("a picture");
                    pixels.resize(decoder.total_bytes() as usize, 0);
                    decoder.read_image(&mut pixels).expect("a picture");
                    black_box(&pixels);
                }
            });
        }
    });
}

fn pictures(criterion: &mut Criterion) {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let paths = write(directory.path());
    let mut request = ReplayRequest {
        bags: vec![directory.path().join("pictures")],
        output: directory.path().join("results"),
        force: true,
        ..ReplayRequest::default()
    };
    request.ros.parameter_files.push(directory.path().join("parameters.yaml"));
    let mut group = criterion.benchmark_group("pictures_2592x2048_png");
    group
        .sample_size(10)
        .sampling_mode(SamplingMode::Flat)
        .measurement_time(Duration::from_secs(15))
        .throughput(Throughput::Elements(NUM_PICTURES.into()));
    group.bench_function("decode_on_all_cores", |bencher| bencher.iter(|| decode_all(&paths)));
    group.bench_function("replay", |bencher| {
        bencher.iter(|| {
            let summary = replay(request.clone(), &Stop::default()).expect("a replay");
            assert_eq!(summary.counts.processed, u64::from(NUM_PICTURES));
        });
    });
    group.finish();
}

criterion_group!(benches, pictures);
criterion_main!(benches);
