//! A client that sends what Zenoh itself would never send.

use std::{
    io::{Read, Write},
    net::{Shutdown, TcpListener, TcpStream},
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
};

use laser_profiler::msg::{laser_profiler_msgs::Centerline, schema::Message};

use super::{
    network::{Network, TOPIC},
    peer::wait_until,
};
use crate::live::{Node, frames};

/// Passes connections on, with every key damaged on the way to the server: `c*ll` is no valid chunk.
fn damaging_proxy(to: u16, num_damaged: &Arc<AtomicUsize>) -> u16 {
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = listener.local_addr().unwrap().port();
    let num_damaged = Arc::clone(num_damaged);
    thread::spawn(move || {
        for client in listener.incoming().flatten() {
            let Ok(server) = TcpStream::connect(("127.0.0.1", to)) else { return };
            let (back, forth) = (server.try_clone().unwrap(), client.try_clone().unwrap());
            let num_damaged = Arc::clone(&num_damaged);
            thread::spawn(move || pass(back, client, |_| {}));
            thread::spawn(move || pass(forth, server, move |bytes| damage(bytes, &num_damaged)));
        }
    });
    port
}

fn pass(mut from: TcpStream, mut to: TcpStream, change: impl Fn(&mut [u8])) {
    let mut buffer = vec![0; 65_536];
    while let Ok(length @ 1..) = from.read(&mut buffer) {
        change(&mut buffer[..length]);
        if to.write_all(&buffer[..length]).is_err() {
            break;
        }
    }
    // The other direction ends, too.
    drop((from.shutdown(Shutdown::Both), to.shutdown(Shutdown::Both)));
}

fn damage(bytes: &mut [u8], num_damaged: &AtomicUsize) {
    for at in 0..bytes.len().saturating_sub(4) {
        if bytes[at..].starts_with(b"cell") {
            bytes[at + 1] = b'*';
            num_damaged.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// Zenoh may refuse it, or lose a thread so that the process is replaced: images of others are measured.
#[test]
fn an_invalid_key_does_not_end_the_node() {
    let Some(network) = Network::without_router() else { return };
    let listen = format!("listen/endpoints=[\"tcp/127.0.0.1:{}\"]", network.port);
    let environment =
        [("ROS_DOMAIN_ID", network.domain.clone()), ("ZENOH_CONFIG_OVERRIDE", listen)];
    let remap = format!("image_raw:={TOPIC}");
    let arguments = ["--transport", "zenoh", "--router", "--ros-args", "-r", &remap];
    let node = Node::start(&arguments, &environment);
    let num_damaged = Arc::default();
    let port = damaging_proxy(network.port, &num_damaged);
    let hostile = Network { python: network.python, port, domain: network.domain.clone() };
    let client = ["--mode", "client"];
    let images = "--width 64 --height 48 --fps 100 --count 50";
    let images: Vec<_> = images.split(' ').chain(client).collect();
    let attacker = hostile.peer("send", &images);
    wait_until("a damaged key", || num_damaged.load(Ordering::Relaxed) > 0);
    drop(attacker);
    let kind = Centerline::TYPE;
    let result = "/laser_profiler/centerline";
    let wanted = ["--topic", result, "--type", kind.name, "--hash", kind.hash, "--last", "50"];
    let receiver = network.peer("receive", &[&client[..], &wanted].concat());
    receiver.event("ready");
    let _sender = network.peer("send", &images);
    assert!(receiver.event("received")["received"].as_u64().unwrap() > 0);
    let (_, words, _) = node.end();
    assert!(frames(&words)[1] > 0, "{words}");
}
