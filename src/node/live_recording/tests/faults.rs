//! Slow, full and vanished disks affect only the recording, not the node.

use std::fs;

use super::*;
use crate::node::{
    live_recording::session::Session, statistics::Failures, stop::Stop, watch::Watch,
};

/// A recording whose disk blocks: its writer has not started.
fn blocked(recorder: &LiveRecorder, stream: Stream, queue_bytes: usize) -> Arc<Session> {
    let directory = Path::new("blocked");
    let shared = &recorder.shared;
    let account = Arc::clone(&lock(&shared.recordings)[stream as usize].account);
    let session = Arc::new(Session::new(directory, queue_bytes, &account));
    lock(&shared.recordings)[stream as usize].session = Some(Arc::clone(&session));
    assert!(lock(&shared.tap).begin(stream, Arc::clone(&session)).is_empty());
    session
}

#[test]
fn a_slow_disk_drops_the_oldest_messages_and_counts_them() {
    let place = tempfile::tempdir().unwrap();
    let (mut recorder, _control) = recorder(params(place.path()));
    let session = blocked(&recorder, Stream::Results, 1000);
    send(&mut recorder, CENTERLINE, 1..=50);
    assert_eq!(session.dropped(), 40);

    // The disk works again.
    let shared = Arc::clone(&recorder.shared);
    let bag = shared.create(Stream::Results, &params(place.path()), "slow").unwrap();
    let directory = bag.directory().to_owned();
    writer::start(bag, &session, &shared.settings, &[]).unwrap();
    session.close();
    assert!(session.wait(Duration::from_secs(30)));
    assert_eq!((session.messages(), session.dropped()), (10, 40));
    assert_eq!(sequences(&directory, "/centerline"), (41..=50).collect::<Vec<_>>());
    assert_eq!(records(&directory, "laser_profiler_end")[0].entries["dropped"], "40");
}

#[test]
fn a_slow_image_disk_does_not_affect_the_results() {
    let place = tempfile::tempdir().unwrap();
    let (mut recorder, control) = recorder(params(place.path()));
    let directory = control.start().unwrap().remove(0);
    let images = blocked(&recorder, Stream::Images, 1000);
    for sequence in 1..=100 {
        send(&mut recorder, CENTERLINE, [sequence]);
        send(&mut recorder, IMAGE, [sequence]);
    }
    images.end();
    recorder.finish().unwrap();
    assert_eq!(images.dropped(), 90);
    assert_eq!(sequences(&directory, "/centerline"), (1..=100).collect::<Vec<_>>());
    assert_eq!(control.status().results.dropped, 0);
}

#[test]
fn a_hanging_disk_delays_commands_and_shutdown_by_two_seconds_at_most() {
    let place = tempfile::tempdir().unwrap();
    let (mut recorder, control) = recorder(params(place.path()));
    let _hanging = blocked(&recorder, Stream::Results, 1000);
    send(&mut recorder, CENTERLINE, 1..=50);
    let start = Instant::now();
    assert!(matches!(control.stop(), Err(RecordingError::StillWriting(_))));
    assert!(start.elapsed() < Duration::from_millis(2500), "{:?}", start.elapsed());
    send(&mut recorder, CENTERLINE, 51..=60);
    let start = Instant::now();
    assert!(recorder.finish().unwrap_err().to_string().contains("still being written"));
    assert!(start.elapsed() < Duration::from_secs(2), "{:?}", start.elapsed());
}

#[test]
fn an_abandoned_queue_is_dropped_and_counted_and_the_bag_is_complete() {
    let place = tempfile::tempdir().unwrap();
    let (mut recorder, _control) = recorder(params(place.path()));
    let session = blocked(&recorder, Stream::Results, 10_000);
    send(&mut recorder, CENTERLINE, 1..=50);
    session.close();
    session.abandon_queue();
    let shared = Arc::clone(&recorder.shared);
    let bag = shared.create(Stream::Results, &params(place.path()), "abandoned").unwrap();
    let directory = bag.directory().to_owned();
    writer::start(bag, &session, &shared.settings, &[]).unwrap();
    assert!(session.wait(Duration::from_secs(30)));
    assert_eq!(session.messages() + session.dropped(), 50);
    assert!(session.dropped() > 0 && open(&directory).is_indexed());
}

#[test]
fn below_the_minimum_free_space_a_recording_is_closed() {
    let place = tempfile::tempdir().unwrap();
    let (mut recorder, control) = recorder(params(place.path()));
    let directory = control.start().unwrap().remove(0);
    send(&mut recorder, CENTERLINE, 1..=5);
    wait_until("they are written", || control.status().results.messages == 5);
    control.set_params(RecordingParams { min_free_bytes: u64::MAX, ..params(place.path()) });
    wait_until("it ends", || !control.status().results.is_recording);
    assert!(
        lock(&recorder.shared.recordings)[0]
            .session
            .as_ref()
            .unwrap()
            .wait(Duration::from_secs(30))
    );
    send(&mut recorder, CENTERLINE, 6..=10);
    let status = control.status();
    assert_eq!((status.results.messages, status.results.dropped), (5, 5), "they are missing");
    let error = status.results.last_error.unwrap();
    assert_eq!(status.failures, Failures { num: 1, first: Some(error.clone()) });
    for part in ["recording.min_free_bytes", "free some space", directory.to_str().unwrap()] {
        assert!(error.contains(part), "{error}");
    }
    assert!(open(&directory).is_indexed() && open(&directory).notes().is_empty());
    assert_eq!(sequences(&directory, "/centerline"), [1, 2, 3, 4, 5]);
    assert_eq!(records(&directory, "laser_profiler_end")[0].entries["ended"], error);

    assert!(matches!(control.start(), Err(RecordingError::LowSpace { .. })), "still too little");
    assert!(control.status().results.last_error.is_some());
    control.set_params(params(place.path()));
    control.start().unwrap();
    assert_eq!(control.status().results.last_error, None);
    send(&mut recorder, CENTERLINE, 11..=12);
    let stopped = control.stop().unwrap();
    assert_eq!((stopped[0].messages, stopped[0].dropped), (2, 5), "nothing more is missing");
    assert_eq!(control.status().failures.num, 2, "one of them could not start");
}

#[test]
fn a_directory_that_vanishes_ends_the_recording_and_a_later_one_works() {
    let place = tempfile::tempdir().unwrap();
    let (mut recorder, control) = recorder(params(&place.path().join("disk")));
    let directory = control.start().unwrap().remove(0);
    fs::remove_dir_all(place.path().join("disk")).unwrap();
    send(&mut recorder, CENTERLINE, 1..=5);
    wait_until("it ends", || !control.status().results.is_recording);
    wait_until("it is closed", || !control.status().results.is_ending);
    let status = control.status().results;
    let error = status.last_error.unwrap();
    assert!(error.contains(directory.to_str().unwrap()), "{error}");
    assert_eq!((status.messages, status.dropped), (0, 5), "what was recorded is gone, too");
    let again = control.start().unwrap();
    send(&mut recorder, CENTERLINE, 6..=7);
    recorder.finish().unwrap();
    assert_eq!(sequences(&again[0], "/centerline"), [6, 7]);
}

#[test]
fn an_unwritable_directory_is_reported_at_the_start() {
    let place = tempfile::tempdir().unwrap();
    // Not even root can create directories here.
    for directory in ["/proc/recordings", "/dev/null/recordings"] {
        let (mut recorder, control) = recorder(params(Path::new(directory)));
        let error = control.start().unwrap_err().to_string();
        assert!(error.contains(directory) && error.contains("recording.directory"), "{error}");
        assert_eq!(control.status().results.last_error, Some(error));
        send(&mut recorder, CENTERLINE, 1..=5);
        let status = control.status();
        assert_eq!((status.results.dropped, status.failures.num), (5, 1), "asked for and missing");
        assert_eq!(status.results.directory, None);
        control.set_params(params(place.path()));
        assert!(control.start().is_ok(), "elsewhere it works");
        send(&mut recorder, CENTERLINE, 6..=7);
        assert_eq!(control.status().results.dropped, 5);
        recorder.finish().unwrap();
    }
}

#[test]
fn a_writer_that_panics_is_reported_and_what_it_leaves_is_counted() {
    let place = tempfile::tempdir().unwrap();
    let (mut recorder, control) = recorder(params(place.path()));
    let session = blocked(&recorder, Stream::Results, 10_000);
    send(&mut recorder, CENTERLINE, 1..=5);
    let (watch, writing) = (Watch::default(), Arc::clone(&session));
    let watched = watch.clone();
    let writer = std::thread::spawn(move || {
        let _guard = watched.guard("the writer");
        let _ended = writer::EndOnDrop(writing);
        panic!("on purpose");
    });
    assert!(writer.join().is_err());
    send(&mut recorder, CENTERLINE, 6..=7);
    let status = control.status();
    assert_eq!((status.results.dropped, status.failures.num), (7, 1));
    assert!(status.results.last_error.unwrap().contains("programming error"));
    assert_eq!(watch.panicked(), Some("the writer"));
}

#[test]
fn a_time_before_the_epoch_drops_only_its_message() {
    let place = tempfile::tempdir().unwrap();
    let (mut recorder, control) = recorder(params(place.path()));
    let directory = control.start().unwrap().remove(0);
    send(&mut recorder, CENTERLINE, [1]);
    recorder.write(&Outgoing { log_time_ns: -1, ..message(CENTERLINE, 2, 10) }).unwrap();
    send(&mut recorder, CENTERLINE, [3]);
    let stopped = control.stop().unwrap().remove(0);
    assert_eq!((stopped.messages, stopped.dropped, stopped.last_error), (2, 1, None));
    assert_eq!(sequences(&directory, "/centerline"), [1, 3]);
}

#[test]
fn concurrent_commands_lose_no_messages() {
    let place = tempfile::tempdir().unwrap();
    let (mut recorder, control) = recorder(params(place.path()));
    let stop = Stop::default();
    std::thread::scope(|scope| {
        for _ in 0..3 {
            let (control, stop) = (control.clone(), stop.clone());
            scope.spawn(move || {
                while !stop.is_raised() {
                    control.start().unwrap();
                    control.status();
                    control.stop().unwrap();
                }
            });
        }
        for sequence in 1..=2000 {
            send(&mut recorder, CENTERLINE, [sequence]);
        }
        stop.raise();
    });
    recorder.finish().unwrap();
    let bags = fs::read_dir(place.path()).unwrap().map(|entry| entry.unwrap().path());
    let num_recorded: usize = bags
        .map(|bag| {
            let found = sequences(&bag, "/centerline");
            assert!(found.windows(2).all(|pair| pair[1] == pair[0] + 1), "no gap: {found:?}");
            found.len()
        })
        .sum();
    assert!(num_recorded <= 2000, "nothing twice");
    assert_eq!(control.status().results.dropped, 0);
}
