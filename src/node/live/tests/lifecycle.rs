//! Tests the lifecycle as a manager controls it.

use std::time::Instant;

use super::{
    super::WATCH_PERIOD,
    recordings::{bags, open},
    rig::{Rig, Setup, text},
    stream::counts,
};
use crate::{
    msg::{
        laser_profiler_msgs::{Profile, SliceInfo, StreamStatus},
        lifecycle_msgs::TransitionEvent,
        schema::Message,
    },
    ros::value::Value,
};

fn waiting() -> Rig {
    Setup::new().with("autostart", Value::Bool(false)).start().unwrap()
}

#[test]
fn a_node_without_autostart_waits_for_its_manager() {
    let rig = waiting();
    let (events, _subscription) =
        rig.listen("/laser_profiler/transition_event", TransitionEvent::TYPE);
    let mut camera = rig.camera();
    camera.shoot();
    assert!(rig.change_state("configure"));
    camera.shoot();
    assert!(rig.change_state("activate"));
    camera.shoot();
    rig.results("centerline", 1);
    assert!(rig.change_state("shutdown"));
    let labels: Vec<_> = events
        .received("/laser_profiler/transition_event")
        .iter()
        .map(|event| event.decode::<TransitionEvent<'_>>().goal_state.label.into_owned())
        .collect();
    let expected = ["configuring", "inactive", "activating", "active", "shuttingdown", "finalized"];
    assert_eq!(labels, expected);
    assert_eq!(counts(rig.end()).received, 1, "earlier frames were not received");
}

#[test]
fn a_finalized_node_answers_until_it_is_ended() {
    let rig = Setup::new().with("recording.enabled", Value::Bool(true)).start().unwrap();
    let mut camera = rig.camera();
    camera.shoot();
    rig.results("centerline", 1);
    assert!(rig.change_state("shutdown"));
    let bag = bags(rig.place.path()).remove(0);
    assert!(open(&bag).is_indexed() && bag.join("metadata.yaml").exists(), "closed at once");
    assert_eq!(rig.state(), (4, "finalized".to_owned()));
    camera.shoot();
    for label in ["configure", "activate", "shutdown"] {
        assert!(!rig.change_state(label), "{label}");
    }
    assert!(!rig.trigger("start_scan").0 && !rig.start_recording().0);
    rig.set("slice.profiles", &Value::Integer(5)).unwrap();
    // Longer than the period at which the node looks for a reason to end.
    let until = Instant::now() + 3 * WATCH_PERIOD;
    while Instant::now() < until {
        assert_eq!(rig.state().0, 4);
        assert!(!rig.has_ended(), "only a signal ends it");
        std::thread::yield_now();
    }
    assert_eq!(counts(rig.end()).received, 1, "later frames were not received");
}

#[test]
fn an_inactive_node_publishes_nothing_and_continues_with_a_new_session() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    for number in 1..=3 {
        camera.shoot();
        rig.results("centerline", number);
    }
    assert!(rig.change_state("deactivate"));
    let infos = rig.results("slice_info", 1);
    assert!(infos[0].decode::<SliceInfo<'_>>().last_slice, "the scan has ended");
    rig.results("height_map", 1);
    camera.shoot_times(5);
    assert!(rig.change_state("activate"));
    // An older stamp is accepted in a new session.
    camera.at_ms = 0;
    camera.shoot();
    rig.results("centerline", 4);
    let listener = rig.listener.clone();
    let counts = counts(rig.end());
    assert_eq!((counts.received, counts.processed, counts.lost()), (4, 4, 0));
    let infos = listener.received("/laser_profiler/slice_info");
    assert_eq!(infos.len(), 2);
    assert!(
        infos[1].decode::<SliceInfo<'_>>().frames_missing == 0,
        "frames before activation are not missing"
    );
    let statuses = listener.received("/laser_profiler/stream_status");
    let last: StreamStatus<'_> = statuses.last().unwrap().decode();
    assert_eq!(last.frames_received, 4, "counters continue");
}

#[test]
fn queued_frames_are_measured_before_the_node_is_inactive() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    for round in 1..=20 {
        camera.shoot_times(3);
        assert!(rig.change_state("deactivate"));
        // The end of the scan is published after the last frame and before the response.
        rig.results("centerline", round * 3);
        assert_eq!(rig.results("height_map", round).len(), round);
        assert!(rig.change_state("activate"));
    }
    assert_eq!(counts(rig.end()).processed, 60);
}

#[test]
fn another_calibration_is_loaded_between_cleanup_and_configure() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    camera.shoot();
    rig.results("profile", 1);
    let other = rig.place.path().join("other.yaml");
    let calibration = super::rig::CALIBRATION.replace("frame_id: laser", "frame_id: other");
    std::fs::write(&other, calibration).unwrap();
    let name = text(other.to_str().unwrap());
    let refused = rig.set("calibration_file", &name).unwrap_err();
    assert!(refused.contains("calibration_file") && refused.contains("clean it up"), "{refused}");
    assert!(rig.set("image_transport", &text("compressed")).is_err());
    rig.set("image_transport", &text("raw")).unwrap();
    assert!(rig.set("max_frame_bytes", &Value::Integer(1 << 28)).is_err());
    assert!(rig.change_state("deactivate") && rig.change_state("cleanup"));
    rig.set("calibration_file", &name).unwrap();
    assert!(rig.change_state("configure") && rig.change_state("activate"));
    camera.shoot();
    let profiles = rig.results("profile", 2);
    assert_eq!(profiles[1].decode::<Profile<'_>>().header.frame_id, "other");
    assert_eq!(counts(rig.end()).processed, 2, "one summary of both sessions");
}

#[test]
fn a_missing_calibration_leaves_the_node_unconfigured() {
    let rig = waiting();
    let missing = rig.place.path().join("missing.yaml");
    rig.set("calibration_file", &text(missing.to_str().unwrap())).unwrap();
    assert!(!rig.change_state("configure"));
    assert!(!rig.change_state("activate"), "still unconfigured");
    let good = rig.place.path().join("c.yaml");
    rig.set("calibration_file", &text(good.to_str().unwrap())).unwrap();
    assert!(rig.change_state("configure"), "corrected");
    assert_eq!(counts(rig.end()).received, 0);

    let started = Setup::new().with("calibration_file", text("/missing/c.yaml")).start();
    let error = started.err().unwrap().to_string();
    assert!(error.contains("/missing/c.yaml") && error.contains("unconfigured"), "{error}");
}
