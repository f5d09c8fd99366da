//! Joining a domain, finding others there, and leaving.

use std::{fs, net::UdpSocket, process::Command};

use laser_profiler::{
    msg::qos::QosProfile,
    ros::{
        dds::{DdsSettings, DdsTransport, DiscoveryRange},
        transport::{NodeIdentity, Transport, TransportError},
    },
};

use super::{
    domain::Domain,
    node::{Inbox, eventually, image_topic, open, open_with, settings, wait_for_subscribers},
    peer::{Peer, Vendor},
};
use crate::program::skip;

const ARGUMENTS: [&str; 7] =
    ["subscribe", "--topic", "rt/x", "--reliable", "--count", "1000000", "--seconds"];

#[test]
fn a_dropped_node_leaves_the_graph_at_once() {
    let domain = Domain::claim();
    let (node, other) = (open(&domain, "node"), open(&domain, "other"));
    let topic = image_topic("/x", QosProfile::reliable(5));
    let publication = node.advertise(&topic).unwrap();
    let inbox = Inbox::open(&other, &topic, 1000);
    wait_for_subscribers(&*publication, 1);
    // Endpoints keep their node alive: the domain is left when the last one is dropped.
    drop(other);
    assert_eq!(publication.num_matched(), 1);
    drop(inbox);
    wait_for_subscribers(&*publication, 0);
}

/// In its own process, where no other test starts or ends threads.
#[test]
fn no_thread_and_no_socket_stays_behind() {
    let ended = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "dds::discovery::comes_and_goes", "--include-ignored", "--nocapture"])
        .env("DDS_COMES_AND_GOES", "1")
        .output()
        .unwrap();
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stdout));
}

fn count(directory: &str) -> usize {
    fs::read_dir(directory).unwrap().count()
}

#[test]
fn comes_and_goes() {
    if std::env::var_os("DDS_COMES_AND_GOES").is_none() {
        return;
    }
    let before = (count("/proc/self/task"), count("/proc/self/fd"));
    for _ in 0..3 {
        let domain = Domain::claim();
        let node = open(&domain, "node");
        let topic = image_topic("/x", QosProfile::reliable(5));
        let _publication = node.advertise(&topic).unwrap();
        let _inbox = Inbox::open(&node, &topic, 1000);
        assert!(count("/proc/self/task") > before.0);
    }
    assert_eq!((count("/proc/self/task"), count("/proc/self/fd")), before);
}

#[test]
fn an_occupied_domain_is_refused_with_advice() {
    let domain = Domain::claim();
    let ports = (0..120).map(|participant| 7410 + 250 * domain.id + 2 * participant);
    let _taken: Vec<_> = ports.map(|port| UdpSocket::bind(("0.0.0.0", port)).unwrap()).collect();
    let identity = NodeIdentity { name: "node".to_owned(), namespace: "/".to_owned() };
    let error = DdsTransport::open(&settings(&domain), &identity).err().unwrap();
    assert!(matches!(error, TransportError::Unreachable(_)), "{error}");
    let message = error.to_string();
    let words = [format!("DDS domain {}", domain.id), "ROS_DOMAIN_ID".to_owned()];
    assert!(words.iter().all(|word| message.contains(word)), "{message}");
}

#[test]
fn nodes_on_one_machine_discover_each_other_on_localhost() {
    let domain = Domain::claim();
    let here = DdsSettings { range: DiscoveryRange::Localhost, ..settings(&domain) };
    let (node, other) = (open_with(&here, "node"), open_with(&here, "other"));
    let topic = image_topic("/x", QosProfile::reliable(5));
    let publication = node.advertise(&topic).unwrap();
    let _inbox = Inbox::open(&other, &topic, 1000);
    wait_for_subscribers(&*publication, 1);
}

#[test]
fn on_localhost_the_ports_are_closed_to_other_machines() {
    let domain = Domain::claim();
    let here = DdsSettings { range: DiscoveryRange::Localhost, ..settings(&domain) };
    let _node = open_with(&here, "node");
    // `ss` shows the device as in 0.0.0.0%lo:7410.
    let Ok(listed) = Command::new("ss").args(["-H", "-u", "-l", "-n", "-p"]).output() else {
        return skip("the ports of a node on localhost", "there is no ss (Debian: iproute2)");
    };
    let listed = String::from_utf8(listed.stdout).unwrap();
    let own = format!("pid={},", std::process::id());
    let first = 7400 + 250 * u32::from(domain.id);
    let in_domain = |address: &&str| {
        let port = address.rsplit(':').next().and_then(|port| port.parse::<u32>().ok());
        port.is_some_and(|port| (first..first + 250).contains(&port))
    };
    let lines = listed.lines().filter(|line| line.contains(&own));
    let ports: Vec<_> = lines.filter_map(|line| line.split_whitespace().nth(3)).collect();
    let ports: Vec<_> = ports.into_iter().filter(in_domain).collect();
    assert!(ports.len() >= 2, "{listed}");
    assert!(ports.iter().all(|port| port.contains("%lo:")), "{ports:?}");
}

/// A Cyclone participant without multicast and peers, on ports above those that RustDDS tries.
fn hidden_peer(domain: &Domain) -> Option<Peer> {
    let configuration = "<CycloneDDS><Domain><General><AllowMulticast>false</AllowMulticast></General><Discovery>\
                         <ParticipantIndex>25</ParticipantIndex></Discovery></Domain></CycloneDDS>";
    let mut arguments = ARGUMENTS.to_vec();
    arguments.push("60");
    Peer::start_with(Vendor::Cyclone, domain, &arguments, &[("CYCLONEDDS_URI", configuration)])
}

#[test]
fn a_static_peer_is_found_where_multicast_does_not_reach() {
    let domain = Domain::claim();
    let Some(_peer) = hidden_peer(&domain) else { return };
    let topic = image_topic("/x", QosProfile::reliable(5));
    let apart = open(&domain, "apart");
    let without_peer = apart.advertise(&topic).unwrap();
    let with_peer = DdsSettings { static_peers: vec!["127.0.0.1".to_owned()], ..settings(&domain) };
    let node = open_with(&with_peer, "node");
    let publication = node.advertise(&topic).unwrap();
    wait_for_subscribers(&*publication, 1);
    assert_eq!(without_peer.num_matched(), 0, "without naming the peer it is not discovered");
    drop((publication, node));
    // The peer also receives the farewell, so it discovers a second node like the first.
    let again = open_with(&with_peer, "again");
    let publication = again.advertise(&topic).unwrap();
    eventually("it is found again", || publication.num_matched() == 1);
}

#[test]
fn a_peer_without_an_address_is_refused() {
    let domain = Domain::claim();
    let peer = "no.such.host.invalid".to_owned();
    let wrong = DdsSettings { static_peers: vec![peer], ..settings(&domain) };
    let identity = NodeIdentity { name: "node".to_owned(), namespace: "/".to_owned() };
    let error = DdsTransport::open(&wrong, &identity).err().unwrap().to_string();
    assert!(error.contains("ROS_STATIC_PEERS") && error.contains("no.such.host"), "{error}");
}
