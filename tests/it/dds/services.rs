//! Services, called as Cyclone's and Fast DDS's ROS nodes call them.

use std::sync::mpsc;

use laser_profiler::ros::{
    dds::DdsSettings,
    node_params::ServiceMapping,
    transport::{OnRequest, Transport},
};

use super::{
    domain::Domain,
    node::{open_with, settings, trigger},
    peer::{Peer, VENDORS, Vendor},
};

/// `success: true, message: "done"`.
const REPLY: [u8; 17] = [0, 1, 0, 0, 1, 0, 0, 0, 5, 0, 0, 0, b'd', b'o', b'n', b'e', 0];

fn bytes(hex: &str) -> Vec<u8> {
    let byte = |at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap();
    (0..hex.len()).step_by(2).map(byte).collect()
}

fn answering() -> (OnRequest, mpsc::Receiver<Vec<u8>>) {
    let (sender, requests) = mpsc::sync_channel(8);
    let on_request = Box::new(move |request: &[u8]| {
        drop(sender.try_send(request.to_vec()));
        Some(REPLY.to_vec())
    });
    (on_request, requests)
}

fn call(vendor: Vendor, domain: &Domain) -> Option<Peer> {
    let arguments =
        ["call", "--topic", "/cell/node/reset", "--type", "std_srvs::srv::dds_::Trigger_"];
    Peer::start(vendor, domain, &arguments)
}

/// Serves once, and has it called.
fn is_answered(vendor: Vendor, service_mapping: ServiceMapping) {
    let domain = Domain::claim();
    let node = open_with(&DdsSettings { service_mapping, ..settings(&domain) }, "node");
    let (on_request, requests) = answering();
    let _server = node.serve(&trigger("/cell/node/reset"), on_request).unwrap();
    let Some(peer) = call(vendor, &domain) else { return };
    let reply = peer.wait_for("reply");
    // The peer checks the addressee of the reply itself. Cyclone's peer omits the header.
    let body = if vendor == Vendor::Cyclone { &REPLY[4..] } else { &REPLY[..] };
    let replied = bytes(reply["hex"].as_str().unwrap());
    assert!(replied.starts_with(body), "{vendor:?}: {reply}");
    let request = requests.try_recv().unwrap();
    assert_eq!(request[..5], [0, 1, 0, 0, 0], "an empty request has one byte");
}

#[test]
fn each_is_answered_in_its_own_mapping() {
    for vendor in VENDORS {
        is_answered(vendor, ServiceMapping::Auto);
    }
}

#[test]
fn the_mapping_can_be_configured() {
    is_answered(Vendor::Cyclone, ServiceMapping::Cyclone);
    is_answered(Vendor::FastDds, ServiceMapping::Enhanced);
}

#[test]
fn one_server_answers_both_at_once() {
    let domain = Domain::claim();
    let node = open_with(&settings(&domain), "node");
    let (on_request, _requests) = answering();
    let _server = node.serve(&trigger("/cell/node/reset"), on_request).unwrap();
    let peers: Vec<_> = VENDORS.into_iter().map(|vendor| call(vendor, &domain)).collect();
    for peer in peers.into_iter().flatten() {
        peer.wait_for("reply");
    }
}
