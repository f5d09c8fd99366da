//! Tests the recordings of a live node and their errors.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use super::{
    Received,
    driver::TestCamera,
    rig::{Rig, Setup, text},
    stream::counts,
};
use crate::{
    bag::{BagReader, Filter, RawMessage, ReadOptions},
    msg::diagnostic_msgs::DiagnosticArray,
    ros::value::Value,
};

pub(super) fn open(path: &Path) -> BagReader {
    BagReader::open(path, &ReadOptions::default()).unwrap()
}

/// The bytes of each topic, in order.
pub(super) fn messages(path: &Path) -> BTreeMap<String, Vec<RawMessage>> {
    let mut by_topic = BTreeMap::<_, Vec<_>>::new();
    for message in open(path).messages(&Filter::all()).map(Result::unwrap) {
        by_topic.entry(message.topic.name.clone()).or_default().push(message);
    }
    by_topic
}

/// The bags in a directory; image bags come last.
pub(super) fn bags(place: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(place.join("bags")).unwrap();
    let mut bags: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    bags.sort_by_key(|path| (path.to_string_lossy().ends_with("_images"), path.clone()));
    bags
}

fn shoot(rig: &Rig, camera: &mut TestCamera, numbers: impl IntoIterator<Item = usize>) {
    for number in numbers {
        camera.shoot();
        // The last result of a frame: all of its results are published.
        rig.results("profile", number);
    }
}

#[test]
fn a_bag_has_the_published_bytes_from_start_to_stop() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    shoot(&rig, &mut camera, 1..=2);
    let (success, directory) = rig.start_recording();
    assert!(success, "{directory}");
    shoot(&rig, &mut camera, 3..=9);
    assert!(rig.trigger("stop_scan").0);
    let (success, stopped) = rig.stop_recording();
    assert_eq!((success, &stopped), (true, &directory));
    shoot(&rig, &mut camera, 10..=11);
    assert_eq!(rig.stop_recording(), (true, "nothing was being recorded".into()));
    let listener = rig.listener.clone();
    let (_, _place) = rig.end_and_keep();

    let recorded = messages(Path::new(&directory));
    let bytes_of = |name: &str| -> Vec<&[u8]> {
        recorded[&format!("/laser_profiler/{name}")].iter().map(|m| m.data.as_slice()).collect()
    };
    for (name, range) in [
        ("centerline", 2..9),
        ("annotations", 2..9),
        ("profile", 2..9),
        // Frames 0 to 3, 4 to 7, and 8, which is the last.
        ("points", 0..3),
        ("points_dense", 0..3),
        ("slice_info", 0..3),
        ("height_map", 0..1),
    ] {
        let received = listener.received(&format!("/laser_profiler/{name}"));
        let published: Vec<&[u8]> = received[range].iter().map(|m| m.data.as_slice()).collect();
        assert!(bytes_of(name) == published, "{name}");
    }
    assert!(!recorded.contains_key("/image_raw"));
}

#[test]
fn images_get_their_own_bag_and_a_signal_closes_both() {
    let setup = Setup::new()
        .with("recording.enabled", Value::Bool(true))
        .with("recording.images", Value::Bool(true));
    let rig = setup.start().unwrap();
    let mut camera = rig.camera();
    shoot(&rig, &mut camera, 1..=6);
    let listener = rig.listener.clone();
    let (summaries, place) = rig.end_and_keep();
    assert_eq!(counts(summaries).processed, 6);
    let [results, images] = <[_; 2]>::try_from(bags(place.path())).unwrap();
    assert!(open(&results).is_indexed() && open(&images).is_indexed());
    let images = messages(&images);
    assert_eq!(images["/image_raw"].len(), 6);
    assert_eq!(images["/image_raw"][2].sequence, 3);
    let recorded = messages(&results);
    for name in ["centerline", "slice_info", "height_map", "stream_status"] {
        let topic = format!("/laser_profiler/{name}");
        let received = listener.received(&topic);
        let published: Vec<_> = received.iter().map(|Received { data, .. }| data).collect();
        let recorded: Vec<_> = recorded[&topic].iter().map(|m| &m.data).collect();
        // The first report may precede the recording.
        assert!(published.ends_with(&recorded) && !recorded.is_empty(), "{name}");
    }
    assert_eq!(recorded["/laser_profiler/centerline"].len(), 6, "from the first frame to the last");
}

#[test]
fn recordings_follow_the_parameter_and_the_lifecycle() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    rig.set("recording.enabled", &Value::Bool(true)).unwrap();
    shoot(&rig, &mut camera, 1..=5);
    // The end of the scan is recorded, too.
    assert!(rig.change_state("deactivate"));
    let first = bags(rig.place.path());
    assert_eq!(first.len(), 1);
    let recorded = messages(&first[0]);
    assert_eq!(recorded["/laser_profiler/centerline"].len(), 5);
    assert_eq!(recorded["/laser_profiler/height_map"].len(), 1);
    assert!(rig.change_state("activate"));
    shoot(&rig, &mut camera, 6..=7);
    rig.set("recording.enabled", &Value::Bool(false)).unwrap();
    shoot(&rig, &mut camera, 8..=8);
    let (_, place) = rig.end_and_keep();
    let bags = bags(place.path());
    assert_eq!(bags.len(), 2);
    assert_eq!(messages(&bags[1])["/laser_profiler/centerline"].len(), 2);
}

#[test]
fn a_snapshot_contains_the_recent_past() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    assert!(!rig.trigger("snapshot").0, "nothing is buffered until it is enabled");
    rig.set("recording.snapshot_seconds", &Value::Integer(600)).unwrap();
    shoot(&rig, &mut camera, 1..=3);
    let (success, directory) = rig.trigger("snapshot");
    assert!(success, "{directory}");
    shoot(&rig, &mut camera, 4..=5);
    let listener = rig.listener.clone();
    let (_, _place) = rig.end_and_keep();
    let recorded = messages(Path::new(&directory));
    let lines = &recorded["/laser_profiler/centerline"];
    let received = listener.received("/laser_profiler/centerline");
    assert!(lines.iter().map(|line| &line.data).eq(received[..3].iter().map(|line| &line.data)));
}

#[test]
fn a_directory_that_cannot_be_written_is_reported_and_drops_no_result() {
    let setup = Setup::new()
        .with("recording.enabled", Value::Bool(true))
        // No directory can be created in it, not even by root.
        .with("recording.directory", text("/dev/null/bags"));
    let rig = setup.start().unwrap();
    let mut camera = rig.camera();
    shoot(&rig, &mut camera, 1..=5);
    let level = rig.listener.wait_until("the fault is reported", "/diagnostics", |received| {
        let diagnostics: DiagnosticArray<'_> = received.decode();
        let status = &diagnostics.status[0];
        status.message.contains("/dev/null/bags").then_some(status.level)
    });
    assert_eq!(level, 2);
    let (success, message) = rig.start_recording();
    assert!(!success && message.contains("/dev/null/bags"), "{message}");
    // Another directory works.
    let good = rig.place.path().join("bags");
    rig.set("recording.directory", &text(good.to_str().unwrap())).unwrap();
    assert!(rig.start_recording().0);
    shoot(&rig, &mut camera, 6..=6);
    let (summaries, place) = rig.end_and_keep();
    let summary = summaries[0].summary.as_ref().unwrap();
    assert!(!summary.is_complete(), "exit code 3");
    // The parameter asked for the first, the service for the second.
    assert_eq!(summary.recordings_failed.num, 2);
    assert!(summary.recordings_failed.first.as_ref().unwrap().contains("/dev/null/bags"));
    assert!(summary.counts.recorder_dropped >= 5, "what should have been recorded is counted");
    assert_eq!(counts(summaries).processed, 6);
    assert_eq!(messages(&bags(place.path())[0])["/laser_profiler/centerline"].len(), 1);
}
