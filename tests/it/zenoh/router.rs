//! Routers that are late, die, come back, or are this node itself.

use std::{
    env,
    net::TcpListener,
    sync::mpsc::sync_channel,
    thread,
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use laser_profiler::{
    msg::qos::QosProfile,
    ros::{
        transport::{Publication, Transport},
        zenoh::{Role, RouterCheck, ZenohTransport},
    },
};

use super::{
    network::{Inbox, Network, header, headers, identity, images, open},
    peer::{DEADLINE, Peer, wait_until},
};

const BACK_WITHIN: Duration = Duration::from_secs(5);

fn now_ns() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos().try_into().unwrap()
}

/// Publishes until the listener has one that was sent after `since_ns`.
fn until_heard(publication: &mut dyn Publication, listener: &Peer, since_ns: i64) {
    wait_until("a message at the listener", || {
        publication.publish(&header("tick"), now_ns()).unwrap();
        std::iter::from_fn(|| listener.try_event())
            .any(|event| event["source_time_ns"].as_i64().is_some_and(|time| time > since_ns))
    });
}

/// Clients in Python have no other way to us than the router. `ROUTER_KILLS` sets the number of kills.
#[test]
fn data_flows_again_when_the_router_is_replaced() {
    let Some((network, mut router)) = Network::start() else { return };
    let node = network.node();
    let mut publication = node.advertise(&headers(QosProfile::reliable(10))).unwrap();
    let inbox = Inbox::open(&node, &images(), usize::MAX);
    let listener = network.header_peer("listen", &["--mode", "client"]);
    listener.event("ready");
    until_heard(&mut *publication, &listener, 0);
    let _sender = network.peer(
        "send",
        &["--mode", "client", "--width", "64", "--height", "48", "--fps", "50", "--seconds", "600"],
    );
    inbox.next().unwrap();
    let num_kills = env::var("ROUTER_KILLS").map_or(10, |text| text.parse().unwrap());
    let mut longest = Duration::ZERO;
    for round in 1..=num_kills {
        router.kill();
        let (killed, killed_ns) = (Instant::now(), now_ns());
        router = network.router();
        let ready = killed.elapsed();
        until_heard(&mut *publication, &listener, killed_ns);
        while inbox.next().unwrap().source_time_ns < killed_ns {}
        let back = killed.elapsed();
        eprintln!("round {round}: router ready after {ready:?}, data both ways after {back:?}");
        assert!(back <= BACK_WITHIN);
        longest = longest.max(back);
    }
    eprintln!("{num_kills} kills, data both ways after {longest:?} at most");
}

#[test]
fn a_router_may_come_later() {
    let Some(network) = Network::without_router() else { return };
    let node = network.node();
    let mut publication = node.advertise(&headers(QosProfile::reliable(10))).unwrap();
    let _router = network.router();
    let listener = network.header_peer("listen", &["--mode", "client"]);
    until_heard(&mut *publication, &listener, 0);
}

#[test]
fn opening_waits_for_a_router_if_configured() {
    let Some(network) = Network::without_router() else { return };
    let mut settings = network.settings(Role::Node, "");
    settings.router_check = RouterCheck::Forever;
    let (opened, is_open) = sync_channel(1);
    thread::spawn(move || opened.send(open(&settings)));
    assert!(is_open.recv_timeout(Duration::from_secs(2)).is_err(), "there is no router yet");
    let _router = network.router();
    is_open.recv_timeout(DEADLINE).unwrap();
}

/// A small cell: this node is the router of a camera and a viewer.
#[test]
fn the_node_itself_is_a_router() {
    let Some(network) = Network::without_router() else { return };
    let node = open(&network.settings(Role::Router, ""));
    let mut publication = node.advertise(&headers(QosProfile::reliable(10))).unwrap();
    let inbox = Inbox::open(&node, &images(), usize::MAX);
    let viewer = network.peer("receive", &["--mode", "client", "--count", "5"]);
    viewer.event("ready");
    let listener = network.header_peer("listen", &[]);
    let _camera = network.peer(
        "send",
        &[
            "--mode",
            "client",
            "--width",
            "64",
            "--height",
            "48",
            "--count",
            "5",
            "--subscribers",
            "2",
        ],
    );
    for sequence in 1..=5 {
        assert_eq!(inbox.next().unwrap().sequence, Some(sequence));
    }
    let received = viewer.event("received");
    assert_eq!((&received["received"], &received["lost"]), (&5.into(), &0.into()), "{received}");
    listener.event("ready");
    until_heard(&mut *publication, &listener, 0);
}

#[test]
fn an_occupied_port_is_named() {
    let Some(mut network) = Network::without_router() else { return };
    let occupied = TcpListener::bind("127.0.0.1:0").unwrap();
    network.port = occupied.local_addr().unwrap().port();
    let error =
        ZenohTransport::open(&network.settings(Role::Router, ""), &identity()).err().unwrap();
    let message = error.to_string();
    let port = format!("tcp/127.0.0.1:{}", network.port);
    assert!(message.contains(&port) && message.contains("omit --router"), "{message}");
}
