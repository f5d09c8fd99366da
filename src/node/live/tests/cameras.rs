//! Several cameras in one node.

use super::{
    Received,
    rig::{Rig, Setup, text},
};
use crate::{
    msg::{
        diagnostic_msgs::DiagnosticArray,
        laser_profiler_msgs::{Centerline, StreamStatus},
    },
    ros::value::Value,
};

fn two_cameras() -> Rig {
    let mut setup = Setup::new();
    setup.set("cameras", Value::TextList(vec!["left".into(), "right".into()]));
    for camera in ["left", "right"] {
        setup.set_camera(camera);
    }
    setup.set("right.extraction.method", text("gray_gravity"));
    setup.start().unwrap()
}

#[test]
fn each_camera_has_its_topics_and_parameters_and_a_faulty_one_does_not_affect_others() {
    let rig = two_cameras();
    let (mut left, mut right) =
        (rig.camera_on("/left/image_raw"), rig.camera_on("/right/image_raw"));
    let lines = |camera: &str, num| {
        rig.listener.wait_for(&format!("/laser_profiler/{camera}/centerline"), num)
    };
    for number in 1..=20 {
        left.shoot();
        // A stream of malformed messages.
        for _ in 0..50 {
            right.sequence += 1;
            right.send(vec![0xff; 1000]);
        }
        assert_eq!(lines("left", number).len(), number);
    }
    right.shoot();
    let line: &Received = &lines("right", 1)[0];
    assert!(line.decode::<Centerline<'_>>().method.starts_with("gray_gravity/"));
    let line: &Received = &lines("left", 1)[0];
    assert!(line.decode::<Centerline<'_>>().method.starts_with("improved_gravity/"));
    rig.listener.wait("the diagnostics of both", |messages| {
        let names =
            messages.iter().filter(|message| message.topic == "/diagnostics").map(|message| {
                let diagnostics: DiagnosticArray<'_> = message.decode();
                (diagnostics.status[0].name.clone().into_owned(), diagnostics.status[0].level)
            });
        let names: Vec<_> = names.collect();
        names.iter().any(|(name, _)| name == "laser_profiler: left stream")
            && names
                .iter()
                .any(|(name, level)| name == "laser_profiler: right stream" && *level > 0)
    });
    let listener = rig.listener.clone();
    let summaries = rig.end();
    let [left, right] = <[_; 2]>::try_from(summaries).ok().unwrap();
    assert_eq!((&*left.name, &*right.name), ("left", "right"));
    let (left, right) = (left.summary.unwrap().counts, right.summary.unwrap().counts);
    assert_eq!((left.received, left.processed, left.is_complete()), (20, 20, true));
    assert_eq!((right.received, right.processed), (1001, 1));
    assert_eq!(right.received, right.processed + right.rejected() + right.dropped_overload);
    let status = listener.received("/laser_profiler/right/stream_status").pop().unwrap();
    let status: StreamStatus<'_> = status.decode();
    assert_eq!((&*status.topic, status.frames_received), ("/right/image_raw", 1001));
}

#[test]
fn a_scan_of_one_camera_does_not_affect_the_other() {
    let rig = two_cameras();
    let (mut left, mut right) =
        (rig.camera_on("/left/image_raw"), rig.camera_on("/right/image_raw"));
    for camera in [&mut left, &mut right] {
        camera.shoot();
    }
    for camera in ["left", "right"] {
        rig.listener.wait_for(&format!("/laser_profiler/{camera}/centerline"), 1);
    }
    assert!(rig.trigger("left/stop_scan").0);
    rig.listener.wait_for("/laser_profiler/left/height_map", 1);
    assert!(rig.listener.received("/laser_profiler/right/height_map").is_empty());
    assert!(rig.trigger("stop_scan").0, "all of them");
    rig.listener.wait_for("/laser_profiler/right/height_map", 1);
    let (success, bags) = rig.start_recording();
    assert!(success && bags.contains("_left_") && bags.contains("_right_"), "{bags}");
    let listener = rig.listener.clone();
    rig.end();
    assert_eq!(listener.received("/laser_profiler/left/height_map").len(), 1);
}
