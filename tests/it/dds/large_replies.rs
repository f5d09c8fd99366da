//! Replies longer than the MTU, which RustDDS cuts into fragments: see `docs/upstream/rustdds-data-frag.md`.

use std::{
    env,
    fmt::Write as _,
    io::{Read, stdin},
    path::Path,
};

use laser_profiler::ros::{dds::DdsSettings, transport::Transport};
use serde_json::Value as Json;

use super::{
    domain::Domain,
    network::{Network, Place, loopback},
    node::{open_with, trigger},
    peer::{Peer, VENDORS, Vendor},
};
use crate::{live::Node, program::EXECUTABLE};

const SERVICE: [&str; 4] =
    ["--topic", "/cell/node/reset", "--type", "std_srvs::srv::dds_::Trigger_"];
/// Bytes of replies. The last is no multiple of four: whoever pads it is caught.
const SIZES: [u32; 5] = [1_000, 4_000, 22_000, 64_000, 200_001];
const CALLS: u32 = 100;

/// Serves in a process of its own, in the domain in `DDS_SERVE`, until stdin ends; does nothing if it is not set. A
/// request states the length of its reply.
#[test]
fn serve() {
    let Ok(domain_id) = env::var("DDS_SERVE") else { return };
    let settings = DdsSettings { domain_id: domain_id.parse().unwrap(), ..DdsSettings::default() };
    let node = open_with(&settings, "node");
    let on_request = |request: &[u8]| {
        let length = u32::from_le_bytes(request.get(4..8)?.try_into().ok()?);
        Some(content(length))
    };
    let _server = node.serve(&trigger("/cell/node/reset"), Box::new(on_request)).unwrap();
    stdin().read_to_end(&mut Vec::new()).unwrap();
}

/// A reply of `length` bytes.
fn content(length: u32) -> Vec<u8> {
    let pixels = (4..length).map(|at| u8::try_from(at % 251).unwrap());
    [0, 1, 0, 0].into_iter().chain(pixels).collect()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut hex, byte| {
        write!(hex, "{byte:02x}").unwrap();
        hex
    })
}

fn request(length: u32) -> String {
    hex(&[&[0, 1, 0, 0][..], &length.to_le_bytes()].concat())
}

fn server(place: &Place, domain: &Domain) -> Peer {
    let mut command = place.command(&env::current_exe().unwrap());
    command.args(["--exact", "dds::large_replies::serve"]);
    Peer::spawn(command.env("DDS_SERVE", domain.id.to_string()))
}

fn calls(place: &Place, vendor: Vendor, domain: &Domain, length: u32) -> Option<Peer> {
    let (request, count) = (request(length), CALLS.to_string());
    let arguments = ["--request", &request, "--count", &count, "--seconds", "20"];
    Peer::start_in(place, vendor, domain, &[&["calls"][..], &SERVICE, &arguments].concat())
}

/// Every call is answered, by replies of every size.
fn all_are_answered(network: &Network, vendor: Vendor, sizes: &[u32]) {
    for &length in sizes {
        // One server each: clients that were killed leave no room after 256 replies.
        let domain = Domain::claim();
        let _server = server(&network.node, &domain);
        let Some(client) = calls(&network.client, vendor, &domain, length) else { return };
        let replies = client.wait_long_for("replies");
        assert_eq!(replies["count"], CALLS, "{vendor:?}: {length} bytes: {replies}");
        // Cyclone and RustDDS pad what is sent whole to four bytes.
        let bytes = [length, length.next_multiple_of(4)].map(|length| Json::from(length * CALLS));
        assert!(bytes.contains(&replies["bytes"]), "{vendor:?}: {length} bytes: {replies}");
        eprintln!("{vendor:?}, {length} bytes: {replies}");
    }
}

#[test]
fn they_arrive_on_this_machine() {
    for vendor in VENDORS {
        all_are_answered(&Network::HERE, vendor, &SIZES);
    }
}

#[test]
fn they_arrive_on_loopback_alone() {
    let Some(node) = loopback() else { return };
    for length in SIZES {
        // One server each, as in `all_are_answered`.
        let domain = Domain::claim();
        let _server = server(&node, &domain);
        let Some(client) = calls(&node, Vendor::FastDds, &domain, length) else { return };
        let replies = client.wait_long_for("replies");
        assert_eq!(replies["count"], CALLS, "{length} bytes: {replies}");
    }
}

#[test]
fn they_arrive_over_a_cable() {
    let Some(network) = Network::cable(0) else { return };
    for vendor in VENDORS {
        all_are_answered(&network, vendor, &SIZES);
    }
}

#[test]
fn they_arrive_although_datagrams_are_lost() {
    let Some(network) = Network::cable(5) else { return };
    // RustDDS alone sends the short ones again, and may take seconds.
    all_are_answered(&network, Vendor::FastDds, &SIZES[1..]);
}

/// Fragments are put together in order, each at its place.
#[test]
fn they_arrive_unchanged() {
    let domain = Domain::claim();
    let _server = server(&Place::Here, &domain);
    let length = 200_001;
    let request = request(length);
    let arguments = [&["call"][..], &SERVICE, &["--request", &request]].concat();
    let Some(client) = Peer::start(Vendor::FastDds, &domain, &arguments) else { return };
    assert!(client.wait_for("reply")["hex"] == hex(&content(length)));
}

/// A client that cannot read another's large reply is not kept waiting for it, and the history of the one that waits
/// does not fill with the others' replies.
#[test]
fn other_clients_get_theirs_meanwhile() {
    let domain = Domain::claim();
    let _server = server(&Place::Here, &domain);
    let clients: Option<Vec<_>> = [22_000, 100]
        .into_iter()
        .map(|length| calls(&Place::Here, Vendor::FastDds, &domain, length))
        .collect();
    for client in clients.into_iter().flatten() {
        let replies = client.wait_long_for("replies");
        assert_eq!(replies["count"], CALLS, "{replies}");
    }
}

/// Asks the node's own service; returns the reply without its header.
fn ask(
    network: &Network,
    vendor: Vendor,
    domain: &Domain,
    service: &str,
    message: &[u8],
) -> Option<Vec<u8>> {
    let topic = format!("/laser_profiler/{}", service_file(service));
    let kind = format!("rcl_interfaces::srv::dds_::{service}_");
    let message = hex(message);
    let arguments = ["call", "--topic", &topic, "--type", &kind, "--request", &message];
    let client = Peer::start_in(&network.client, vendor, domain, &arguments)?;
    let reply = client.wait_for("reply");
    let hex = reply["hex"].as_str().unwrap();
    let byte = |at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap();
    let reply: Vec<u8> = (0..hex.len()).step_by(2).map(byte).collect();
    // Cyclone's peer prints the body alone.
    Some(if vendor == Vendor::FastDds { reply[4..].to_vec() } else { reply })
}

/// `ListParameters` as `list_parameters`.
fn service_file(name: &str) -> String {
    let mut file = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !file.is_empty() {
            file.push('_');
        }
        file.push(letter.to_ascii_lowercase());
    }
    file
}

/// A sequence of strings in CDR.
fn strings(names: &[String]) -> Vec<u8> {
    let mut message = vec![0, 1, 0, 0];
    message.extend(u32::try_from(names.len()).unwrap().to_le_bytes());
    for name in names {
        message.resize(message.len().next_multiple_of(4), 0);
        message.extend(u32::try_from(name.len() + 1).unwrap().to_le_bytes());
        message.extend(name.as_bytes());
        message.push(0);
    }
    message
}

/// The names in a reply of `list_parameters`.
fn names(reply: &[u8]) -> Vec<String> {
    let u32_at = |at: usize| u32::from_le_bytes(reply[at..at + 4].try_into().unwrap()) as usize;
    let mut at = 4;
    let mut next = || {
        let from = at + 4;
        let until = from + u32_at(at) - 1;
        at = (until + 1).next_multiple_of(4);
        String::from_utf8(reply[from..until].to_vec()).unwrap()
    };
    (0..u32_at(0)).map(|_| next()).collect()
}

/// All parameters, as `ros2 param list`, `dump` and `describe` ask for them.
#[test]
fn a_client_on_fast_dds_reads_all_parameters_over_a_cable() {
    let Some(network) = Network::cable(0) else { return };
    let domain = Domain::claim();
    let mut command = network.node.command(Path::new(EXECUTABLE));
    command.args(["run", "--json"]).current_dir(env!("CARGO_MANIFEST_DIR"));
    let environment = [("ROS_DOMAIN_ID", domain.id.to_string())];
    let _node = Node::start_by(&mut command, &["--transport", "dds"], &environment);
    let everything = [&strings(&[])[..], &[0; 4], &[0; 8]].concat();
    let list = ask(&network, Vendor::FastDds, &domain, "ListParameters", &everything);
    let Some(reply) = list else { return };
    let names = names(&reply);
    assert!(names.len() > 60, "{names:?}");
    let names = strings(&names);
    for (service, message) in [
        ("ListParameters", &everything),
        ("DescribeParameters", &names),
        ("GetParameters", &names),
        ("GetParameterTypes", &names),
    ] {
        let [cyclone, fast_dds] = [Vendor::Cyclone, Vendor::FastDds]
            .map(|vendor| ask(&network, vendor, &domain, service, message));
        let (Some(cyclone), Some(fast_dds)) = (cyclone, fast_dds) else { return };
        let length = cyclone.len().min(fast_dds.len());
        assert_eq!(cyclone[..length], fast_dds[..length], "{service}");
        assert!(cyclone.len().abs_diff(fast_dds.len()) < 4, "{service}: padding alone differs");
        eprintln!("{service}: {} bytes", fast_dds.len());
    }
}
