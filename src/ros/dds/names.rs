//! Converts names of topics, services and types between ROS and DDS.

use ros2_client::{Name, NodeName};

use crate::ros::transport::{NodeIdentity, TransportError};

/// Prefix of topics.
const TOPIC: &str = "rt";
/// Prefix of a service's requests.
const REQUESTS: &str = "rq";

/// Converts the node's name for ros2-client.
///
/// # Errors
/// A name that ROS does not allow.
pub(super) fn node_name(node: &NodeIdentity) -> Result<NodeName, TransportError> {
    NodeName::new(&node.namespace, &node.name).map_err(|error| TransportError::Endpoint {
        name: node.name.clone(),
        reason: error.to_string(),
    })
}

/// Converts `/camera/image_raw` to `rt/camera/image_raw`.
///
/// # Errors
/// A name that ROS does not allow.
pub(super) fn topic(name: &str, node: &NodeName) -> Result<String, TransportError> {
    parse(name).map(|parsed| parsed.to_dds_name(TOPIC, node, ""))
}

/// Returns the topics of a service's requests and replies: `rq/node/resetRequest` and `rr/node/resetReply` for
/// `/node/reset`.
///
/// # Errors
/// A name that ROS does not allow.
pub(super) fn service(name: &str, node: &NodeName) -> Result<(String, String), TransportError> {
    let parsed = parse(name)?;
    Ok((parsed.to_dds_name(REQUESTS, node, "Request"), parsed.to_dds_name("rr", node, "Reply")))
}

/// Returns true for the topic of a service's requests.
pub(super) fn is_requests(topic: &str) -> bool {
    topic.strip_prefix(REQUESTS).is_some_and(|rest| rest.starts_with('/'))
}

fn parse(name: &str) -> Result<Name, TransportError> {
    Name::parse(name).map_err(|error| TransportError::Endpoint {
        name: name.to_owned(),
        reason: error.to_string(),
    })
}

/// Converts `sensor_msgs/msg/Image` to `sensor_msgs::msg::dds_::Image_`; `suffix` is `_Request` or `_Response` for
/// services.
pub(super) fn type_name(name: &str, suffix: &str) -> String {
    let (package, plain) = name.rsplit_once('/').unwrap_or(("", name));
    format!("{}::dds_::{plain}{suffix}_", package.replace('/', "::"))
}

/// Returns the ROS name of a DDS topic; `None` if it is not a ROS topic, or belongs to a service.
pub(super) fn ros_topic(name: &str) -> Option<&str> {
    name.strip_prefix(TOPIC).filter(|rest| rest.starts_with('/'))
}

/// Returns the ROS name of a DDS type; `None` if it is not a ROS type.
pub(super) fn ros_type(name: &str) -> Option<String> {
    let (package, plain) = name.split_once("::dds_::")?;
    Some(format!("{}/{}", package.replace("::", "/"), plain.strip_suffix('_')?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node() -> NodeName {
        NodeName::new("/cell", "laser_profiler").unwrap()
    }

    #[test]
    fn topics_and_types_are_converted_both_ways() {
        let name = topic("/camera/image_raw", &node()).unwrap();
        assert_eq!(name, "rt/camera/image_raw");
        assert_eq!(ros_topic(&name), Some("/camera/image_raw"));
        let kind = type_name("sensor_msgs/msg/Image", "");
        assert_eq!(kind, "sensor_msgs::msg::dds_::Image_");
        assert_eq!(ros_type(&kind).as_deref(), Some("sensor_msgs/msg/Image"));
    }

    #[test]
    fn services_have_two_topics() {
        let names = service("/laser_profiler/reset", &node()).unwrap();
        assert_eq!(names.0, "rq/laser_profiler/resetRequest");
        assert_eq!(names.1, "rr/laser_profiler/resetReply");
        let request = type_name("std_srvs/srv/Trigger", "_Request");
        assert_eq!(request, "std_srvs::srv::dds_::Trigger_Request_");
    }

    #[test]
    fn other_names_have_no_ros_name() {
        assert_eq!(ros_topic("rq/laser_profiler/resetRequest"), None);
        assert_eq!(ros_topic("ros_discovery_info"), None);
        assert_eq!(ros_topic("rtx/y"), None);
        assert_eq!(ros_type("HelloWorld"), None);
        assert_eq!(ros_type("a::dds_::NoUnderscore"), None);
    }

    #[test]
    fn names_that_ros_does_not_allow_are_rejected() {
        for name in ["/camera//image", "/camera/", "/1st", "/a b", ""] {
            let error = topic(name, &node()).unwrap_err();
            assert!(matches!(error, TransportError::Endpoint { .. }), "{name}: {error}");
        }
    }
}
