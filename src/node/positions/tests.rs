use std::{f64::consts::TAU, sync::Arc};

use super::*;
use crate::{
    bag::Topic,
    msg::{
        builtin_interfaces::Time,
        cdr,
        geometry_msgs::{Quaternion, Transform, TransformStamped, Vector3},
        laser_profiler_msgs::{EncoderStamped, FrameTrace},
        qos::QosProfile,
        schema::Message,
        sensor_msgs::JointState,
        std_msgs::Header,
        tf2_msgs::TFMessage,
    },
    scanner::motion::doubt,
};

const MS: i64 = 1_000_000;
/// 2020-01-01, so that times have a realistic magnitude.
const START_NS: i64 = 1_577_836_800_000_000_000;

fn raw<M: Message>(topic: &str, at_ms: i64, message: &M) -> RawMessage {
    let mut data = Vec::new();
    cdr::encode(message, &mut data).unwrap();
    let topic = Arc::new(Topic::new(topic, M::TYPE, QosProfile::best_effort(5)));
    let log_time_ns = START_NS + at_ms * MS;
    RawMessage { topic, log_time_ns, publish_time_ns: log_time_ns, sequence: 0, data, file: None }
}

fn header(at_ms: i64, frame_id: &str) -> Header<'_> {
    Header { stamp: Time::from_ns(START_NS + at_ms * MS), frame_id: frame_id.into() }
}

fn joint(at_ms: i64, names: &[&str], position: &[f64]) -> RawMessage {
    let name = names.iter().map(|&name| name.to_owned()).collect();
    let header = header(at_ms, "");
    let state = JointState { header, name, position: position.to_vec(), ..JointState::default() };
    raw("/joint_states", at_ms, &state)
}

fn encoder(at_ms: i64, counts: i64, edit: impl FnOnce(&mut EncoderStamped<'_>)) -> RawMessage {
    let mut sample = EncoderStamped {
        header: header(at_ms, ""),
        counts,
        scale: 1e-6,
        ..EncoderStamped::default()
    };
    edit(&mut sample);
    raw("/encoder", at_ms, &sample)
}

fn tf(topic: &str, at_ms: i64, parent: &str, child: &str, x: f64) -> RawMessage {
    let pose = TransformStamped {
        header: header(at_ms, parent),
        child_frame_id: child.into(),
        transform: Transform {
            translation: Vector3 { x, y: 0.0, z: 0.0 },
            rotation: Quaternion::default(),
        },
    };
    raw(topic, at_ms, &TFMessage { transforms: vec![pose] })
}

fn params(source: MotionSource) -> MotionParams {
    MotionParams { source, ..MotionParams::default() }
}

fn positions(params: &MotionParams, joint: &str) -> Positions {
    let moved = Moved {
        joint: joint.to_owned(),
        part_frame: "table".to_owned(),
        sensor_frame: String::new(),
    };
    Positions::new(params, &moved, AxisKind::Prismatic).unwrap()
}

/// Position and doubts of a frame at that time.
fn found(positions: &mut Positions, at_ms: i64) -> Option<(f64, u8)> {
    let stamp_ns = START_NS + at_ms * MS;
    positions.at(stamp_ns, stamp_ns).map(|position| (position.value.0, position.doubts))
}

#[test]
fn the_doubts_are_those_of_the_message() {
    assert_eq!(doubt::GAP, FrameTrace::ENCODER_GAP);
    assert_eq!(doubt::REVERSED, FrameTrace::ENCODER_REVERSED);
    assert_eq!(doubt::STALE, FrameTrace::ENCODER_STALE);
    assert_eq!(doubt::EXTRAPOLATED, FrameTrace::ENCODER_EXTRAPOLATED);
}

#[test]
fn a_joint_is_found_among_others_and_interpolated() {
    let params = MotionParams {
        scale: Some(0.5),
        exposure_offset_s: 0.002,
        ..params(MotionSource::JointState)
    };
    let mut positions = positions(&params, "table");
    positions.take(&joint(0, &["arm", "table"], &[7.0, 2.0]));
    positions.take(&joint(5, &["arm"], &[7.0]));
    positions.take(&joint(10, &["table", "arm"], &[4.0, 7.0]));
    assert!(positions.has_reached(START_NS + 8 * MS) && !positions.has_reached(START_NS + 9 * MS));
    assert_eq!(found(&mut positions, 3), Some((1.5, 0)), "at 5 ms, the middle of the exposure");
    assert_eq!(found(&mut positions, 8), Some((2.0, 0)));
    assert_eq!(found(&mut positions, 13), Some((2.5, doubt::EXTRAPOLATED)));
    assert_eq!(found(&mut positions, -5), None);
    assert_eq!(positions.num_refused(), 0, "the arm's own message is no fault");
}

#[test]
fn the_only_joint_needs_no_name() {
    let mut positions = positions(&params(MotionSource::JointState), "");
    positions.take(&joint(0, &["table"], &[1.0]));
    positions.take(&joint(10, &[], &[2.0]));
    assert_eq!(found(&mut positions, 5), Some((1.5, 0)));
    positions.take(&joint(20, &["arm"], &[3.0]));
    assert_eq!((positions.num_refused(), found(&mut positions, 10)), (1, Some((2.0, 0))));
}

#[test]
fn a_message_without_the_joint_is_refused_and_counted() {
    let bad: [(&str, RawMessage, &str); 7] = [
        ("short", joint(0, &["arm", "table"], &[7.0]), "1 positions for 2 names"),
        ("nan", joint(0, &["table"], &[f64::NAN]), "the position is NaN"),
        ("infinite", joint(0, &["table"], &[f64::INFINITY]), "the position is inf"),
        ("no stamp", joint(-START_NS / MS, &["table"], &[1.0]), "its stamp is 0"),
        ("twice", joint(100, &["table"], &[1.0]), "that of the sample before"),
        ("late", joint(90, &["table"], &[1.0]), "before that of an earlier sample"),
        ("foreign", encoder(110, 1, |_| {}), "not a sensor_msgs/msg/JointState"),
    ];
    for (name, message, reason) in bad {
        let mut positions = positions(&params(MotionSource::JointState), "table");
        positions.take(&joint(100, &["table"], &[1.0]));
        let error = positions.take_joint(&message).unwrap_err();
        assert!(error.contains(reason), "{name}: {error}");
        positions.take(&message);
        assert_eq!(
            (positions.num_refused(), found(&mut positions, 100)),
            (1, Some((1.0, 0))),
            "{name}"
        );
    }
    let mut positions = positions(&params(MotionSource::JointState), "table");
    let mut cut = joint(0, &["table"], &[1.0]);
    cut.data.truncate(30);
    positions.take(&cut);
    assert_eq!(positions.num_refused(), 1);
}

#[test]
fn a_missing_joint_is_reported_with_those_received() {
    let mut positions = positions(&params(MotionSource::JointState), "table");
    assert!(positions.why_no_sample().contains("no usable sample"));
    positions.take(&joint(0, &["arm", "lift"], &[1.0, 2.0]));
    assert_eq!(found(&mut positions, 0), None);
    let why = positions.why_no_sample();
    assert!(why.contains("\"table\"") && why.ends_with("arm, lift"), "{why}");
    for number in 0..100 {
        positions.take(&joint(0, &[&format!("j{number}")], &[1.0]));
    }
    assert_eq!(positions.joints.len(), MAX_NAMED, "and not all of them");
}

#[test]
fn a_turntable_angle_continues_over_its_wrap() {
    let moved = Moved { joint: "table".into(), ..Moved::default() };
    let mut positions =
        Positions::new(&params(MotionSource::JointState), &moved, AxisKind::Revolute).unwrap();
    for step in 0..20 {
        let angle_rad = (f64::from(step) * 0.5).rem_euclid(TAU);
        positions.take(&joint(i64::from(step) * 10, &["table"], &[angle_rad]));
    }
    for at_ms in 0..190 {
        let (angle_rad, doubts) = found(&mut positions, at_ms).unwrap();
        assert!(
            (angle_rad - at_ms as f64 * 0.05).abs() < 1e-9 && doubts == 0,
            "{at_ms}: {angle_rad}"
        );
    }
}

#[test]
fn the_largest_step_is_compared_after_the_scale_of_the_axis() {
    // A joint in millimetres, against the direction of the axis.
    let axis = Axis {
        kind: AxisKind::Prismatic,
        point_m: nalgebra::Point3::origin(),
        direction: nalgebra::Vector3::x_axis(),
        scale: -1e-3,
    };
    let params = MotionParams { max_step: Some(0.01), ..params(MotionSource::JointState) };
    let mut positions = Positions { axis: Some(axis), ..positions(&params, "table") };
    for (at_ms, position) in [(0, 100.0), (10, 109.0), (20, 120.0)] {
        positions.take(&joint(at_ms, &["table"], &[position]));
    }
    assert_eq!(found(&mut positions, 5), Some((104.5, 0)), "9 mm, given as stated");
    assert_eq!(found(&mut positions, 15), Some((114.5, doubt::GAP)), "11 mm");
}

#[test]
fn an_encoder_counts_over_its_wrap() {
    let params = MotionParams { encoder_bits: Some(16), ..params(MotionSource::Encoder) };
    let mut positions = positions(&params, "");
    for (number, counts) in [65_000, 65_500, 464, 964].into_iter().enumerate() {
        positions.take(&encoder(number as i64 * 10, counts, |_| {}));
    }
    let position = positions.at(START_NS + 15 * MS, START_NS + 15 * MS).unwrap();
    assert_eq!((position.counts, position.doubts, position.is_exact), (65_750, 0, false));
    assert!((position.value.0 - 0.065_750).abs() < 1e-12);
    assert!(positions.at(START_NS + 20 * MS, START_NS + 20 * MS).unwrap().is_exact);
}

#[test]
fn samples_with_encoder_errors_are_refused() {
    let mut positions = positions(&params(MotionSource::Encoder), "");
    positions.take(&encoder(0, 0, |_| {}));
    for (message, reason) in [
        (encoder(10, 10, |sample| sample.error = 0x12), "error bits 0x12"),
        (encoder(10, 10, |sample| sample.scale = 0.0), "set motion.scale"),
        (encoder(10, 10, |sample| sample.scale = f64::NAN), "scale is NaN"),
        (encoder(10, 10, |sample| sample.scale = 2e-6), "was 0.000001 before"),
    ] {
        let error = positions.take_encoder(&message).unwrap_err();
        assert!(error.contains(reason), "{error}");
    }
    let mut scaled =
        self::positions(&MotionParams { scale: Some(0.5), ..params(MotionSource::Encoder) }, "");
    scaled.take(&encoder(0, 3, |sample| sample.scale = 0.0));
    assert_eq!(found(&mut scaled, 0), Some((1.5, 0)));
}

#[test]
fn poses_are_looked_up_at_the_stamp() {
    let mut positions = positions(&params(MotionSource::Tf), "");
    positions.set_camera_frame("optical");
    assert_eq!((found(&mut positions, 0), positions.timeout_ns()), (None, None));
    positions.take(&tf("/tf_static", 0, "carriage", "optical", 1.0));
    for number in 0..4 {
        positions.take(&tf("/tf", number * 10, "table", "carriage", number as f64));
    }
    assert_eq!(positions.timeout_ns(), Some(MIN_TIMEOUT_NS));
    let at = |positions: &mut Positions, at_ms: i64| {
        let position = positions.at(START_NS + at_ms * MS, START_NS + at_ms * MS)?;
        Some((position.part_from_sensor?.translation.x, position.doubts))
    };
    assert_eq!(at(&mut positions, 15), Some((2.5, 0)));
    assert_eq!(at(&mut positions, 35), Some((4.5, doubt::EXTRAPOLATED)));
    assert_eq!(at(&mut positions, 200), None);
    positions.take(&tf("/tf", 50, "table", "table", 0.0));
    assert_eq!(positions.num_refused(), 1);
    positions.restart();
    assert_eq!(at(&mut positions, 15), None, "another recording, but the mount is the same");
}

#[test]
fn a_sample_that_arrives_too_late_is_reported_once() {
    let mut positions = positions(&params(MotionSource::JointState), "table");
    for at_ms in [0, 10, 20] {
        positions.take(&joint(at_ms, &["table"], &[1.0]));
    }
    assert_eq!(found(&mut positions, 25), Some((1.0, doubt::EXTRAPOLATED)));
    assert_eq!(positions.given_up, Some((START_NS + 25 * MS, START_NS + 25 * MS)));
    positions.take(&joint(24, &["table"], &[1.0]));
    assert!(!positions.has_warned_late);
    positions.take(&joint(30, &["table"], &[1.0]));
    assert!(positions.has_warned_late && positions.given_up.is_none());
}

#[test]
fn changed_parameters_discard_earlier_samples() {
    let mut positions = positions(&params(MotionSource::JointState), "table");
    positions.take(&joint(0, &["table"], &[1.0]));
    positions.reconfigure(&params(MotionSource::JointState));
    assert_eq!(found(&mut positions, 0), Some((1.0, 0)), "nothing has changed");
    positions.reconfigure(&MotionParams { scale: Some(2.0), ..params(MotionSource::JointState) });
    assert_eq!(found(&mut positions, 0), None);
    positions.take(&joint(0, &["table"], &[1.0]));
    assert_eq!(found(&mut positions, 0), Some((2.0, 0)));
}

#[test]
fn an_axis_that_the_calibration_does_not_have_is_refused() {
    let calibration = crate::node::tests::calibration();
    let of = |axis, calibration| {
        axis_kind(&MotionParams { axis, ..MotionParams::default() }, calibration)
    };
    assert_eq!(of(AxisChoice::Auto, Some(&calibration)), Ok(AxisKind::Prismatic));
    assert_eq!(of(AxisChoice::Prismatic, Some(&calibration)), Ok(AxisKind::Prismatic));
    assert_eq!(of(AxisChoice::Revolute, Some(&calibration)), Err(AxisError::NoAxis));
    assert_eq!(of(AxisChoice::Revolute, None), Ok(AxisKind::Revolute), "centrelines only");
}
