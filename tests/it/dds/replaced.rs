//! The middleware process of a node fails, and is replaced.

use std::{
    thread,
    time::{Duration, Instant},
};

use super::{
    line::Line,
    node::{PATIENCE, eventually},
    peer::{Peer, VENDORS, Vendor},
};

#[test]
fn a_killed_process_is_replaced_and_images_go_on() {
    let mut line = Line::start();
    line.wait_for_a_result();
    let first = line.node.middleware();
    first.signal("KILL");
    line.node.wait_for("the middleware process is replaced: it ended (signal: 9 (SIGKILL))");
    line.node.wait_for("the new middleware process joined");
    line.wait_for_a_result();
    assert_ne!(line.node.middleware(), first);
    line.end();
}

/// RustDDS ends its event loops on the interrupted system call.
#[test]
fn a_process_that_was_stopped_works_again() {
    let mut line = Line::start();
    line.wait_for_a_result();
    let process = line.node.middleware();
    process.signal("STOP");
    process.signal("CONT");
    line.wait_for_a_result();
    line.end();
}

#[test]
fn a_process_that_hangs_is_replaced() {
    let mut line = Line::start();
    line.wait_for_a_result();
    line.node.middleware().signal("STOP");
    line.node.wait_for("the middleware process is replaced: it did not report");
    line.wait_for_a_result();
    line.end();
}

#[test]
fn a_process_that_hangs_does_not_delay_the_end_of_the_node() {
    let mut line = Line::start();
    line.wait_for_a_result();
    let process = line.node.middleware();
    process.signal("STOP");
    line.end();
    eventually("the process has ended", || !process.is_there());
}

#[test]
fn the_process_ends_with_a_killed_node() {
    let line = Line::start();
    let process = line.node.middleware();
    assert!(process.is_there());
    let started = Instant::now();
    line.node.kill();
    eventually("the process has ended", || !process.is_there());
    assert!(started.elapsed() < Duration::from_secs(10));
}

/// An interrupt from the keyboard reaches the whole foreground group; the process still serves its node then.
#[test]
fn a_process_ignores_the_signals_that_end_a_node() {
    let mut line = Line::start();
    let process = line.node.middleware();
    for name in ["INT", "TERM", "HUP"] {
        process.signal(name);
    }
    line.wait_for_a_result();
    assert_eq!(line.node.middleware(), process);
    line.end();
}

/// A camera of another vendor that never stops sending.
fn camera(vendor: Vendor, line: &Line) -> Option<Peer> {
    let arguments =
        "publish --topic rt/camera/image_raw --width 64 --height 48 --rate 20 --count 100000";
    let arguments: Vec<_> = arguments.split(' ').collect();
    Peer::start(vendor, &line.domain, &arguments)
}

/// One of the two forgets the other. RustDDS never announces its endpoints again then, nor does Fast DDS to Cyclone.
#[test]
fn a_camera_that_was_silent_for_long_is_heard_again() {
    // Longer than the leases of their participants, 10 s and 20 s.
    for (vendor, silence_s) in [(Vendor::Cyclone, 15), (Vendor::FastDds, 25)] {
        let line = Line::start();
        let Some(camera) = camera(vendor, &line) else { continue };
        // Enough for a stream.
        for _ in 0..20 {
            assert!(line.results.next().is_ok());
        }
        camera.signal("STOP");
        thread::sleep(Duration::from_secs(silence_s));
        camera.signal("CONT");
        while line.results.next_within(Duration::ZERO).is_some() {}
        assert!(line.results.next_within(PATIENCE).is_some(), "{vendor:?}");
    }
}

#[test]
fn a_camera_killed_and_started_again_and_again_is_heard_each_time() {
    let line = Line::start();
    for round in 0..20 {
        let vendor = VENDORS[round % 2];
        let Some(camera) = camera(vendor, &line) else { return };
        while line.results.next_within(Duration::ZERO).is_some() {}
        assert!(line.results.next_within(PATIENCE).is_some(), "{vendor:?}, round {round}");
        // Dropping the peer kills it.
        drop(camera);
    }
}

#[test]
fn services_are_offered_again() {
    let line = Line::start();
    let process = line.node.middleware();
    process.signal("KILL");
    line.node.wait_for("the new middleware process joined");
    for vendor in VENDORS {
        let call = "call --topic /laser_profiler/stop_scan --type std_srvs::srv::dds_::Trigger_";
        let call: Vec<_> = call.split(' ').collect();
        let Some(client) = Peer::start(vendor, &line.domain, &call) else { continue };
        client.wait_for("reply");
    }
}
