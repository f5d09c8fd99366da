//! Services, called from Python.

use std::sync::mpsc::sync_channel;

use laser_profiler::{
    msg::{qos::QosProfile, schema::ServiceType},
    ros::transport::{OnRequest, Server, ServiceEndpoint, Transport},
};

use super::{
    network::{Inbox, Network, TOPIC, headers},
    peer::{DEADLINE, Peer},
};

static TRIGGER: ServiceType = ServiceType {
    name: "std_srvs/srv/Trigger",
    text: "---\nbool success\nstring message\n",
    hash: "RIHS01_eeff2cd6fe5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
};

fn serve(node: &dyn Transport, on_request: OnRequest) -> Box<dyn Server> {
    let endpoint = ServiceEndpoint { name: TOPIC.to_owned(), kind: &TRIGGER };
    node.serve(&endpoint, on_request).unwrap()
}

/// A client with a request of two bytes.
fn client(network: &Network, arguments: &[&str]) -> Peer {
    let own = ["--type", TRIGGER.name, "--hash", TRIGGER.hash, "--payload", "0a0b"];
    let client = network.peer("call", &[&own, arguments].concat());
    client.event("ready");
    client
}

#[test]
fn answers_carry_the_number_of_their_request() {
    let Some((network, _router)) = Network::start() else { return };
    let node = network.node();
    let mut num_requests = 0;
    let server = serve(
        &node,
        Box::new(move |request| {
            num_requests += 1;
            Some([request, &[num_requests]].concat())
        }),
    );
    let mut client = client(&network, &[]);
    client.send_line("3");
    for expected in ["0a0b01", "0a0b02", "0a0b03"] {
        let answer = client.event("answer");
        assert_eq!((&answer["payload"], &answer["is_echo"]), (&expected.into(), &true.into()));
    }
    client.event("done");
    drop(server);
    client.send_line("1");
    client.event("done");
}

#[test]
fn malformed_requests_are_rejected_with_a_reason() {
    let Some((network, _router)) = Network::start() else { return };
    let node = network.node();
    let _server = serve(&node, Box::new(|_| None));
    let mut good = client(&network, &[]);
    good.send_line("1");
    assert_eq!(good.event("refused")["reason"], "the request is malformed");
    for (format, reason) in [("none", "no attachment"), ("old", "before 0.2.5")] {
        let mut bad = client(&network, &["--attachment", format]);
        bad.send_line("1");
        let refused = bad.event("refused");
        assert!(refused["reason"].as_str().unwrap().contains(reason), "{refused}");
    }
}

/// While a service takes its time, messages arrive.
#[test]
fn a_slow_service_holds_nothing_else_up() {
    let Some((network, _router)) = Network::start() else { return };
    let node = network.node();
    let (started, has_started) = sync_channel(1);
    let (go_on, may_go_on) = sync_channel(1);
    let _server = serve(
        &node,
        Box::new(move |request| {
            started.send(()).unwrap();
            may_go_on.recv_timeout(DEADLINE).unwrap();
            Some(request.to_vec())
        }),
    );
    let inbox = Inbox::open(&node, &headers(QosProfile::reliable(10)), usize::MAX);
    let mut client = client(&network, &[]);
    client.send_line("1");
    has_started.recv_timeout(DEADLINE).unwrap();
    let talker = network.header_peer("talk", &["--count", "3"]);
    talker.event("sent");
    for sequence in 1..=3 {
        assert_eq!(inbox.next().unwrap().sequence, Some(sequence));
    }
    go_on.send(()).unwrap();
    assert_eq!(client.event("answer")["payload"], "0a0b");
}
