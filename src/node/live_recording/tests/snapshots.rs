//! Snapshots of the last seconds.

use super::*;

fn taken(control: &RecordingControl) -> Vec<std::path::PathBuf> {
    let directories = control.snapshot().unwrap();
    wait_until("the snapshot is complete", || !control.status().snapshot.is_ending);
    directories
}

#[test]
fn holds_the_sent_messages_and_does_not_affect_a_recording() {
    let place = tempfile::tempdir().unwrap();
    let images = RecordingParams { images: true, ..params(place.path()) };
    let (mut recorder, control) = recorder(images);
    send(&mut recorder, STATUS, [1]);
    send(&mut recorder, CENTERLINE, 1..=10);
    send(&mut recorder, IMAGE, 1..=4);
    let recorded = control.start().unwrap();
    send(&mut recorder, CENTERLINE, 11..=20);
    let first = taken(&control);
    send(&mut recorder, CENTERLINE, 21..=30);
    let second = taken(&control);
    recorder.finish().unwrap();

    assert!(first[0].to_str().unwrap().ends_with("_snapshot_1"), "{first:?}");
    assert!(first[1].to_str().unwrap().ends_with("_snapshot_1_images"), "{first:?}");
    assert!(second[0].to_str().unwrap().ends_with("_snapshot_2"), "{second:?}");
    assert_eq!(sequences(&first[0], "/centerline"), (1..=20).collect::<Vec<_>>());
    assert_eq!(sequences(&first[0], "/stream_status"), [1]);
    assert_eq!(sequences(&first[1], "/image_raw"), [1, 2, 3, 4]);
    assert_eq!(sequences(&second[0], "/centerline"), (1..=30).collect::<Vec<_>>());
    assert_eq!(sequences(&recorded[0], "/centerline"), (11..=30).collect::<Vec<_>>());
    assert!(open(&first[0]).is_indexed());
    assert_eq!(records(&first[0], "laser_profiler").len(), 1);
    let status = control.status().snapshot;
    assert_eq!((status.messages, status.dropped, status.last_error), (31 + 4, 0, None));
}

#[test]
fn is_bounded_in_bytes_and_still_holds_the_latched_message() {
    let place = tempfile::tempdir().unwrap();
    let bounded = RecordingParams { snapshot_bytes: 500, ..params(place.path()) };
    let (mut recorder, control) = recorder(bounded);
    send(&mut recorder, STATUS, [1]);
    send(&mut recorder, CENTERLINE, 1..=10);
    let directory = taken(&control).remove(0);
    assert_eq!(sequences(&directory, "/centerline"), [6, 7, 8, 9, 10]);
    assert_eq!(sequences(&directory, "/stream_status"), [1]);
}

#[test]
fn an_impossible_snapshot_reports_the_reason() {
    let place = tempfile::tempdir().unwrap();
    let (mut recorder, control) = recorder(params(place.path()));
    assert!(matches!(control.snapshot(), Err(RecordingError::SnapshotEmpty(10))));
    control.set_params(RecordingParams { snapshot_seconds: None, ..params(place.path()) });
    send(&mut recorder, CENTERLINE, [1]);
    let error = control.snapshot().unwrap_err().to_string();
    assert!(error.contains("recording.snapshot_seconds"), "{error}");
    assert_eq!(control.status().snapshot.last_error, Some(error));
    assert_eq!(std::fs::read_dir(place.path()).unwrap().count(), 0);
}
