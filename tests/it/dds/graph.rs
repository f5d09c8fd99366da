//! The graph as others see the node, and as the node sees others.

use laser_profiler::{
    msg::qos::QosProfile,
    ros::transport::{GraphTopic, Transport},
};
use serde_json::json;

use super::{
    domain::Domain,
    node::{Inbox, eventually, image_topic, open, trigger},
    peer::Peer,
};

const IMAGE: &str = "sensor_msgs::msg::dds_::Image_";

/// Endpoints are identified by GUID; the peer looks up their topics itself.
#[test]
fn others_learn_which_endpoints_are_the_node_s() {
    let domain = Domain::claim();
    let Some(peer) = Peer::python("graph", &domain, &["/cell/profiler"]) else { return };
    let node = open(&domain, "profiler");
    let topic = |name| image_topic(name, QosProfile::reliable(5));
    let publication = node.advertise(&topic("/cell/out")).unwrap();
    let _inbox = Inbox::open(&node, &topic("/cell/in"), 1000);
    let server = node.serve(&trigger("/cell/reset"), Box::new(|_| None)).unwrap();
    let read = format!("rt/cell/in {IMAGE}");
    let written = format!("rt/cell/out {IMAGE}");
    let request = "rq/cell/resetRequest std_srvs::srv::dds_::Trigger_Request_";
    let reply = "rr/cell/resetReply std_srvs::srv::dds_::Trigger_Response_";
    peer.wait_until(|line| {
        line["readers"] == json!([request, read]) && line["writers"] == json!([reply, written])
    });
    drop((publication, server));
    peer.wait_until(|line| line["readers"] == json!([read]) && line["writers"] == json!([]));
}

#[test]
fn the_node_sees_its_own_topics_and_those_of_others() {
    let domain = Domain::claim();
    let (node, other) = (open(&domain, "node"), open(&domain, "other"));
    let topic = |name| image_topic(name, QosProfile::reliable(5));
    let _own = node.advertise(&topic("/a")).unwrap();
    let _server = node.serve(&trigger("/reset"), Box::new(|_| None)).unwrap();
    let _inbox = Inbox::open(&other, &topic("/a"), 1000);
    let theirs = other.advertise(&topic("/b")).unwrap();
    let entry = |name: &str, num_publishers, num_subscribers| GraphTopic {
        name: name.to_owned(),
        type_name: "sensor_msgs/msg/Image".to_owned(),
        num_publishers,
        num_subscribers,
    };
    let expected = [entry("/a", 1, 1), entry("/b", 1, 0)];
    eventually("both topics are seen", || node.topics() == expected);
    drop(theirs);
    eventually("one goes", || node.topics() == [entry("/a", 1, 1)]);
}
