//! Tests frames with measured positions: they wait for samples and report the outcome.

use proptest::prelude::*;

use super::{
    Setup, good, message, on, run, {MS, START_NS},
};
use crate::{
    bag::Topic,
    msg::{
        builtin_interfaces::Time,
        cdr,
        laser_profiler_msgs::{Centerline, EncoderStamped, FrameTrace, Profile, SliceInfo},
        qos::QosProfile,
        schema::Message,
        sensor_msgs::JointState,
        std_msgs::Header,
    },
    node::{
        sink::Outgoing,
        source::{Input, PublisherId},
        statistics::Summary,
        topics::Output,
    },
    ros::value::Value,
};

fn text(value: &str) -> Value {
    Value::Text(value.to_owned())
}

fn setup(values: &[(&'static str, Value)]) -> Setup {
    let source = ("motion.source", text("joint_state"));
    let values = std::iter::once(source).chain(values.iter().cloned()).collect();
    Setup { calibrated: true, values, ..Setup::default() }
}

/// A message received `late_ms` after its stamp.
fn about<M: Message>(topic: &str, at_ms: i64, late_ms: i64, content: &M) -> Input {
    let mut data = Vec::new();
    cdr::encode(content, &mut data).unwrap();
    let Input::Message(mut raw, _) = message(0, at_ms + late_ms, data) else { unreachable!() };
    raw.topic = Topic::new(topic, M::TYPE, QosProfile::reliable(10)).into();
    Input::Message(raw, PublisherId::default())
}

fn header(at_ms: i64) -> Header<'static> {
    Header { stamp: Time::from_ns(START_NS + at_ms * MS), frame_id: "".into() }
}

/// A sample of an axis that moves one millimetre in 100 ms.
fn joint(at_ms: i64, late_ms: i64) -> Input {
    let (name, position) = (vec!["axis".to_owned()], vec![at_ms as f64 * 1e-5]);
    let state = JointState { header: header(at_ms), name, position, ..JointState::default() };
    about("/joint_states", at_ms, late_ms, &state)
}

fn log_time_ns(input: &Input) -> i64 {
    let Input::Message(message, _) = input else { unreachable!() };
    message.log_time_ns
}

/// Sorts inputs by log time, as in a recording.
fn sorted(mut inputs: Vec<Input>) -> Vec<Input> {
    inputs.sort_by_key(log_time_ns);
    inputs
}

fn traces(messages: &[Outgoing]) -> Vec<FrameTrace> {
    let trace = |message: &&Outgoing| cdr::decode::<Centerline<'_>>(&message.data).unwrap().trace;
    on(messages, Output::Centerline).iter().map(trace).collect()
}

fn infos(messages: &[Outgoing]) -> Vec<SliceInfo<'_>> {
    on(messages, Output::SliceInfo).iter().map(|m| cdr::decode(&m.data).unwrap()).collect()
}

fn measured(setup: &Setup, inputs: Vec<Input>) -> (Summary, Vec<Outgoing>) {
    let (summary, messages) = run(setup, inputs);
    (summary.unwrap(), messages)
}

/// Frames every 100 ms and samples every 30 ms that arrive `late_ms` late; none after the last frame.
fn stream(num_frames: i64, late_ms: i64) -> Vec<Input> {
    let frames = (0..num_frames).map(|number| good(number as u32 + 1, number * 100));
    let samples = (-1..num_frames * 100 / 30 - 3).map(|number| joint(number * 30, late_ms));
    sorted(frames.chain(samples).collect())
}

#[test]
fn frames_wait_for_the_sample_after_them() {
    for late_ms in [0, 5, 80, 250] {
        let (summary, messages) = measured(&setup(&[]), stream(12, late_ms));
        let traces = traces(&messages);
        assert_eq!(traces.len(), 12);
        for (number, trace) in traces.iter().enumerate() {
            assert!((trace.position - number as f64 * 1e-3).abs() < 1e-12, "{trace:?}");
            let is_last = number == 11;
            let is_exact = number % 3 == 0;
            let source = if is_exact { FrameTrace::SOURCE_DEVICE } else { FrameTrace::SOURCE_HOST };
            let status = if is_last { FrameTrace::ENCODER_EXTRAPOLATED } else { 0 };
            assert_eq!((trace.encoder_source, trace.encoder_status), (source, status), "{number}");
        }
        let states: Vec<_> = infos(&messages).iter().map(|info| info.state).collect();
        let expected = [SliceInfo::COMPLETE, SliceInfo::COMPLETE, SliceInfo::DEGRADED];
        assert_eq!(states, expected, "the last frame's sample is not in the recording");
        let counts = summary.counts;
        assert_eq!((counts.located, counts.unlocated, counts.doubtful), (12, 0, 1));
        assert!(summary.is_complete());
    }
}

#[test]
fn a_frame_without_a_position_is_published_and_counted_but_not_scanned() {
    // Positions are unknown before 95 ms and after 500 ms.
    let frames = (0..12).map(|number| good(number + 1, i64::from(number) * 100));
    let samples = (0..28).map(|number| joint(95 + number * 15, 0));
    let inputs = sorted(frames.chain(samples).collect());
    let (summary, messages) = measured(&setup(&[]), inputs);
    let counts = summary.counts;
    assert_eq!((counts.processed, counts.located, counts.unlocated), (12, 5, 7));
    assert!(!summary.is_complete(), "exit code 3");
    let profiles = on(&messages, Output::Profile);
    assert_eq!(profiles.len(), 12);
    let first: Profile<'_> = cdr::decode(&profiles[0].data).unwrap();
    assert!(first.valid_count > 0);
    assert_eq!(
        (first.trace.encoder_source, first.trace.encoder_status),
        (FrameTrace::SOURCE_NONE, FrameTrace::ENCODER_STALE)
    );
    let infos = infos(&messages);
    let sum = |part: fn(&SliceInfo<'_>) -> u32| infos.iter().map(part).sum::<u32>();
    assert_eq!((sum(|info| info.frames_accepted), sum(|info| info.frames_rejected)), (5, 7));
    assert_eq!((infos[0].first_frame, infos.last().unwrap().last_frame), (0, 11));
    assert!(infos.iter().all(|info| info.state >= SliceInfo::GAPS));
}

#[test]
fn without_any_position_there_is_no_scan() {
    let inputs = (0..5).map(|number| good(number + 1, i64::from(number) * 100)).collect();
    let (summary, messages) = measured(&setup(&[]), inputs);
    assert_eq!((summary.counts.processed, summary.counts.unlocated), (5, 5));
    assert!(infos(&messages).is_empty(), "there is no scan of frames without position");
    assert_eq!(traces(&messages).len(), 5);
}

#[test]
fn frames_do_not_wait_forever() {
    // Frames continue while the axis stops: its last samples give their positions at first, then none are known.
    for max_wait in [1, 3, 1000] {
        let setup = setup(&[("motion.max_wait", Value::Integer(max_wait))]);
        let samples = (0..10).map(|number| joint(number * 10, 0));
        let frames = (0..20).map(|number| good(number + 1, i64::from(number) * 100));
        let mut inputs = sorted(frames.chain(samples).collect());
        // A sample after every frame was released has no effect.
        inputs.push(joint(10_000, 0));
        let (summary, messages) = measured(&setup, inputs);
        assert_eq!(summary.counts.processed, 20, "{max_wait}");
        let seen: Vec<_> = traces(&messages).iter().map(|trace| trace.encoder_status).collect();
        assert_eq!(seen[..2], [0, FrameTrace::ENCODER_EXTRAPOLATED], "40 ms are no gap");
        assert!(seen[2..].iter().all(|status| *status == FrameTrace::ENCODER_STALE), "110 ms are");
    }
}

#[test]
fn an_axis_that_turns_back_is_flagged_until_it_is_ahead_again() {
    let frames = (0..8).map(|number| good(number + 1, i64::from(number) * 100));
    let places_mm = [0.0, 1.0, 2.0, 1.5, 1.0, 2.5, 3.5, 4.5];
    let samples = places_mm.iter().zip(0..).map(|(place_mm, number)| {
        let header = header(number * 100);
        let state = JointState {
            header,
            name: vec!["axis".into()],
            position: vec![place_mm * 1e-3],
            ..JointState::default()
        };
        about("/joint_states", number * 100, 0, &state)
    });
    let (summary, messages) = measured(&setup(&[]), sorted(frames.chain(samples).collect()));
    let statuses: Vec<_> = traces(&messages).iter().map(|trace| trace.encoder_status).collect();
    let reversed = FrameTrace::ENCODER_REVERSED;
    assert_eq!(statuses, [0, 0, 0, reversed, reversed, 0, 0, 0]);
    assert_eq!(summary.counts.doubtful, 2);
    let states: Vec<_> = infos(&messages).iter().map(|info| info.state).collect();
    assert_eq!(states, [SliceInfo::DEGRADED, SliceInfo::DEGRADED]);
}

#[test]
fn counts_and_positions_of_an_encoder_are_in_every_trace() {
    let values = [("motion.source", text("encoder")), ("motion.encoder_bits", Value::Integer(8))];
    let setup = Setup { calibrated: true, values: values.to_vec(), ..Setup::default() };
    let frames = (0..6).map(|number| good(number + 1, i64::from(number) * 100));
    let samples = (0..60).map(|number| {
        let (header, counts) = (header(number * 10), number * 20 % 256);
        let sample = EncoderStamped { header, counts, scale: 1e-5, ..EncoderStamped::default() };
        about("/encoder", number * 10, 3, &sample)
    });
    let (summary, messages) = measured(&setup, sorted(frames.chain(samples).collect()));
    let seen: Vec<_> =
        traces(&messages).iter().map(|trace| (trace.encoder, trace.encoder_status)).collect();
    assert_eq!(seen, [(0, 0), (200, 0), (400, 0), (600, 0), (800, 0), (1000, 0)]);
    assert!((traces(&messages)[5].position - 0.01).abs() < 1e-12);
    assert!(summary.is_complete());
}

#[test]
fn positions_are_forwarded_with_the_images() {
    let setup = Setup { sends_images: true, ..setup(&[]) };
    let (_, messages) = measured(&setup, stream(3, 0));
    let of = |topic: usize| messages.iter().filter(|message| message.topic == topic).count();
    assert_eq!((of(9), of(10), of(11)), (3, 8, 0), "images, joints, no encoder");
}

#[test]
fn a_malformed_frame_keeps_its_place_in_the_queue() {
    let mut inputs = stream(6, 50);
    let at = inputs.iter().position(|input| log_time_ns(input) == START_NS + 300 * MS).unwrap();
    let Input::Message(broken, _) = &mut inputs[at] else { unreachable!() };
    broken.data.truncate(20);
    let (summary, messages) = measured(&setup(&[]), inputs);
    assert_eq!((summary.counts.processed, summary.counts.malformed), (5, 1));
    let numbers: Vec<_> = traces(&messages).iter().map(|trace| trace.frame_number).collect();
    assert_eq!(numbers, [0, 1, 2, 4, 5]);
    assert_eq!(infos(&messages).iter().map(|info| info.frames_rejected).sum::<u32>(), 1);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    /// The delay of samples does not change a byte as long as frames wait for them.
    #[test]
    fn the_delay_of_samples_does_not_matter(lateness_ms in prop::collection::vec(0..300_i64, 40)) {
        let frames = || (0..10).map(|number| good(number + 1, i64::from(number) * 100));
        let on_time = (-1..38).map(|number| joint(number * 30, 0));
        // Samples stay in order: a network keeps the order of a topic.
        let mut received_ms = i64::MIN;
        let late = (-1..38).map(|number| {
            received_ms = received_ms.max(number * 30 + lateness_ms[(number + 1) as usize]);
            joint(number * 30, received_ms - number * 30)
        });
        let expected = measured(&setup(&[]), sorted(frames().chain(on_time).collect())).1;
        let found = measured(&setup(&[]), sorted(frames().chain(late).collect())).1;
        let content = |messages: &[Outgoing]| -> Vec<_> {
            let is_report = |topic| topic == Output::Diagnostics as usize || topic == Output::StreamStatus as usize;
            messages.iter().filter(|m| !is_report(m.topic)).map(|m| (m.topic, m.log_time_ns, m.data.clone())).collect()
        };
        prop_assert!(content(&expected) == content(&found));
    }
}
