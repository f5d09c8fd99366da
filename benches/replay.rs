//! Frames a second of a whole replay: an uncompressed bag of 2592 x 2048 images in, a results bag out.
#![allow(missing_docs, reason = "criterion's macros make undocumented functions")]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use laser_profiler::{
    bag::{Compression, RecordOptions, Recorder, Times, Topic},
    cli::replay::replay,
    msg::{
        builtin_interfaces::Time, cdr, qos::QosProfile, schema::Message, sensor_msgs,
        std_msgs::Header,
    },
    node::{replay::ReplayRequest, stop::Stop},
    simulate::stripe::{StripeScene, render_stripe},
};
use std::{borrow::Cow, hint::black_box, path::Path, time::Duration};

const FRAMES: u32 = 60;
const CALIBRATION: &str = "{type: vertical_incidence, frame_id: laser_plane, image_distance_m: 0.026,
    object_distance_m: 0.3, beta_rad: 0.5236, pixel_pitch_m: 4.8e-6, base_row_px: 1024.0, center_column_px: 1295.5,
    height_sign: -1}";
const PARAMETERS: &str = "/**: {ros__parameters: {calibration_file: calibration.yaml,
    motion: {source: constant, step: 0.0001}}}";

fn record(directory: &Path) -> anyhow::Result<()> {
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
    let mut recorder = Recorder::create(
        directory,
        &RecordOptions { compression: Compression::None, ..RecordOptions::default() },
    )?;
    let topic = recorder.add_topic(&Topic::new(
        "/camera/image_raw",
        sensor_msgs::Image::TYPE,
        QosProfile::reliable(10),
    ))?;
    let mut bytes = Vec::new();
    for i in 0..FRAMES {
        let stamp_ns = i64::from(i + 1) * 45_000_000;
        let image = sensor_msgs::Image {
            header: Header { stamp: Time::from_ns(stamp_ns), frame_id: Cow::Borrowed("camera") },
            height: 2048,
            width: 2592,
            encoding: Cow::Borrowed("mono8"),
            is_bigendian: 0,
            step: 2592,
            data: &samples,
        };
        cdr::encode(&image, &mut bytes)?;
        recorder.write(
            topic,
            Times { log_ns: stamp_ns, publish_ns: stamp_ns, sequence: i + 1 },
            &bytes,
        )?;
    }
    recorder.finish()?;
    Ok(())
}

fn whole_replay(criterion: &mut Criterion) {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let bag = directory.path().join("recording");
    record(&bag).expect("a recording");
    std::fs::write(directory.path().join("calibration.yaml"), CALIBRATION)
        .expect("a calibration file");
    let parameters = directory.path().join("parameters.yaml");
    std::fs::write(&parameters, PARAMETERS).expect("a parameter file");
    let mut request = ReplayRequest {
        bags: vec![bag.clone()],
        output: directory.path().join("results"),
        force: true,
        ..ReplayRequest::default()
    };
    request.ros.parameter_files.push(parameters);

    let mut group = criterion.benchmark_group("replay_2592x2048");
    group
        .sample_size(10)
        .measurement_time(Duration::from_secs(10))
        .throughput(Throughput::Elements(FRAMES.into()));
    // The yardstick: the same bytes from the page cache through memory once.
    group.bench_function("read_the_file", |bencher| {
        bencher.iter(|| {
            black_box(std::fs::read(bag.join("recording_0.mcap"))).map(|bytes| bytes.len())
        });
    });
    group.bench_function("replay", |bencher| {
        bencher.iter(|| {
            let summary = replay(request.clone(), &Stop::default()).expect("a replay");
            assert_eq!(summary.counts.processed, u64::from(FRAMES));
        });
    });
    group.finish();
}

criterion_group!(benches, whole_replay);
criterion_main!(benches);
