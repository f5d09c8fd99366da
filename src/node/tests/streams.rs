//! Tests unusual streams: too fast, in several recordings, with counters at their limits.

use std::thread;

use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

use super::*;
use crate::msg::sensor_msgs::CompressedImage;
use crate::node::{
    fan_out::FanOut,
    publisher::Publisher,
    queue::{Bound, Queue, WhenFull},
    statistics::Counts,
    status::{Interval, Load, Note, State},
};

/// Runs a worker on frames that arrive faster than it processes them.
fn overrun(inputs: Vec<Input>) -> (Counts, Vec<Outgoing>) {
    let kept = Arc::default();
    let sink = Box::new(Memory { kept: Arc::clone(&kept), room: usize::MAX });
    let (input, spare) = (live_queue(3), live_queue(3));
    for item in inputs {
        input.push(item, 1).unwrap();
    }
    input.close();
    let setup = Setup { calibrated: true, ..Setup::default() };
    let (counts, _) = thread::scope(|scope| {
        let fan_out = FanOut::start(scope, vec![Outlet::replay(sink)], 9);
        let worked = worker(&setup).run(&input, &spare, &mut Publisher::new(&fan_out, 9)).unwrap();
        fan_out.finish().unwrap();
        worked
    });
    let kept = std::mem::take(&mut *kept.lock().unwrap());
    (counts, kept)
}

fn live_queue<T>(items: usize) -> Queue<T> {
    Queue::new(Bound { items, bytes: 1 << 20 }, WhenFull::DropOldest)
}

fn lines(messages: &[Outgoing]) -> Vec<FrameTrace> {
    let decode = |message: &&Outgoing| cdr::decode::<Centerline<'_>>(&message.data).unwrap().trace;
    on(messages, Output::Centerline).iter().map(decode).collect()
}

#[test]
fn frames_dropped_by_a_full_queue_are_counted_but_not_as_lost() {
    // Frame 4 never arrived; 1, 2, 3, 5 and 6 are dropped; 7 is malformed; 8 and 9 are measured.
    let mut inputs: Vec<_> = [1, 2, 3, 5, 6].map(|n| good(n, i64::from(n) * 10)).into();
    inputs.push(frame(7, 70, 70, |image| image.step = 1));
    inputs.extend([8, 9].map(|n| good(n, i64::from(n) * 10)));
    let (counts, messages) = overrun(inputs);
    assert_eq!((counts.received, counts.processed), (8, 2));
    assert_eq!((counts.dropped_overload, counts.malformed), (5, 1));
    assert_eq!(counts.received, counts.processed + counts.rejected() + counts.dropped_overload);
    assert_eq!(counts.lost(), 0, "the counter before frame 7 was not read");
    assert!(!counts.is_complete());
    let infos = on(&messages, Output::SliceInfo);
    let info: SliceInfo<'_> = cdr::decode(&infos[0].data).unwrap();
    assert_eq!((info.frames_accepted, info.frames_rejected, info.frames_expected), (2, 6, 8));
    let numbers: Vec<_> = lines(&messages).iter().map(|trace| trace.frame_number).collect();
    assert_eq!(numbers, [6, 7]);
    let reports = on(&messages, Output::StreamStatus);
    let status: StreamStatus<'_> = cdr::decode(&reports.last().unwrap().data).unwrap();
    assert_eq!((status.dropped_overload, status.rejected_malformed), (5, 1));
}

/// Counters that all differ.
fn counted() -> Counts {
    Counts {
        received: 1,
        processed: 2,
        dropped_overload: 3,
        malformed: 4,
        duplicate: 5,
        out_of_order: 6,
        lost_transport: 7,
        slices: 8,
        recorder_dropped: 9,
        recorder_bytes: 10,
        unpublished: 11,
        unpaired: 12,
        flooded: 13,
        unlocated: 14,
        doubtful: 15,
        positions_refused: 16,
        outside_calibration: 17,
        standing: 18,
        points: 20,
        saturated: 19,
        not_of_now: 22,
        begun_again: 23,
        ..Counts::default()
    }
}

fn reporter() -> Reporter {
    Reporter {
        node: "/cell/top".into(),
        camera: "left".into(),
        topic: "/image_raw".into(),
        queue_capacity: 4,
        session_id: [7; 16],
    }
}

#[test]
fn every_counter_reaches_its_field_of_the_status() {
    let mut counts = counted();
    counts.no_stripe.frames = 21;
    counts.texture_px.extend(Some(0.033));
    let note = |level, text: &str| Note { level, key: "disk", text: text.to_owned() };
    let state = State {
        counts,
        interval: Interval { rate_hz: 12.5, has_faults: true, stands: false, lacks_stripe: false },
        load: Load::default(),
        notes: vec![note(0, "roomy"), note(2, "full")],
        last_rejection: Some("odd".to_owned()),
        channel: Some("green"),
    };
    let reporter = reporter();
    let status = reporter.stream_status(5, &state);
    let fields = [
        status.frames_received,
        status.frames_processed,
        status.dropped_overload,
        status.rejected_malformed,
        status.rejected_duplicate,
        status.rejected_out_of_order,
        status.lost_transport,
        status.recorder_dropped,
        status.recorder_bytes,
    ];
    assert_eq!(fields, [1, 2, 3, 4, 5, 6, 7, 9, 10]);
    let diagnostics = reporter.diagnostics(5, &state);
    let state = &diagnostics.status[0];
    assert_eq!((state.level, &*state.name), (2, "cell/top: left stream"));
    assert_eq!(state.message, "frames were lost, dropped or rejected; full");
    let values: Vec<_> = state.values.iter().map(|pair| (&*pair.key, &*pair.value)).collect();
    let expected = [
        ("input topic", "/image_raw"),
        ("rate [Hz]", "12.500"),
        ("latency, median [ms]", "none"),
        ("latency, 99th percentile [ms]", "none"),
        ("frames with stamps that are not of now", "22"),
        ("stamps begun again", "23"),
        ("frames received", "1"),
        ("frames processed", "2"),
        ("frames lost in transport", "7"),
        ("frames dropped by overload", "3"),
        ("frames rejected as malformed", "4"),
        ("frames rejected as duplicate", "5"),
        ("frames rejected as out of order", "6"),
        ("results not published", "11"),
        ("results not recorded", "9"),
        ("slices", "8"),
        ("frames without their other exposure", "12"),
        ("frames too bright for the threshold", "13"),
        ("frames without a stripe", "21"),
        ("points", "20"),
        ("points saturated", "19"),
        ("median sigma from noise [px]", "none"),
        ("median sigma from texture [px]", "0.0332"),
        ("points outside the calibrated volume", "17"),
        ("frames without a position", "14"),
        ("frames with a doubtful position", "15"),
        ("positions refused", "16"),
        ("profiles at the place of the one before", "18"),
        ("channel auto", "green"),
        ("last rejection", "odd"),
        ("disk", "roomy"),
        ("disk", "full"),
    ];
    assert_eq!(values, expected);
}

#[test]
fn every_recording_starts_a_new_scan() {
    let setup = Setup { calibrated: true, ..Setup::default() };
    for later_ms in [-1000, 0, 1_000_000] {
        let mut inputs = vec![good(8, 500), good(9, 600), Input::NewRecording];
        inputs.extend([1, 2].map(|n| good(n, 500 + later_ms + i64::from(n) * 100)));
        let (summary, messages) = run(&setup, inputs);
        assert!(summary.unwrap().is_complete(), "{later_ms}");
        let traces = lines(&messages);
        let numbers: Vec<_> = traces.iter().map(|trace| trace.frame_number).collect();
        assert_eq!(numbers, [0, 1, 2, 3]);
        assert!(!traces[2].frames_missing_valid, "the gap between is unknown");
        let maps = on(&messages, Output::HeightMap);
        assert_eq!(maps.len(), 2, "{later_ms}");
        assert_eq!(maps[0].log_time_ns, START_NS + 600 * MS);
        assert_eq!(on(&messages, Output::SliceInfo).len(), 2);
    }
}

#[test]
fn a_steady_stream_has_its_rate_from_the_first_second_on() {
    let inputs = (0..=20).map(|n| good(n, i64::from(n) * 100)).collect();
    let (_, messages) = run(&Setup::default(), inputs);
    for message in &on(&messages, Output::StreamStatus)[..2] {
        let status: StreamStatus<'_> = cdr::decode(&message.data).unwrap();
        assert!((status.rate - 10.0).abs() < 1e-5, "{}", status.rate);
    }
}

#[test]
fn a_gap_is_unknown_until_a_frame_follows_a_good_one() {
    let bad = frame(1, 0, 0, |image| image.step = 1);
    let (_, messages) = run(&Setup::default(), vec![bad, good(2, 100), good(4, 200)]);
    let known: Vec<_> = lines(&messages)
        .iter()
        .map(|trace| (trace.frames_missing_valid, trace.frames_missing))
        .collect();
    assert_eq!(known, [(false, 0), (true, 1)]);
}

#[test]
fn positions_follow_the_frame_numbers() {
    let (_, messages) = run(&Setup::default(), vec![good(1, 0), good(2, 100), good(6, 500)]);
    let positions = lines(&messages).into_iter().map(|trace| (trace.position * 1e3).round());
    assert!(positions.eq([0.0, 1.0, 5.0]), "a millimetre a frame, lost ones counted");
}

#[test]
fn an_image_larger_than_allowed_is_rejected() {
    let bytes = u64::from(WIDTH * HEIGHT);
    for (max_frame_bytes, processed) in [(bytes, 2), (bytes - 1, 0)] {
        let setup = Setup { max_frame_bytes, ..Setup::default() };
        let (summary, _) = run(&setup, vec![good(1, 0), good(2, 100)]);
        let counts = summary.unwrap().counts;
        assert_eq!((counts.processed, counts.malformed), (processed, 2 - processed));
    }
}

#[test]
fn counters_at_their_limits_are_handled() {
    let at = |sequence: u32, log_time_ns: i64, sec: i32, nanosec: u32| {
        let input = frame(sequence, 0, 0, |image| image.header.stamp = Time { sec, nanosec });
        let Input::Message(mut message, writer) = input else { unreachable!() };
        (message.log_time_ns, message.publish_time_ns) = (log_time_ns, log_time_ns);
        Input::Message(message, writer)
    };
    let setup = Setup { calibrated: true, ..Setup::default() };
    let inputs = vec![
        at(u32::MAX, i64::MAX, i32::MIN, 0),
        at(0, 0, i32::MAX, u32::MAX),
        at(u32::MAX, i64::MAX, i32::MIN, u32::MAX),
        at(u32::MAX - 1, i64::MIN, 0, 0),
        at(0, 1, -1, u32::MAX),
    ];
    let (summary, messages) = run(&setup, inputs);
    let counts = summary.unwrap().counts;
    assert_eq!((counts.received, counts.processed + counts.rejected()), (5, 5));
    assert_eq!(on(&messages, Output::Centerline).len() as u64, counts.processed);
}

/// A source or sink that yields to other threads a given number of times, to vary the thread timing.
struct Yielding<T>(T, u32);

impl<T> Yielding<T> {
    fn yield_now(&self) {
        (0..self.1).for_each(|_| thread::yield_now());
    }
}

impl Source for Yielding<Listed> {
    fn next(&mut self) -> Option<Input> {
        self.yield_now();
        self.0.next()
    }
}

impl Sink for Yielding<Memory> {
    fn write(&mut self, message: &Outgoing) -> Result<(), SinkError> {
        self.yield_now();
        self.0.write(message)
    }

    fn finish(&mut self) -> Result<(), SinkError> {
        self.0.finish()
    }
}

#[test]
fn a_slow_source_or_sink_does_not_change_a_byte() {
    let setup = Setup { calibrated: true, ..Setup::default() };
    let stream = || {
        let mut inputs = faulty_stream();
        inputs.push(Input::NewRecording);
        inputs.extend((1..60).map(|n| good(n, 2000 + i64::from(n) * 40)));
        inputs
    };
    let run = |source_yields, sink_yields| {
        let kept = Arc::default();
        let memory = Memory { kept: Arc::clone(&kept), room: usize::MAX };
        let run = Run {
            source: &mut Yielding(Listed(stream().into_iter()), source_yields),
            chains: vec![chain(&setup, Yielding(memory, sink_yields))],
            stop: &setup.stop,
            on_message: &mut |_| {},
        };
        run.replay().unwrap();
        let kept = std::mem::take(&mut *kept.lock().unwrap());
        kept.into_iter().map(|m| (m.topic, m.log_time_ns, m.sequence, m.data)).collect::<Vec<_>>()
    };
    let first = run(0, 0);
    assert!(first.len() > 200);
    assert!(first == run(200, 0) && first == run(0, 200));
}

#[test]
fn a_raised_stop_ends_the_input_and_keeps_the_results() {
    struct Stopping(Listed, Stop);
    impl Source for Stopping {
        fn next(&mut self) -> Option<Input> {
            if self.0.0.len() == 7 {
                self.1.raise();
            }
            self.0.next()
        }
    }
    let setup = Setup::default();
    let inputs: Vec<_> = (0..10).map(|n| good(n, i64::from(n))).collect();
    let kept = Arc::default();
    let summary = Run {
        source: &mut Stopping(Listed(inputs.into_iter()), setup.stop.clone()),
        chains: vec![chain(&setup, Memory { kept: Arc::clone(&kept), room: usize::MAX })],
        stop: &setup.stop,
        on_message: &mut |_| {},
    }
    .replay()
    .unwrap();
    assert!(summary.was_interrupted && !summary.is_complete());
    assert_eq!(summary.counts.processed, 4);
    assert_eq!(on(&kept.lock().unwrap(), Output::Centerline).len(), 4);
}

/// The frame as a PNG file in a message, after `edit`.
fn packed(number: u32, edit: impl FnOnce(&mut Vec<u8>)) -> Input {
    let mut file = Vec::new();
    PngEncoder::new(&mut file)
        .write_image(&picture(), WIDTH, HEIGHT, ExtendedColorType::L8)
        .unwrap();
    edit(&mut file);
    let at_ms = i64::from(number) * 10;
    let stamp = Time::from_ns(START_NS + at_ms * MS);
    let header = Header { stamp, frame_id: "optical".into() };
    let image = CompressedImage { header, format: "mono8; png compressed ".into(), data: &file };
    let mut data = Vec::new();
    cdr::encode(&image, &mut data).unwrap();
    message(number, at_ms, data)
}

#[test]
fn frames_decompressed_ahead_equal_uncompressed_ones() {
    let is_damaged = |number: u32| number % 7 == 3;
    let unpacked = (1..60).map(|number| {
        let edit = |image: &mut Image<'_>| image.step -= u32::from(is_damaged(number));
        let at_ms = i64::from(number) * 10;
        frame(number, at_ms, at_ms, edit)
    });
    let damage = |number, file: &mut Vec<u8>| {
        if is_damaged(number) {
            file.truncate(40);
        }
    };
    let packed = (1..60).map(|number| packed(number, |file| damage(number, file)));
    let raw = Setup { calibrated: true, ..Setup::default() };
    let compressed =
        Setup { calibrated: true, transport: ImageTransport::Compressed, ..Setup::default() };
    let (summary, expected) = run(&raw, unpacked.collect());
    let (again, found) = run(&compressed, packed.collect());
    let (summary, again) = (summary.unwrap(), again.unwrap());
    assert_eq!((summary.counts.processed, summary.counts.malformed), (50, 9));
    assert_eq!((again.counts.processed, again.counts.malformed), (50, 9));
    for output in [Output::Centerline, Output::Profile, Output::Points, Output::SliceInfo] {
        let bytes = |messages| -> Vec<_> {
            on(messages, output)
                .into_iter()
                .map(|m| (m.log_time_ns, m.sequence, &*m.data))
                .collect()
        };
        assert!(bytes(&expected).len() > 5 && bytes(&expected) == bytes(&found), "{output:?}");
    }
}
