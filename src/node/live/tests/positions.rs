//! Tests positions live: samples on their own topic, frames that wait for them, and the same results in a replay.

use super::{
    driver::{MS, START_NS, encoded},
    replayed::{replayed, same},
    rig::{Rig, Setup, text},
    stream::counts,
};
use crate::{
    msg::{
        builtin_interfaces::Time,
        cdr,
        laser_profiler_msgs::{Centerline, FrameTrace, SliceInfo},
        sensor_msgs::JointState,
        std_msgs::Header,
    },
    ros::{
        transport::{Arrival, Fault},
        value::Value,
    },
};

fn setup() -> Setup {
    Setup::new()
        .with("motion.source", text("joint_state"))
        .with("motion.step", Value::Float(0.0))
        .with("motion.joint", text("table"))
}

/// Publishes a sample of that time, received at once: a millimetre in 10 ms.
fn publish_sample(rig: &Rig, at_ms: i64) {
    let header = Header { stamp: Time::from_ns(START_NS + at_ms * MS), frame_id: "".into() };
    let state = JointState {
        header,
        name: vec!["lift".into(), "table".into()],
        position: vec![9.0, at_ms as f64 * 1e-4],
        ..JointState::default()
    };
    let time_ns = START_NS + at_ms * MS;
    rig.network.deliver(
        "/joint_states",
        &Ok(Arrival {
            data: encoded(&state),
            publisher: [3; 16],
            sequence: Some(at_ms),
            source_time_ns: time_ns,
            receive_time_ns: time_ns,
        }),
    );
}

fn traces(rig: &Rig, num: usize) -> Vec<FrameTrace> {
    let trace =
        |received: &super::Received| cdr::decode::<Centerline<'_>>(&received.data).unwrap().trace;
    rig.results("centerline", num).iter().map(trace).collect()
}

#[test]
fn positions_are_the_same_live_and_in_a_replay_of_the_recording() {
    let rig = setup()
        .with("recording.enabled", Value::Bool(true))
        .with("recording.images", Value::Bool(true))
        .start()
        .unwrap();
    let mut camera = rig.camera();
    publish_sample(&rig, 5);
    for number in 0..40_i64 {
        camera.picture.row = 8 + (number % 7) as u32;
        camera.picture.height = if number < 30 { 32 } else { 36 };
        if number == 20 {
            camera.at_ms += 100;
        }
        camera.shoot();
        // The axis publishes nothing for a while: frames wait for its next sample, no more than the queue holds.
        if !(20..23).contains(&number) && number != 39 {
            publish_sample(&rig, camera.at_ms + 3);
            traces(&rig, number as usize + 1);
        }
    }
    let listener = rig.listener.clone();
    let (summaries, place) = rig.end_and_keep();
    let live = counts(summaries);
    assert_eq!((live.processed, live.located, live.doubtful), (40, 40, 5));
    let (summary, recorded, replayed) = replayed(place.path());
    assert_eq!((summary.counts.located, summary.counts.doubtful), (40, 5));
    same(&recorded, &replayed, &listener);
    let lines = &replayed["/laser_profiler/centerline"];
    for (line, number) in lines.iter().zip(1..) {
        let trace = cdr::decode::<Centerline<'_>>(&line.data).unwrap().trace;
        let status = match number {
            21..=24 => FrameTrace::ENCODER_STALE,
            40 => FrameTrace::ENCODER_EXTRAPOLATED,
            _ => 0,
        };
        assert_eq!(trace.encoder_status, status, "frame {number}");
        let at_ms = if number > 20 { number * 10 + 100 } else { number * 10 };
        assert!((trace.position - f64::from(at_ms) * 1e-4).abs() < 1e-12, "{trace:?}");
    }
    let states: Vec<_> = replayed["/laser_profiler/slice_info"]
        .iter()
        .map(|info| cdr::decode::<SliceInfo<'_>>(&info.data).unwrap().state)
        .collect();
    assert_eq!(states, [0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2]);
}

#[test]
fn a_frame_stops_waiting_although_no_message_arrives() {
    let rig = setup().start().unwrap();
    let mut camera = rig.camera();
    for at_ms in [1, 4, 7] {
        publish_sample(&rig, at_ms);
    }
    camera.shoot();
    let trace = traces(&rig, 1)[0];
    assert_eq!(trace.encoder_status, FrameTrace::ENCODER_EXTRAPOLATED);
    assert!((trace.position - 1e-3).abs() < 1e-12);
    let live = counts(rig.end());
    assert_eq!((live.processed, live.located), (1, 1));
}

#[test]
fn many_samples_displace_no_image_and_faults_do_not_end_the_node() {
    let rig = setup().start().unwrap();
    let mut camera = rig.camera();
    for number in 0..4 {
        camera.shoot();
        rig.network.deliver("/joint_states", &Err(Fault::Foreign("odd".into())));
        for at_ms in 0..10 {
            publish_sample(&rig, number * 10 + at_ms + 3);
        }
    }
    let found = traces(&rig, 4);
    assert!(found.iter().all(|trace| trace.encoder_status == 0), "{found:?}");
    let live = counts(rig.end());
    assert_eq!((live.processed, live.dropped_overload, live.positions_refused), (4, 0, 0));
}

#[test]
fn the_source_of_positions_cannot_change_while_configured() {
    let rig = setup().start().unwrap();
    let refused = rig.set("motion.source", &text("encoder")).unwrap_err();
    assert!(
        refused.contains("motion.source changes only while the node is unconfigured"),
        "{refused}"
    );
    assert!(rig.set("motion.joint", &text("lift")).is_err());
    rig.set("motion.max_gap", &Value::Float(0.5)).unwrap();
}
