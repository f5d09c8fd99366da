//! Frames a second of a whole replay, from a bag to bags of results: uncompressed images of two sizes beside one read of
//! the file, then the same number of frames from one camera and from two, on one core and on all.
#![allow(missing_docs, reason = "criterion's macros make undocumented functions")]

mod recordings;

use criterion::{
    BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main, measurement::WallTime,
};
use laser_profiler::{
    cli::replaying::replay,
    node::{replay::ReplayRequest, stop::Stop},
};
use recordings::{Payload, Recording};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use std::{
    cell::LazyCell, fs::File, hint::black_box, io::Read, path::Path, thread::Builder,
    time::Duration,
};
use tempfile::TempDir;

/// Bytes that the reference reads at once, few enough to stay in the processor's cache.
const PIECE_BYTES: usize = 128 << 10;

fn group<'a>(
    criterion: &'a mut Criterion,
    name: &str,
    recording: &Recording,
) -> BenchmarkGroup<'a, WallTime> {
    let mut group = criterion.benchmark_group(name);
    group
        .sample_size(10)
        .measurement_time(Duration::from_secs(10))
        .throughput(Throughput::Elements(recording.num_frames.into()));
    group
}

/// Creates the recording; called only for benchmarks that run.
fn written(recording: &Recording) -> (TempDir, ReplayRequest) {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let request = recording.write(directory.path()).expect("a recording");
    (directory, request)
}

/// Replays in a separate thread, so that profilers distinguish it from the thread that creates the recordings.
fn replay_all(request: &ReplayRequest, recording: &Recording) {
    let request = request.clone();
    let run = move || replay(request, &Stop::default()).expect("a replay");
    let reader = Builder::new().name("read".to_owned()).spawn(run).expect("a thread");
    let summary = reader.join().expect("a replay");
    assert_eq!(summary.counts.processed, u64::from(recording.num_frames));
}

fn read_all(file: &Path) -> u64 {
    let (mut file, mut piece) = (File::open(file).expect("the recording"), vec![0; PIECE_BYTES]);
    let mut num_bytes = 0;
    loop {
        match file.read(&mut piece).expect("the recording") {
            0 => return num_bytes,
            num => num_bytes += black_box(&piece[..num]).len() as u64,
        }
    }
}

/// Uncompressed images of one camera.
fn whole_replay(criterion: &mut Criterion) {
    for (size_px, num_frames) in [((2592, 2048), 200), ((640, 480), 2000)] {
        let cameras = &["camera"];
        let recording = Recording { size_px, payload: Payload::Raw, cameras, num_frames };
        let written = LazyCell::new(|| written(&recording));
        let name = format!("replay_{}x{}", size_px.0, size_px.1);
        let mut group = group(criterion, &name, &recording);
        // Reference: one read of the same bytes from the page cache.
        group.bench_function("read_the_file", |bencher| {
            let file = Recording::file(written.0.path());
            bencher.iter(|| read_all(&file));
        });
        group.bench_function("replay", |bencher| {
            let request = &written.1;
            bencher.iter(|| replay_all(request, &recording));
        });
        group.finish();
    }
}

/// Restricts this thread, and the threads that it starts, to these cores.
fn run_on(cores: &CpuSet) {
    sched_setaffinity(None, cores).expect("cores of this machine");
}

fn first_of(cores: &CpuSet) -> CpuSet {
    let first = (0..CpuSet::MAX_CPU).find(|&core| cores.is_set(core)).expect("a core");
    let mut set = CpuSet::new();
    set.set(first);
    set
}

/// The same number of frames from one camera and from two, on one core and on all.
fn cameras_and_cores(criterion: &mut Criterion) {
    let all = sched_getaffinity(None).expect("the cores of this process");
    for (name, size_px, payload, num_frames) in [
        ("cores_640x480", (640, 480), Payload::Raw, 2000),
        ("cores_640x480_jpeg", (640, 480), Payload::Jpeg, 1000),
        ("cores_2592x2048", (2592, 2048), Payload::Raw, 200),
        ("cores_2592x2048_jpeg", (2592, 2048), Payload::Jpeg, 100),
    ] {
        let both: [&[&str]; 2] = [&["left"], &["left", "right"]];
        for (number, cameras) in (1..).zip(both) {
            let recording = Recording { size_px, payload, cameras, num_frames };
            let written = LazyCell::new(|| written(&recording));
            let mut group = group(criterion, name, &recording);
            for (on, cores) in [("one_core", &first_of(&all)), ("all_cores", &all)] {
                group.bench_function(format!("{number}_camera_{on}"), |bencher| {
                    let request = &written.1;
                    run_on(cores);
                    bencher.iter(|| replay_all(request, &recording));
                    run_on(&all);
                });
            }
            group.finish();
        }
    }
}

criterion_group!(benches, whole_replay, cameras_and_cores);
criterion_main!(benches);
