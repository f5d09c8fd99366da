//! Tests the node from source to sink, with a source and sinks in memory.

mod positions;
mod streams;

use std::sync::{Arc, Mutex};

use super::{
    results::Results,
    run::{Chain, Run, RunError},
    sink::{Outgoing, Outlet, Sink, SinkError},
    source::{Input, PublisherId, Source},
    statistics::Summary,
    status::{Reporter, session_id},
    stop::Stop,
    topics::Output,
    worker::{Worker, WorkerOptions},
};
use crate::{
    bag::{RawMessage, Topic},
    msg::{
        builtin_interfaces::Time,
        cdr,
        diagnostic_msgs::DiagnosticArray,
        laser_profiler_msgs::{Centerline, FrameTrace, Profile, SliceInfo, StreamStatus},
        qos::QosProfile,
        schema::Message,
        sensor_msgs::{Image, PointCloud2},
        std_msgs::Header,
    },
    ros::{
        node_params::{ImageTransport, NodeParams},
        parameters::Parameters,
        value::Value,
    },
    scanner::{
        calibration::{Calibration, VerticalIncidence},
        pipeline::Pipeline,
    },
};

const WIDTH: u32 = 64;
const HEIGHT: u32 = 32;
/// The stripe is symmetrical about this row, so every estimator finds its centre there.
const CENTER_ROW: u32 = 10;
const MS: i64 = 1_000_000;
/// 2020-01-01, so that times have a realistic magnitude.
const START_NS: i64 = 1_577_836_800_000_000_000;

fn picture() -> Vec<u8> {
    let level = |row: u32| match row.abs_diff(CENTER_ROW) {
        0 => 200,
        1 => 160,
        2 => 90,
        _ => 5,
    };
    (0..HEIGHT).flat_map(|row| vec![level(row); WIDTH as usize]).collect()
}

/// An image message; times are milliseconds after the start.
fn frame(sequence: u32, log_ms: i64, stamp_ms: i64, edit: impl FnOnce(&mut Image<'_>)) -> Input {
    let picture = picture();
    let mut image = Image {
        header: Header {
            stamp: Time::from_ns(START_NS + stamp_ms * MS),
            frame_id: "optical".into(),
        },
        height: HEIGHT,
        width: WIDTH,
        encoding: "mono8".into(),
        is_bigendian: 0,
        step: WIDTH,
        data: &picture,
    };
    edit(&mut image);
    let mut data = Vec::new();
    cdr::encode(&image, &mut data).unwrap();
    message(sequence, log_ms, data)
}

pub(super) fn good(sequence: u32, at_ms: i64) -> Input {
    frame(sequence, at_ms, at_ms, |_| {})
}

fn message(sequence: u32, log_ms: i64, data: Vec<u8>) -> Input {
    let topic = Topic::new("/image_raw", Image::TYPE, QosProfile::reliable(10));
    let log_time_ns = START_NS + log_ms * MS;
    let message = RawMessage {
        topic: Arc::new(topic),
        log_time_ns,
        publish_time_ns: log_time_ns,
        sequence,
        data,
        file: None,
    };
    Input::Message(message, PublisherId::default())
}

struct Listed(std::vec::IntoIter<Input>);

impl Source for Listed {
    fn next(&mut self) -> Option<Input> {
        self.0.next()
    }
}

/// Keeps messages until it is full.
struct Memory {
    kept: Arc<Mutex<Vec<Outgoing>>>,
    room: usize,
}

impl Sink for Memory {
    fn write(&mut self, message: &Outgoing) -> Result<(), SinkError> {
        let mut kept = self.kept.lock().unwrap();
        if kept.len() == self.room {
            return Err(SinkError { sink: "memory".into(), source: "no space left".into() });
        }
        kept.push(message.clone());
        Ok(())
    }

    fn finish(&mut self) -> Result<(), SinkError> {
        Ok(())
    }
}

struct Setup {
    calibrated: bool,
    transport: ImageTransport,
    sends_images: bool,
    max_frame_bytes: u64,
    room: usize,
    stop: Stop,
    values: Vec<(&'static str, Value)>,
}

impl Default for Setup {
    fn default() -> Self {
        Self {
            calibrated: false,
            transport: ImageTransport::Raw,
            sends_images: false,
            max_frame_bytes: 1 << 20,
            room: usize::MAX,
            stop: Stop::default(),
            values: vec![
                ("motion.source", Value::Text("constant".into())),
                ("motion.step", Value::Float(0.001)),
            ],
        }
    }
}

pub(super) fn calibration() -> Calibration {
    Calibration::VerticalIncidence(VerticalIncidence {
        frame_id: "laser".into(),
        image_distance_m: 0.05,
        object_distance_m: 0.5,
        beta_rad: 0.6,
        pixel_pitch_m: 5e-6,
        base_row_px: 16.0,
        center_column_px: 32.0,
        height_sign: -1,
        quality: None,
    })
}

fn worker(setup: &Setup) -> Worker {
    let mut values = Parameters::default();
    let small = [
        ("extraction.min_segment_area", Value::Integer(20)),
        ("slice.profiles", Value::Integer(4)),
    ];
    for (name, value) in small.into_iter().chain(setup.values.clone()) {
        values.set(name, value, "a test").unwrap();
    }
    let params = &NodeParams::new(&values).unwrap().cameras[0];
    let calibration = setup.calibrated.then(calibration);
    let options = WorkerOptions {
        transport: setup.transport,
        max_frame_bytes: setup.max_frame_bytes,
        sends_images: setup.sends_images,
    };
    let results = Results::new(&params.scanner, calibration.as_ref(), &values.camera_sha256(""));
    let reporter = Reporter {
        node: "/laser_profiler".into(),
        camera: String::new(),
        topic: "/image_raw".into(),
        queue_capacity: 4,
        session_id: session_id("/image_raw", &values.camera_sha256("")),
    };
    let positions = super::positions::of_camera(params, calibration.as_ref()).unwrap();
    let topics = vec!["/joint_states".to_owned(), "/encoder".to_owned()];
    Worker::new(options, Pipeline::new(params.scanner, calibration), results, reporter)
        .with_positions(positions, topics)
}

fn chain(setup: &Setup, sink: impl Sink + 'static) -> Chain {
    Chain {
        topic: "/image_raw".into(),
        worker: worker(setup),
        outlets: vec![Outlet::replay(Box::new(sink))],
        num_topics: 9,
    }
}

fn run(setup: &Setup, inputs: Vec<Input>) -> (Result<Summary, RunError>, Vec<Outgoing>) {
    let kept = Arc::default();
    let memory = Memory { kept: Arc::clone(&kept), room: setup.room };
    let run = Run {
        source: &mut Listed(inputs.into_iter()),
        chains: vec![chain(setup, memory)],
        stop: &setup.stop,
        on_message: &mut |_| {},
    };
    let summary = run.replay();
    let kept = std::mem::take(&mut *kept.lock().unwrap());
    (summary, kept)
}

fn on(messages: &[Outgoing], output: Output) -> Vec<&Outgoing> {
    messages.iter().filter(|message| message.topic == output as usize).collect()
}

/// Every kind of fault between good frames.
fn faulty_stream() -> Vec<Input> {
    vec![
        good(1, 0),
        frame(2, 100, 100, |image| image.step = WIDTH - 1),
        good(3, 200),
        frame(4, 300, 200, |_| {}),
        frame(5, 400, 150, |_| {}),
        frame(6, 500, 500, |image| image.encoding = "yuv420".into()),
        message(7, 600, vec![0, 1, 0, 0, 9, 9]),
        // 8 and 9 are lost.
        good(10, 900),
        frame(11, 1000, 1000, |image| image.header.stamp = Time::default()),
        frame(12, 1100, 1100, |image| {
            (image.width, image.height, image.step) = (u32::MAX, u32::MAX, u32::MAX);
        }),
        frame(13, 1200, 1200, |image| {
            (image.width, image.height, image.step, image.data) = (0, 0, 0, &[]);
        }),
        Input::Damage("a chunk".into()),
        // Another size: the stream continues.
        frame(14, 1300, 1300, |image| {
            (image.height, image.data) = (HEIGHT / 2, &image.data[..(HEIGHT / 2 * WIDTH) as usize]);
        }),
        good(15, 1400),
    ]
}

#[test]
fn every_frame_is_counted_in_exactly_one_bin() {
    let (summary, messages) = run(&Setup::default(), faulty_stream());
    let summary = summary.unwrap();
    let counts = summary.counts;
    assert_eq!((counts.received, counts.processed), (13, 6));
    assert_eq!(counts.points, 6 * u64::from(WIDTH));
    assert_eq!((counts.malformed, counts.duplicate, counts.out_of_order), (5, 1, 1));
    assert_eq!(counts.received, counts.processed + counts.rejected() + counts.dropped_overload);
    assert_eq!((counts.lost(), summary.num_damaged), (2, 1));
    assert!(!summary.is_complete());
    assert_eq!(on(&messages, Output::Centerline).len(), 6, "one a good frame");
}

#[test]
fn a_result_repeats_its_frame_and_the_gap_before_it() {
    let (_, messages) = run(&Setup::default(), faulty_stream());
    let traces: Vec<_> = on(&messages, Output::Centerline)
        .iter()
        .map(|message| {
            let line: Centerline<'_> = cdr::decode(&message.data).unwrap();
            assert_eq!(line.header.frame_id, "optical");
            assert_eq!(line.trace.receive_stamp.to_ns(), message.log_time_ns);
            assert_eq!(line.u.len(), WIDTH as usize);
            assert!(line.v.iter().all(|v| (v - CENTER_ROW as f32).abs() < 1e-3), "{:?}", line.v);
            let stamp_ms = (line.header.stamp.to_ns() - START_NS) / MS;
            (line.trace.frame_number, line.trace.frames_missing, stamp_ms)
        })
        .collect();
    let zero_ms = -START_NS / MS;
    let expected =
        [(0, 0, 0), (2, 0, 200), (9, 2, 900), (10, 0, zero_ms), (13, 0, 1300), (14, 0, 1400)];
    assert_eq!(traces, expected);
}

#[test]
fn the_same_frames_give_the_same_bytes() {
    let setup = || Setup { calibrated: true, ..Setup::default() };
    let [first, second] = [(); 2].map(|()| run(&setup(), faulty_stream()).1);
    assert!(first.len() > 20);
    assert_eq!(first.len(), second.len());
    for (a, b) in first.iter().zip(&second) {
        assert_eq!((a.topic, a.log_time_ns, a.sequence), (b.topic, b.log_time_ns, b.sequence));
        assert_eq!(a.data, b.data, "topic {}", a.topic);
    }
}

#[test]
fn slices_account_for_every_frame() {
    let setup = Setup { calibrated: true, ..Setup::default() };
    let mut inputs: Vec<_> = (1..=10).map(|n| good(n, i64::from(n) * 100)).collect();
    inputs[6] = frame(7, 700, 700, |image| image.step = 1);
    inputs.remove(2);
    let (summary, messages) = run(&setup, inputs);
    let infos: Vec<SliceInfo<'_>> =
        on(&messages, Output::SliceInfo).iter().map(|m| cdr::decode(&m.data).unwrap()).collect();
    let sum = |part: fn(&SliceInfo<'_>) -> u32| infos.iter().map(part).sum::<u32>();
    assert_eq!(sum(|info| info.frames_accepted), 8);
    assert_eq!(sum(|info| info.frames_missing), 1);
    assert_eq!(sum(|info| info.frames_rejected), 1);
    assert_eq!(sum(|info| info.frames_expected), 10);
    assert_eq!(summary.unwrap().counts.slices, infos.len() as u64);
    assert!(infos.last().unwrap().last_slice);
    for output in [Output::Points, Output::PointsDense] {
        let clouds = on(&messages, output);
        let points = clouds.iter().map(|message| {
            let cloud: PointCloud2<'_> = cdr::decode(&message.data).unwrap();
            u64::from(cloud.width * cloud.height)
        });
        assert_eq!(points.sum::<u64>(), 8 * u64::from(WIDTH));
    }
    assert_eq!(on(&messages, Output::HeightMap).len(), 1);
    let profiles = on(&messages, Output::Profile);
    let profile: Profile<'_> = cdr::decode(&profiles[0].data).unwrap();
    assert_eq!((profile.valid_count, &*profile.header.frame_id), (WIDTH, "laser"));
    assert_eq!(profile.calibration_id, calibration().id());
}

#[test]
fn status_is_published_every_second_of_the_recording_and_at_the_end() {
    let inputs = (0..35).map(|n| good(n, i64::from(n) * 100)).collect();
    let (_, messages) = run(&Setup::default(), inputs);
    let reports = on(&messages, Output::StreamStatus);
    let times: Vec<_> = reports.iter().map(|m| (m.log_time_ns - START_NS) / MS).collect();
    assert_eq!(times, [1000, 2000, 3000, 3400]);
    let last: StreamStatus<'_> = cdr::decode(&reports[3].data).unwrap();
    assert_eq!((last.frames_received, last.frames_processed), (35, 35));
    assert!(last.latency_p50.is_nan(), "no wall clock in a replay");
    let first: StreamStatus<'_> = cdr::decode(&reports[0].data).unwrap();
    assert_eq!(first.header.stamp.to_ns(), reports[0].log_time_ns);
    let diagnostics: DiagnosticArray<'_> =
        cdr::decode(&on(&messages, Output::Diagnostics)[0].data).unwrap();
    assert_eq!(diagnostics.status[0].level, 0);

    let (_, messages) = run(&Setup::default(), faulty_stream());
    let report = &on(&messages, Output::StreamStatus)[0];
    assert_eq!((report.log_time_ns - START_NS) / MS, 100, "at the first fault");
    let diagnostics: DiagnosticArray<'_> =
        cdr::decode(&on(&messages, Output::Diagnostics)[0].data).unwrap();
    assert_eq!(diagnostics.status[0].level, 1);
}

#[test]
fn gaps_are_unknown_if_the_publisher_does_not_count() {
    let inputs = (0..3).map(|n| good(0, n * 100)).collect();
    let (summary, messages) = run(&Setup::default(), inputs);
    assert!(summary.unwrap().is_complete());
    for message in on(&messages, Output::Centerline) {
        let trace = cdr::decode::<Centerline<'_>>(&message.data).unwrap().trace;
        assert!(!trace.frames_missing_valid);
        assert_eq!(trace.frame_number_source, FrameTrace::SOURCE_HOST);
    }
}

#[test]
fn images_are_forwarded_unchanged() {
    let setup = Setup { sends_images: true, ..Setup::default() };
    let (_, messages) = run(&setup, vec![good(5, 0)]);
    let Input::Message(original, _) = good(5, 0) else { unreachable!() };
    let images: Vec<_> = messages.iter().filter(|message| message.topic == 9).collect();
    assert_eq!(images.len(), 1);
    assert_eq!((images[0].sequence, &*images[0].data), (5, &*original.data));
}

#[test]
fn a_full_sink_ends_the_run_with_an_error() {
    let setup = Setup { room: 5, ..Setup::default() };
    let inputs = (0..2000).map(|n| good(n, i64::from(n))).collect();
    let (summary, messages) = run(&setup, inputs);
    assert_eq!(summary.unwrap_err().to_string(), "memory: no space left");
    assert_eq!(messages.len(), 5, "accepted messages are kept");
}
