//! Chooses the image topic of a recording.

use thiserror::Error;

use crate::{
    msg::{
        schema::Message,
        sensor_msgs::{CompressedImage, Image},
    },
    ros::{
        names::{NameError, NodeNames},
        node_params::ImageTransport,
    },
};

use super::topics;

/// The name that users remap; with several cameras, the camera's name precedes it.
const IMAGE_TOPIC: &str = "image_raw";
/// The node's own images, which recordings of its results contain.
const OWN_IMAGES: &str = "~/height_map";
/// Maximum number of topics listed in an error.
const MAX_LISTED: usize = 20;

/// The reason that no topic can be chosen.
#[derive(Debug, Error)]
pub(crate) enum InputError {
    /// The recording contains no images.
    #[error("the recording holds no images (sensor_msgs/msg/Image or CompressedImage); it has {}", list(.0))]
    NoImages(Vec<(String, String)>),
    /// The named topic is missing or is not an image topic.
    #[error("the recording has no {transport} images on {name}{hint}; it has {}", list(.topics))]
    Missing {
        /// The topic after remapping.
        name: String,
        /// The kind of images searched for.
        transport: &'static str,
        /// A suggestion in parentheses; may be empty.
        hint: String,
        /// Name and type of every topic.
        topics: Vec<(String, String)>,
    },
    /// There are several image topics, and none was chosen.
    #[error("the recording has {} image topics; choose one of\n{}", .0.len(), choices(.0))]
    Ambiguous(Vec<String>),
    /// A remap rule has a name that ROS does not allow.
    #[error(transparent)]
    Name(#[from] NameError),
}

impl InputError {
    /// True if the command line is wrong rather than the recording.
    pub(crate) const fn is_usage(&self) -> bool {
        !matches!(self, Self::NoImages(_))
    }
}

/// The topic to listen to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ImageTopic {
    /// Its name in the recording.
    pub(crate) name: String,
    /// Transport of its images.
    pub(crate) transport: ImageTransport,
}

/// Returns the absolute name of the image topic of a camera.
///
/// # Errors
/// A remap rule has a name that ROS does not allow.
pub(crate) fn image_topic_of(camera: &str, names: &NodeNames) -> Result<String, NameError> {
    names.resolve(&topics::of_camera(camera, IMAGE_TOPIC))
}

/// Chooses among the topics (name and type) of a recording. A named `camera` uses its own image topic. The only camera,
/// whose name is empty, uses the topic that a remap of `image_raw` names, or else the only image topic that the node
/// does not publish itself. Raw and compressed forms of one image count as one topic; raw is preferred unless
/// `transport` is set.
///
/// # Errors
/// No topic or several topics match, or the named topic is missing.
pub(crate) fn choose(
    topics: &[(String, String)],
    names: &NodeNames,
    camera: &str,
    transport: Option<ImageTransport>,
) -> Result<ImageTopic, InputError> {
    let images: Vec<_> = topics.iter().filter_map(image_topic).collect();
    let wanted = |topic: &ImageTopic| transport.is_none_or(|wanted| topic.transport == wanted);
    let (named, hint) = if camera.is_empty() {
        (names.remapped(IMAGE_TOPIC)?, String::new())
    } else {
        // Images of one camera must not be used for another.
        let flag = format!(" (--ros-args -r {camera}/{IMAGE_TOPIC}:=TOPIC selects another)");
        (Some(image_topic_of(camera, names)?), flag)
    };
    if let Some(base) = named {
        let compressed = format!("{base}/compressed");
        let named = |name: &str| images.iter().find(|topic| topic.name == name && wanted(topic));
        return named(&base).or_else(|| named(&compressed)).cloned().ok_or_else(|| {
            let transport = transport.map_or("raw or compressed", ImageTransport::name);
            InputError::Missing { name: base, transport, hint, topics: topics.to_owned() }
        });
    }
    let own = names.resolve(OWN_IMAGES)?;
    let mut images: Vec<_> =
        images.into_iter().filter(|topic| wanted(topic) && topic.name != own).collect();
    let raw: Vec<_> = images.iter().map(|topic| format!("{}/compressed", topic.name)).collect();
    images.retain(|topic| !raw.contains(&topic.name));
    match images.as_slice() {
        [] => Err(transport.map_or(InputError::NoImages(topics.to_owned()), |transport| {
            let (name, transport) = ("any topic".to_owned(), transport.name());
            InputError::Missing { name, transport, hint, topics: topics.to_owned() }
        })),
        [only] => Ok(only.clone()),
        _ => Err(InputError::Ambiguous(images.into_iter().map(|topic| topic.name).collect())),
    }
}

fn image_topic((name, type_name): &(String, String)) -> Option<ImageTopic> {
    let transport = if type_name == Image::TYPE.name {
        ImageTransport::Raw
    } else if type_name == CompressedImage::TYPE.name {
        ImageTransport::Compressed
    } else {
        return None;
    };
    Some(ImageTopic { name: name.clone(), transport })
}

fn list(topics: &[(String, String)]) -> String {
    if topics.is_empty() {
        return "no topics".to_owned();
    }
    let mut named: Vec<_> =
        topics.iter().take(MAX_LISTED).map(|(name, kind)| format!("{name} ({kind})")).collect();
    if topics.len() > MAX_LISTED {
        named.push(format!("{} more", topics.len() - MAX_LISTED));
    }
    named.join(", ")
}

fn choices(names: &[String]) -> String {
    let flag = |name: &String| format!("  --ros-args -r {IMAGE_TOPIC}:={name}");
    let mut flags: Vec<_> = names.iter().take(MAX_LISTED).map(flag).collect();
    if names.len() > MAX_LISTED {
        flags.push(format!("  or one of {} more", names.len() - MAX_LISTED));
    }
    flags.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    const RAW: &str = "sensor_msgs/msg/Image";
    const PACKED: &str = "sensor_msgs/msg/CompressedImage";

    fn chosen(
        topics: &[(&str, &str)],
        remap: &str,
        transport: Option<ImageTransport>,
    ) -> Result<String, InputError> {
        let rule = ros2args::RemapRule::new_global("image_raw".into(), remap.into());
        let rules = if remap.is_empty() { vec![] } else { vec![rule] };
        let names = NodeNames::new("laser_profiler", &rules).unwrap();
        let topics: Vec<_> =
            topics.iter().map(|&(name, kind)| (name.to_owned(), kind.to_owned())).collect();
        choose(&topics, &names, "", transport).map(|topic| topic.name)
    }

    #[test]
    fn the_only_image_topic_needs_no_name() {
        let joints = ("/joints", "sensor_msgs/msg/JointState");
        assert_eq!(chosen(&[("/a", RAW), joints], "", None).unwrap(), "/a");
        assert_eq!(
            chosen(&[("/a/compressed", PACKED), joints], "", None).unwrap(),
            "/a/compressed"
        );
        let both = [("/a/compressed", PACKED), ("/a", RAW)];
        assert_eq!(chosen(&both, "", None).unwrap(), "/a", "two forms of one image");
        let packed = Some(ImageTransport::Compressed);
        assert_eq!(chosen(&both, "", packed).unwrap(), "/a/compressed");
        assert_eq!(chosen(&both, "/a", packed).unwrap(), "/a/compressed");
    }

    #[test]
    fn the_nodes_own_images_are_not_a_second_camera() {
        let topics = [("/a", RAW), ("/laser_profiler/height_map", RAW)];
        assert_eq!(chosen(&topics, "", None).unwrap(), "/a");
        let named = chosen(&topics, "/laser_profiler/height_map", None);
        assert_eq!(named.unwrap(), "/laser_profiler/height_map", "requested by name");
        assert!(matches!(chosen(&topics[1..], "", None), Err(InputError::NoImages(_))));
    }

    #[test]
    fn an_error_lists_a_limited_number_of_topics() {
        let names: Vec<_> = (0..1000).map(|number| format!("/t{number}")).collect();
        let topics: Vec<_> = names.iter().map(|name| (name.as_str(), RAW)).collect();
        for remap in ["", "/missing"] {
            let error = chosen(&topics, remap, None).unwrap_err().to_string();
            assert!(error.contains("/t19") && !error.contains("/t20"), "{error}");
            assert!(error.ends_with("980 more"), "{error}");
        }
    }

    #[test]
    fn a_named_topic_is_found_raw_or_compressed() {
        let topics = [("/a", RAW), ("/b/compressed", PACKED)];
        assert_eq!(chosen(&topics, "/a", None).unwrap(), "/a");
        assert_eq!(chosen(&topics, "/b", None).unwrap(), "/b/compressed");
        assert_eq!(chosen(&topics, "/b/compressed", None).unwrap(), "/b/compressed");
        let error = chosen(&topics, "/b", Some(ImageTransport::Raw)).unwrap_err();
        assert!(error.to_string().contains("no raw images on /b"), "{error}");
    }

    #[test]
    fn an_error_lists_the_topics_and_the_remedy() {
        let error = chosen(&[("/a", RAW), ("/b/compressed", PACKED)], "", None).unwrap_err();
        assert!(error.is_usage());
        assert!(error.to_string().ends_with(
            "\n  --ros-args -r image_raw:=/a\n  --ros-args -r image_raw:=/b/compressed"
        ));
        let error = chosen(&[("/a", RAW)], "/c", None).unwrap_err();
        assert!(
            error.is_usage() && error.to_string().contains("/a (sensor_msgs/msg/Image)"),
            "{error}"
        );
        let error = chosen(&[("/j", "sensor_msgs/msg/JointState")], "", None).unwrap_err();
        assert!(!error.is_usage() && error.to_string().contains("/j"), "{error}");
    }

    #[test]
    fn one_of_several_cameras_uses_only_its_own_topic() {
        let topics = [("/left/image_raw".to_owned(), RAW.to_owned()), ("/b".into(), RAW.into())];
        let names = |rules: &[_]| NodeNames::new("laser_profiler", rules).unwrap();
        let chosen = |names: &NodeNames, camera: &str| {
            choose(&topics, names, camera, None).map(|topic| topic.name)
        };
        assert_eq!(chosen(&names(&[]), "left").unwrap(), "/left/image_raw");
        let error = chosen(&names(&[]), "right").unwrap_err().to_string();
        assert!(error.contains("-r right/image_raw:=TOPIC") && error.contains("/b ("), "{error}");
        let rule = ros2args::RemapRule::new_global("right/image_raw".into(), "/b".into());
        assert_eq!(chosen(&names(&[rule]), "right").unwrap(), "/b");
    }
}
