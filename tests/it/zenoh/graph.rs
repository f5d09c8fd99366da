//! The graph as each side sees it.

use laser_profiler::{
    msg::{qos::QosProfile, schema::Message, sensor_msgs::Image, std_msgs::Header},
    ros::transport::{GraphTopic, Transport},
};

use super::{
    network::{Inbox, Network, TOPIC, header, headers, images},
    peer::wait_until,
};

fn on_topic(type_name: &str, num_publishers: usize, num_subscribers: usize) -> GraphTopic {
    let (name, type_name) = (TOPIC.to_owned(), type_name.to_owned());
    GraphTopic { name, type_name, num_publishers, num_subscribers }
}

#[test]
fn topics_of_all_nodes_are_known() {
    let Some((network, _router)) = Network::start() else { return };
    let early = network.header_peer("listen", &[]);
    early.event("ready");
    let node = network.node();
    let _publication = node.advertise(&headers(QosProfile::reliable(1))).unwrap();
    let _inbox = Inbox::open(&node, &images(), usize::MAX);
    let late = network.header_peer("listen", &[]);
    late.event("ready");
    let expected = [on_topic(Image::TYPE.name, 0, 1), on_topic(Header::TYPE.name, 1, 2)];
    wait_until("all endpoints", || node.topics() == expected);
    drop((early, late));
    let expected = [on_topic(Image::TYPE.name, 0, 1), on_topic(Header::TYPE.name, 1, 0)];
    wait_until("only our own endpoints", || node.topics() == expected);
}

#[test]
fn tokens_of_later_versions_do_no_harm() {
    let Some((network, _router)) = Network::start() else { return };
    let node = network.node();
    let domain = &network.domain;
    let unknown = format!("@ros2_lv/{domain}/ZID/0/1/ZZ/%/%/peer/what/ever");
    let longer = format!(
        "@ros2_lv/{domain}/ZID/0/2/MP/%/%/peer/%cell%topic/std_msgs::msg::dds_::Header_/RIHS02_1/::,1:::x/more"
    );
    let tokens = [&unknown, &longer].map(|token| network.peer("token", &["--to", token]));
    for peer in &tokens {
        peer.event("ready");
    }
    wait_until("the publisher", || node.topics() == [on_topic(Header::TYPE.name, 1, 0)]);
}

/// Our tokens as Python sees them, and our identity as another library computes it.
#[test]
fn others_see_us() {
    let Some((network, _router)) = Network::start() else { return };
    let node = network.node();
    let listener = network.header_peer("listen", &[]);
    listener.event("ready");
    let mut publication = node.advertise(&headers(QosProfile::latched(3))).unwrap();
    let inbox = Inbox::open(&node, &images(), usize::MAX);
    wait_until("a subscriber", || publication.num_matched() == 1);
    publication.publish(&header("mine"), 1).unwrap();
    let gid = listener.event("message")["gid"].clone();

    let mut watcher = network.header_peer("graph", &["--node", "laser_profiler"]);
    watcher.send_line("3");
    let seen = watcher.event("tokens");
    let tokens = seen["tokens"].as_object().unwrap();
    let ours: Vec<_> =
        tokens.keys().filter_map(|token| token.split_once("/%cell/laser_profiler")).collect();
    let (header_hash, image_hash) = (Header::TYPE.hash, Image::TYPE.hash);
    let rest = |number: usize| ours[number].1.to_owned();
    assert!(ours[0].0.ends_with("/0/0/NN/%"), "{ours:?}");
    assert!(ours[1].0.ends_with("/0/1/MP/%"), "{ours:?}");
    assert!(ours[2].0.ends_with("/0/2/MS/%"), "{ours:?}");
    assert_eq!(rest(0), "");
    let header = format!("/%cell%topic/std_msgs::msg::dds_::Header_/{header_hash}/:1:,3:,:,:,,");
    assert_eq!(rest(1), header);
    let image = format!(
        "/%cell%topic/sensor_msgs::msg::dds_::Image_/{image_hash}/2::,5:,:,:,,/backends:cpu:"
    );
    assert_eq!(rest(2), image);
    let publisher = tokens.iter().find(|(token, _)| token.contains("/0/1/MP/")).unwrap();
    assert_eq!(*publisher.1, gid, "XXH3-128 of the token");

    drop((inbox, publication, node));
    watcher.send_line("0");
    watcher.event("tokens");
}
