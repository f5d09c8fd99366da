//! A relay drops messages. The sequence numbers of the received ones reveal the exact number of losses.

use std::collections::BTreeMap;

use laser_profiler::msg::{schema::Message, sensor_msgs::Image};

use super::network::{Inbox, Network, TOPIC, images};

const NUM_SENT: &str = "500";
const BEFORE: &str = "/camera/before";

/// Numbers that are missing between the first and the last of each sender.
fn num_missing(sequences: &BTreeMap<[u8; 16], Vec<i64>>) -> i64 {
    let missing = |of_one: &Vec<i64>| {
        of_one
            .windows(2)
            .map(|pair| pair[1] - pair[0] - 1)
            .inspect(|gap| assert!(*gap >= 0))
            .sum::<i64>()
    };
    sequences.values().map(missing).sum()
}

fn detected_is_injected(loss_percent: &str) {
    let Some((network, _router)) = Network::start() else { return };
    let node = network.node();
    let inbox = Inbox::open(&node, &images(), usize::MAX);
    let (kind, from) = (Image::TYPE, ["--topic", BEFORE, "--count", NUM_SENT]);
    let to = ["--to", TOPIC, "--type", kind.name, "--hash", kind.hash, "--loss", loss_percent];
    let relay = network.peer("relay", &[&from[..], &to].concat());
    relay.event("ready");
    let small = ["--fps", "250", "--width", "64", "--height", "48", "--linger", "60"];
    let _sender = network.peer("send", &[&from[..], &small].concat());
    let relayed = relay.event("relayed");
    let (forwarded, injected) = (&relayed["forwarded"], relayed["injected"].as_i64().unwrap());
    let mut sequences = BTreeMap::<_, Vec<_>>::new();
    for _ in 0..forwarded.as_u64().unwrap() {
        let arrival = inbox.next().unwrap();
        sequences.entry(arrival.publisher).or_default().push(arrival.sequence.unwrap());
    }
    assert_eq!(sequences.len(), 1);
    assert_eq!(num_missing(&sequences), injected);
    assert!(injected > 0, "nothing was lost");
}

#[test]
fn one_percent_loss_is_counted() {
    detected_is_injected("1");
}

#[test]
fn two_percent_loss_is_counted() {
    detected_is_injected("2");
}

#[test]
fn five_percent_loss_is_counted() {
    detected_is_injected("5");
}

#[test]
fn ten_percent_loss_is_counted() {
    detected_is_injected("10");
}
