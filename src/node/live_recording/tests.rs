//! Tests recording from the node: messages sent, contents of the bags, and reports of losses.

mod faults;
mod process;
mod snapshots;

use std::{
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use super::{tap::Stream, *};
use crate::{
    bag::{BagReader, Compression, Filter, MetadataRecord, RawMessage, ReadOptions, Topic},
    msg::{
        laser_profiler_msgs::{Centerline, StreamStatus},
        qos::QosProfile,
        schema::Message,
        sensor_msgs::Image,
    },
    node::{
        recording::Description,
        sink::{Outgoing, Sink},
    },
};

const CENTERLINE: usize = 0;
const STATUS: usize = 1;
const IMAGE: usize = 2;

fn message(topic: usize, sequence: u32, bytes: usize) -> Outgoing {
    let time_ns = i64::from(sequence) * 1_000_000;
    Outgoing {
        topic,
        log_time_ns: time_ns,
        publish_time_ns: time_ns,
        sequence,
        data: vec![7; bytes].into(),
    }
}

pub(super) fn tapped(place: usize, sequence: u32, bytes: usize) -> tap::Tapped {
    tap::Tapped { stream: Stream::Results, place, message: message(place, sequence, bytes) }
}

fn topics() -> RecordedTopics {
    let centerline = Topic::new("/centerline", Centerline::TYPE, QosProfile::reliable(10));
    let status = Topic::new("/stream_status", StreamStatus::TYPE, QosProfile::latched(1));
    let image = Topic::new("/image_raw", Image::TYPE, QosProfile::best_effort(5));
    RecordedTopics {
        results: vec![(CENTERLINE, centerline), (STATUS, status)],
        images: vec![(IMAGE, image)],
    }
}

fn description(parameters: &str) -> Description {
    Description {
        parameters: parameters.to_owned(),
        calibration: Some("type: of_laser".to_owned()),
        ..Description::default()
    }
}

fn params(directory: &Path) -> RecordingParams {
    RecordingParams {
        directory: directory.to_owned(),
        min_free_bytes: 0,
        ..RecordingParams::default()
    }
}

fn recorder(params: RecordingParams) -> (LiveRecorder, RecordingControl) {
    LiveRecorder::new("", topics(), params, description("a: 1"))
}

fn send(recorder: &mut LiveRecorder, topic: usize, sequences: impl IntoIterator<Item = u32>) {
    for sequence in sequences {
        recorder.write(&message(topic, sequence, 100)).unwrap();
    }
}

fn open(path: &Path) -> BagReader {
    BagReader::open(path, &ReadOptions::default()).unwrap()
}

fn messages(path: &Path) -> Vec<RawMessage> {
    open(path).messages(&Filter::all()).map(Result::unwrap).collect()
}

fn sequences(path: &Path, topic: &str) -> Vec<u32> {
    let messages = messages(path);
    let of_topic = messages.iter().filter(|message| message.topic.name == topic);
    of_topic.map(|message| message.sequence).collect()
}

/// Sequence numbers of the readable messages of a bag that was not closed.
fn readable(path: &Path) -> Vec<u32> {
    open(path).messages(&Filter::all()).flatten().map(|message| message.sequence).collect()
}

fn records(path: &Path, name: &str) -> Vec<MetadataRecord> {
    open(path).metadata().map(Result::unwrap).filter(|record| record.name == name).collect()
}

/// Waits for a state that another thread brings about.
fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let deadline = Instant::now() + Duration::from_secs(30);
    while !is_so() {
        assert!(Instant::now() < deadline, "not within 30 s: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_bag_holds_the_messages_between_start_and_stop_and_a_description() {
    let place = tempfile::tempdir().unwrap();
    let (mut recorder, control) = recorder(params(place.path()));
    assert_eq!(control.stop().unwrap(), [], "nothing to stop");
    assert_eq!(control.status(), RecordingStatus::default());
    send(&mut recorder, CENTERLINE, 1..=5);
    send(&mut recorder, STATUS, 1..=2);

    let directories = control.start().unwrap();
    assert_eq!(control.start().unwrap(), directories, "the recording continues");
    assert!(control.status().is_recording());
    send(&mut recorder, CENTERLINE, 6..=1000);
    let stopped = control.stop().unwrap();
    send(&mut recorder, CENTERLINE, 1001..=1005);

    let [directory] = directories.try_into().unwrap();
    assert_eq!((stopped[0].messages, stopped[0].dropped), (995, 0));
    assert_eq!(stopped[0].directory.as_deref(), Some(&*directory));
    assert!(!stopped[0].is_recording && !stopped[0].is_ending);
    assert_eq!(control.status().results, stopped[0]);
    assert!(open(&directory).is_indexed() && open(&directory).notes().is_empty());
    assert_eq!(sequences(&directory, "/centerline"), (6..=1000).collect::<Vec<_>>());
    assert_eq!(sequences(&directory, "/stream_status"), [2], "the latched one");
    let own = records(&directory, "laser_profiler");
    assert_eq!(own.len(), 1);
    assert_eq!(own[0].entries["parameters"], "a: 1");
    assert_eq!(own[0].entries["version"], env!("CARGO_PKG_VERSION"));
    let attached = open(&directory).attachments().next().unwrap().unwrap();
    assert_eq!((&*attached.name, &*attached.data), ("calibration.yaml", &b"type: of_laser"[..]));
    let end = &records(&directory, "laser_profiler_end")[0].entries;
    assert_eq!((&*end["messages"], &*end["dropped"], &*end["ended"]), ("995", "0", "as asked"));

    let again = control.start().unwrap();
    assert_ne!(again, std::slice::from_ref(&directory), "never the same bag");
    recorder.finish().unwrap();
    assert_eq!(sequences(&directory, "/centerline").len(), 995, "untouched");
    assert!(open(&again[0]).is_indexed());
}

#[test]
fn images_are_recorded_into_their_own_bag_on_request() {
    let place = tempfile::tempdir().unwrap();
    let (mut recorder, control) = recorder(params(place.path()));
    let results_only = control.start().unwrap();
    send(&mut recorder, IMAGE, 1..=3);
    control.stop().unwrap();
    assert_eq!((results_only.len(), messages(&results_only[0]).len()), (1, 0));

    control.set_params(RecordingParams { images: true, ..params(place.path()) });
    let both = control.start().unwrap();
    send(&mut recorder, IMAGE, 4..=9);
    send(&mut recorder, CENTERLINE, 4..=6);
    recorder.finish().unwrap();
    assert!(both[1].to_str().unwrap().ends_with("_images"), "{both:?}");
    assert_eq!(sequences(&both[0], "/centerline"), [4, 5, 6]);
    assert_eq!(sequences(&both[1], "/image_raw"), [4, 5, 6, 7, 8, 9]);
    assert_eq!([&both[0], &both[1]].map(|bag| messages(bag).len()), [3, 6]);
    assert_eq!(records(&both[1], "laser_profiler").len(), 1);
    let [results, images] = [control.status().results, control.status().images];
    assert_eq!((results.messages, images.messages), (3, 6));
}

#[test]
fn files_are_split_and_changed_parameters_written_while_recording() {
    let place = tempfile::tempdir().unwrap();
    let split = RecordingParams { split_bytes: Some(50_000), ..params(place.path()) };
    let (mut recorder, control) =
        recorder(RecordingParams { compression: Compression::None, ..split });
    let directory = control.start().unwrap().remove(0);
    send(&mut recorder, CENTERLINE, 1..=1000);
    control.describe(description("a: 2"));
    recorder.finish().unwrap();
    let num_files = open(&directory).paths().count();
    assert!((3..=4).contains(&num_files), "{num_files}");
    assert_eq!(sequences(&directory, "/centerline").len(), 1000);
    let all = records(&directory, "laser_profiler");
    assert_eq!(all.len(), num_files + 1, "one for each file, and the change");
    assert_eq!(all.last().unwrap().entries["parameters"], "a: 2");
}

#[test]
fn messages_are_flushed_in_time_even_if_no_more_are_sent() {
    let place = tempfile::tempdir().unwrap();
    let (mut recorder, control) = recorder(params(place.path()));
    let directory = control.start().unwrap().remove(0);
    send(&mut recorder, CENTERLINE, 1..=5);
    let sent = Instant::now();
    wait_until("five messages in the file", || readable(&directory).len() == 5);
    assert!(sent.elapsed() < Duration::from_secs(1), "{:?}", sent.elapsed());
    assert!(control.status().results.is_recording);
}

#[test]
fn kept_messages_are_shared_and_not_copied() {
    let place = tempfile::tempdir().unwrap();
    let (mut recorder, _control) = recorder(params(place.path()));
    let sent = message(CENTERLINE, 1, 100);
    recorder.write(&sent).unwrap();
    assert_eq!(Arc::strong_count(&sent.data), 2, "the sender's and the ring's");
}
