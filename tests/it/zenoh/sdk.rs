//! `zenoh-ros2-sdk`, an independent implementation of `rmw_zenoh`'s conventions.

use std::sync::Arc;

use laser_profiler::{
    msg::{cdr, qos::QosProfile, schema::Message, sensor_msgs::Image},
    ros::transport::Transport,
};

use super::{
    network::{Inbox, Network, TOPIC, images, topic},
    peer::{Peer, wait_until},
};

fn sdk(network: &Network, command: &str) -> Peer {
    let port = network.port.to_string();
    let arguments = [command, &port, &network.domain, TOPIC, Image::TYPE.hash];
    Peer::start(network.python, "zenoh_sdk.py", &arguments)
}

#[test]
fn its_images_arrive_here() {
    let Some((network, _router)) = Network::start() else { return };
    let node = network.node();
    let inbox = Inbox::open(&node, &images(), usize::MAX);
    let mut publisher = sdk(&network, "publish");
    publisher.event("ready");
    wait_until("its publisher", || inbox.subscription.num_matched() == 1);
    publisher.send_line("send");
    for sequence in 0..3 {
        let arrival = inbox.next().unwrap();
        // It counts from 0, rmw_zenoh from 1.
        assert_eq!(arrival.sequence, Some(sequence));
        let image: Image<'_> = cdr::decode(&arrival.data).unwrap();
        assert_eq!((image.width, image.height, image.step), (4, 2, 4));
        assert_eq!(image.header.frame_id, "sdk");
        assert_eq!(image.data, [0, 1, 2, 3, 4, 5, 6, 7]);
    }
}

#[test]
fn our_images_arrive_there() {
    let Some((network, _router)) = Network::start() else { return };
    let node = network.node();
    let mut publication = node.advertise(&topic(Image::TYPE, QosProfile::reliable(5))).unwrap();
    let subscriber = sdk(&network, "subscribe");
    subscriber.event("ready");
    wait_until("its subscriber", || publication.num_matched() == 1);
    let image = Image {
        width: 3,
        height: 1,
        step: 3,
        encoding: "mono8".into(),
        data: &[9, 8, 7],
        ..Image::default()
    };
    let mut bytes = Vec::new();
    cdr::encode(&image, &mut bytes).unwrap();
    let bytes: Arc<[u8]> = bytes.into();
    // It announces itself before it subscribes.
    let mut message = None;
    wait_until("a message", || {
        publication.publish(&bytes, 5).unwrap();
        message = subscriber.try_event();
        message.is_some()
    });
    let message = message.unwrap();
    assert_eq!((&message["width"], &message["encoding"]), (&3.into(), &"mono8".into()));
    assert_eq!(message["data"], "090807");
}
