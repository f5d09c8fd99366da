//! The topics that the node publishes, with the metadata that recordings need.

use crate::{
    bag::Topic,
    msg::{
        diagnostic_msgs::DiagnosticArray,
        foxglove_msgs::ImageAnnotations,
        laser_profiler_msgs::{Centerline, Profile, SliceInfo, StreamStatus},
        qos::QosProfile,
        schema::{Message, MessageType},
        sensor_msgs::{Image, PointCloud2},
        tf2_msgs::TFMessage,
    },
    ros::{
        names::{NameError, NodeNames},
        transport::TopicEndpoint,
    },
    scanner::calibration::Calibration,
};

/// A published topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub(crate) enum Output {
    /// The centreline of every frame.
    Centerline,
    /// The centreline over the image, for viewers.
    Annotations,
    /// Counters of the stream.
    StreamStatus,
    /// Status of the stream.
    Diagnostics,
    /// The metric profile of every frame.
    Profile,
    /// A slice as an organised cloud.
    Points,
    /// The same slice without missing points.
    PointsDense,
    /// Description of a slice.
    SliceInfo,
    /// The heights of a scan.
    HeightMap,
    /// The pose of the laser plane, in a recording of one camera's results. On a network the node publishes those of all
    /// cameras together.
    StaticTf,
}

/// Every topic in the order of [`Output`]: those after [`Output::Diagnostics`] need a calibration.
const OUTPUTS: [(Output, &str, &MessageType, QosProfile); 9] = [
    (Output::Centerline, "~/centerline", Centerline::TYPE, QosProfile::reliable(10)),
    (Output::Annotations, "~/annotations", ImageAnnotations::TYPE, QosProfile::reliable(10)),
    (Output::StreamStatus, "~/stream_status", StreamStatus::TYPE, QosProfile::latched(1)),
    (Output::Diagnostics, "/diagnostics", DiagnosticArray::TYPE, QosProfile::reliable(10)),
    (Output::Profile, "~/profile", Profile::TYPE, QosProfile::reliable(10)),
    (Output::Points, "~/points", PointCloud2::TYPE, QosProfile::reliable(10)),
    (Output::PointsDense, "~/points_dense", PointCloud2::TYPE, QosProfile::reliable(10)),
    (Output::SliceInfo, "~/slice_info", SliceInfo::TYPE, QosProfile::reliable(10)),
    (Output::HeightMap, "~/height_map", Image::TYPE, QosProfile::latched(1)),
];

/// The topic of the laser plane's pose.
pub(crate) const STATIC_TF: &str = "/tf_static";

/// Returns the name of a camera's topic before remapping. With several cameras, the camera's name precedes it
/// (`left/image_raw`, `~/left/centerline`). An absolute name belongs to the whole node.
pub(crate) fn of_camera(camera: &str, name: &str) -> String {
    match (camera, name.strip_prefix("~/")) {
        ("", _) => name.to_owned(),
        _ if name.starts_with('/') => name.to_owned(),
        (camera, Some(own)) => format!("~/{camera}/{own}"),
        (camera, None) => format!("{camera}/{name}"),
    }
}

/// Returns the topics published for a camera, with their resolved names. Without a calibration, there are no metric
/// topics. The name of a node's only camera may be empty.
///
/// # Errors
/// A remap rule that gives a topic a name that ROS does not allow.
pub(crate) fn published(
    names: &NodeNames,
    camera: &str,
    calibration: Option<&Calibration>,
) -> Result<Vec<TopicEndpoint>, NameError> {
    let uncalibrated = Output::Diagnostics as usize + 1;
    let num = calibration.map_or(uncalibrated, |_| OUTPUTS.len());
    let topic = |&(_, name, kind, qos): &(Output, &str, &'static MessageType, QosProfile)| {
        Ok(TopicEndpoint { name: names.resolve(&of_camera(camera, name))?, kind, qos })
    };
    OUTPUTS[..num].iter().map(topic).collect()
}

/// Returns the topic of the laser plane's pose, which follows the published ones in a recording.
///
/// # Errors
/// A remap rule that gives the topic a name that ROS does not allow.
pub(crate) fn static_tf(names: &NodeNames) -> Result<TopicEndpoint, NameError> {
    let (kind, qos) = (TFMessage::TYPE, QosProfile::latched(1));
    Ok(TopicEndpoint { name: names.resolve(STATIC_TF)?, kind, qos })
}

/// Converts the topics for a recording.
pub(crate) fn recorded(endpoints: &[TopicEndpoint]) -> Vec<Topic> {
    let topic =
        |endpoint: &TopicEndpoint| Topic::new(endpoint.name.as_str(), endpoint.kind, endpoint.qos);
    endpoints.iter().map(topic).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_is_in_the_order_of_the_enum() {
        for (index, (output, ..)) in OUTPUTS.iter().enumerate() {
            assert_eq!(*output as usize, index);
        }
        assert_eq!(Output::StaticTf as usize, OUTPUTS.len());
    }

    #[test]
    fn names_follow_the_node_and_its_remaps() {
        let rule = ros2args::RemapRule::new_global("~/points".into(), "/cloud".into());
        let names = NodeNames::new("laser_profiler", &[rule]).unwrap();
        let topics = published(&names, "", Some(&crate::node::tests::calibration())).unwrap();
        let name = |output: Output| topics[output as usize].name.as_str();
        assert_eq!(name(Output::Centerline), "/laser_profiler/centerline");
        assert_eq!(name(Output::Points), "/cloud");
        assert_eq!(name(Output::Diagnostics), "/diagnostics");
        assert_eq!(published(&names, "", None).unwrap().len(), 4);
    }

    #[test]
    fn the_topics_of_a_camera_among_several_have_its_name() {
        let rule = ros2args::RemapRule::new_global("~/left/points".into(), "/cloud".into());
        let names = NodeNames::new("laser_profiler", &[rule]).unwrap();
        let topics = published(&names, "left", Some(&crate::node::tests::calibration())).unwrap();
        let name = |output: Output| topics[output as usize].name.as_str();
        assert_eq!(name(Output::Centerline), "/laser_profiler/left/centerline");
        assert_eq!(name(Output::Points), "/cloud");
        assert_eq!(name(Output::Diagnostics), "/diagnostics");
        assert_eq!(of_camera("left", "image_raw"), "left/image_raw");
    }
}
