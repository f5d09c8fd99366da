//! Large images at the rate of a camera.

use std::{sync::Arc, time::Duration};

use laser_profiler::{
    msg::{cdr, qos::QosProfile, schema::Message, sensor_msgs::Image},
    ros::{transport::Transport, zenoh::Role},
};

use super::{
    network::{Inbox, Network, images, open, topic},
    peer::{Peer, wait_until},
};

const NUM_IMAGES: i64 = 44;
const WIDTH: u32 = 2592;
const HEIGHT: u32 = 2048;

#[test]
fn every_large_image_arrives() {
    let Some((network, _router)) = Network::start() else { return };
    let node = network.node();
    let inbox = Inbox::open(&node, &images(), 64 << 20);
    let count = NUM_IMAGES.to_string();
    let _sender = network.peer("send", &["--count", &count, "--linger", "60"]);
    let mut latencies_ns = Vec::new();
    for sequence in 1..=NUM_IMAGES {
        let arrival = inbox.next().unwrap();
        latencies_ns.push(arrival.receive_time_ns - arrival.source_time_ns);
        assert_eq!(arrival.sequence, Some(sequence));
        let image: Image<'_> = cdr::decode(&arrival.data).unwrap();
        assert_eq!((image.width, image.height), (WIDTH, HEIGHT));
    }
    latencies_ns.sort_unstable();
    let part = |part: usize| latencies_ns[latencies_ns.len() * part / 100] / 1000;
    eprintln!("{NUM_IMAGES} images: sent to here p50 {} us, p99 {} us", part(50), part(99));
}

/// With shared memory at both ends, large messages do not go through sockets.
#[test]
fn shared_memory_is_used_where_both_ends_have_it() {
    let Some((network, _router)) = Network::start() else { return };
    let shared = "transport/shared_memory/enabled=true";
    let node = open(&network.settings(Role::Node, shared));
    let with = receiver(&network, &["--config", shared]);
    let without = receiver(&network, &[]);
    let mut publication = node.advertise(&topic(Image::TYPE, QosProfile::reliable(5))).unwrap();
    wait_until("both receivers", || publication.num_matched() == 2);
    let pixels = vec![3; (WIDTH * HEIGHT) as usize];
    let image =
        Image { width: WIDTH, height: HEIGHT, step: WIDTH, data: &pixels, ..Image::default() };
    let mut bytes = Vec::new();
    cdr::encode(&image, &mut bytes).unwrap();
    let bytes: Arc<[u8]> = bytes.into();
    for _ in 0..10 {
        publication.publish(&bytes, 0).unwrap();
        std::thread::sleep(Duration::from_millis(45));
    }
    for (peer, is_shared) in [(with, true), (without, false)] {
        let received = peer.event("received");
        assert_eq!(
            (&received["received"], &received["lost"]),
            (&10.into(), &0.into()),
            "{received}"
        );
        // Messages that do not fit into the pool go through the socket.
        assert_eq!(received["in_shared_memory"] != 0, is_shared, "{received}");
        assert_eq!(received["bytes"], 10 * bytes.len());
    }
}

fn receiver(network: &Network, arguments: &[&str]) -> Peer {
    let receiver = network.peer("receive", &[&["--count", "10"], arguments].concat());
    receiver.event("ready");
    receiver
}
