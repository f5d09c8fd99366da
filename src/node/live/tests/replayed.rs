//! Tests that a replay of a recording gives the results that were published live.

use std::{collections::BTreeMap, fs, path::Path};

use super::{
    driver::{MS, Picture, START_NS},
    listener::Listener,
    recordings::{bags, messages, open},
    rig::Setup,
    stream::counts,
};
use crate::{
    bag::RawMessage,
    node::{
        replay::{Replay, ReplayRequest},
        statistics::Summary,
        stop::Stop,
    },
    ros::{arguments::RosArguments, transport::Fault, value::Value},
};

const TOPICS: [&str; 7] =
    ["centerline", "annotations", "profile", "points", "points_dense", "slice_info", "height_map"];

#[test]
fn a_replay_of_the_recording_gives_the_published_results() {
    let setup = Setup::new()
        .with("recording.enabled", Value::Bool(true))
        .with("recording.images", Value::Bool(true))
        .with("extraction.segment_threshold", Value::Float(30.5));
    let rig = setup.start().unwrap();
    let mut camera = rig.camera();
    let mut num_measured = 0;
    for number in 0..40 {
        camera.picture.row = 8 + number % 7;
        camera.picture.height = if number < 30 { 32 } else { 36 };
        match number {
            // Lost, malformed, repeated, and from another publisher.
            9 => camera.sequence += 3,
            14 => camera.send(Picture::default().message(START_NS)[..500].to_vec()),
            19 => camera.send(camera.picture.message(START_NS + camera.at_ms * MS)),
            // Its counter restarts, too: a bag does not identify the publisher of an image.
            25 => (camera.publisher, camera.sequence) = ([8; 16], 0),
            _ => {}
        }
        camera.shoot();
        num_measured += 1;
        rig.results("centerline", num_measured);
    }
    let listener = rig.listener.clone();
    let (summaries, place) = rig.end_and_keep();
    let live = counts(summaries);
    assert_eq!((live.processed, live.rejected(), live.dropped_overload), (40, 2, 0));

    let (summary, recorded, replayed) = replayed(place.path());
    assert_eq!((summary.counts.processed, summary.counts.lost()), (40, live.lost()));
    same(&recorded, &replayed, &listener);
}

/// Messages of a bag by topic.
type Messages = BTreeMap<String, Vec<RawMessage>>;

/// Returns the recorded results, and the results of a replay of the recorded images with the parameters and the
/// calibration in the results bag.
pub(super) fn replayed(place: &Path) -> (Summary, Messages, Messages) {
    let [results, images] = <[_; 2]>::try_from(bags(place)).unwrap();
    let replayed = place.join("replayed");
    let from = place.join("from_the_bag");
    fs::create_dir(&from).unwrap();
    let bag = open(&results);
    let attached = bag.attachments().next().unwrap().unwrap();
    fs::write(from.join("c.yaml"), &*attached.data).unwrap();
    let records = bag.metadata().map(Result::unwrap);
    let described = records.filter(|record| record.name == "laser_profiler").last().unwrap();
    fs::write(from.join("params.yaml"), &described.entries["parameters"]).unwrap();
    let ros =
        RosArguments { parameter_files: vec![from.join("params.yaml")], ..RosArguments::default() };
    let output = replayed.clone();
    let request = ReplayRequest { bags: vec![images], output, ros, ..ReplayRequest::default() };
    let summary = Replay::prepare(request).unwrap().run(&Stop::default(), &mut |_| {}).unwrap();
    (summary, messages(&results), messages(&replayed))
}

/// Asserts that every result is in both bags with the same bytes and times, and was published so.
pub(super) fn same(recorded: &Messages, replayed: &Messages, listener: &Listener) {
    for name in TOPICS {
        let topic = format!("/laser_profiler/{name}");
        let of = |bag: &Messages| -> Vec<_> {
            bag[&topic].iter().map(|m| (m.log_time_ns, m.sequence, m.data.clone())).collect()
        };
        let (live, again) = (of(recorded), of(replayed));
        assert!(live.len() >= 2 && live == again, "{name}: {} and {}", live.len(), again.len());
        let received = listener.received(&topic);
        assert!(
            received.iter().map(|m| &m.data).eq(again.iter().map(|(_, _, data)| data)),
            "{name}"
        );
    }
}

/// A fault has no bytes to record, so the replay only detects a gap.
#[test]
fn after_a_fault_of_the_middleware_the_measurements_are_the_same() {
    let setup = Setup::new()
        .with("recording.enabled", Value::Bool(true))
        .with("recording.images", Value::Bool(true));
    let rig = setup.start().unwrap();
    let mut camera = rig.camera();
    camera.shoot_times(2);
    camera.sequence += 1;
    camera.deliver(&Err(Fault::TooLarge { bytes: 1 << 40, limit_bytes: 1 << 26 }));
    camera.shoot();
    rig.results("centerline", 3);
    let (summaries, place) = rig.end_and_keep();
    let live = counts(summaries);
    assert_eq!((live.malformed, live.lost()), (1, 0));
    let images = messages(&bags(place.path())[1]);
    let sequences: Vec<_> = images["/image_raw"].iter().map(|image| image.sequence).collect();
    assert_eq!(sequences, [1, 2, 4], "the gap shows");
}
