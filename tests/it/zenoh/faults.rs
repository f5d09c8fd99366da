//! Samples that no ROS node of these versions sends, and messages that are too large.

use laser_profiler::{msg::qos::QosProfile, ros::transport::Fault};

use super::network::{Inbox, Network, headers};

const LIMIT_BYTES: usize = 1000;

/// The outcome of a sample of four bytes, and of a good one after it.
fn fault_of(arguments: &[&str]) -> Option<Fault> {
    let (network, _router) = Network::start()?;
    let node = network.node();
    let inbox = Inbox::open(&node, &headers(QosProfile::reliable(10)), LIMIT_BYTES);
    let bad = network.header_peer("talk", arguments);
    let fault = inbox.next().unwrap_err();
    bad.event("sent");
    let good = network.header_peer("talk", &["--bytes", "1000"]);
    good.event("sent");
    assert_eq!(inbox.next().unwrap().data, [7; LIMIT_BYTES]);
    Some(fault)
}

#[test]
fn an_old_attachment_is_named() {
    let Some(fault) = fault_of(&["--attachment", "old"]) else { return };
    assert!(fault.to_string().contains("rmw_zenoh_cpp before 0.2.5: update"), "{fault}");
}

#[test]
fn a_missing_attachment_is_named() {
    let Some(fault) = fault_of(&["--attachment", "none"]) else { return };
    assert!(fault.to_string().contains("no attachment"), "{fault}");
}

#[test]
fn a_cut_attachment_is_named() {
    let Some(fault) = fault_of(&["--attachment", "short"]) else { return };
    assert!(fault.to_string().contains("an attachment of 20 bytes"), "{fault}");
}

#[test]
fn a_message_above_the_limit_is_refused() {
    let Some(fault) = fault_of(&["--bytes", "1001"]) else { return };
    assert_eq!(fault, Fault::TooLarge { bytes: 1001, limit_bytes: LIMIT_BYTES });
}
