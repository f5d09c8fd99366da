//! The topics that carry the position of the axis.

use thiserror::Error;

use super::decode::STATIC_TF;
use crate::{
    msg::{
        laser_profiler_msgs::EncoderStamped,
        qos::QosProfile,
        schema::{Message, MessageType},
        sensor_msgs::JointState,
        tf2_msgs::TFMessage,
    },
    node::topics,
    ros::{
        names::{NameError, NodeNames},
        transport::TopicEndpoint,
    },
    scanner::params::MotionSource,
};

/// Samples that the middleware queues for a slow reader.
const DEPTH: u64 = 100;
/// Maximum number of topics listed in an error.
const MAX_LISTED: usize = 20;

/// The reason that no topic can be chosen in a recording.
#[derive(Debug, Error)]
pub(crate) enum PositionTopicError {
    /// The recording has no such topic.
    #[error(
        "motion.source is {source_name}, but the recording has no {type_name} on {name}; it has {topics}"
    )]
    Missing {
        /// The parameter.
        source_name: &'static str,
        /// The topic or type searched for.
        type_name: &'static str,
        /// The recording.
        name: String,
        /// The topics present instead.
        topics: String,
    },
    /// Several topics fit.
    #[error("the recording has several topics of {type_name}; choose one of{choices}")]
    Ambiguous {
        /// The type searched for.
        type_name: &'static str,
        /// The flags that would choose.
        choices: String,
    },
    /// A remap rule has a name that ROS does not allow.
    #[error(transparent)]
    Name(#[from] NameError),
}

/// A topic that a source subscribes to: name before remapping, type, and quality of service.
type Wanted = (&'static str, &'static MessageType, QosProfile);

fn wanted(source: MotionSource) -> Vec<Wanted> {
    let moving = QosProfile::best_effort(DEPTH);
    match source {
        MotionSource::None | MotionSource::Constant => Vec::new(),
        MotionSource::JointState => vec![("joint_states", JointState::TYPE, moving)],
        MotionSource::Encoder => vec![("encoder", EncoderStamped::TYPE, moving)],
        MotionSource::Tf => vec![
            ("/tf", TFMessage::TYPE, moving),
            (STATIC_TF, TFMessage::TYPE, QosProfile::latched(DEPTH)),
        ],
    }
}

/// Returns the position topics of a live camera.
///
/// # Errors
/// A remap rule has a name that ROS does not allow.
pub(crate) fn endpoints(
    source: MotionSource,
    names: &NodeNames,
    camera: &str,
) -> Result<Vec<TopicEndpoint>, NameError> {
    let endpoint = |(name, kind, qos): Wanted| {
        let name = names.resolve(&topics::of_camera(camera, name))?;
        Ok(TopicEndpoint { name, kind, qos })
    };
    wanted(source).into_iter().map(endpoint).collect()
}

/// Chooses among the topics (name and type) of a recording: the remapped topic or the one with the default name, else
/// the only one of its type. One of `/tf` and `/tf_static` is enough.
///
/// # Errors
/// No topic fits, or several do and none was chosen.
pub(crate) fn choose(
    recorded: &[(String, String)],
    names: &NodeNames,
    camera: &str,
    source: MotionSource,
) -> Result<Vec<String>, PositionTopicError> {
    let mut chosen = Vec::new();
    let mut missing = None;
    for (name, kind, _) in wanted(source) {
        let own = topics::of_camera(camera, name);
        let remapped = names.remapped(&own)?;
        let named = remapped.clone().map_or_else(|| names.resolve(&own), Ok)?;
        let of_type = || recorded.iter().filter(|(_, type_name)| type_name == kind.name);
        if of_type().any(|(topic, _)| *topic == named) {
            chosen.push(named);
            continue;
        }
        let others: Vec<_> = of_type().map(|(topic, _)| topic.clone()).collect();
        match others.as_slice() {
            [only] if remapped.is_none() && source != MotionSource::Tf => chosen.push(only.clone()),
            [_, _, ..] if remapped.is_none() && source != MotionSource::Tf => {
                let flag = |topic: &String| format!("\n  --ros-args -r {own}:={topic}");
                let choices = others.iter().take(MAX_LISTED).map(flag).collect();
                return Err(PositionTopicError::Ambiguous { type_name: kind.name, choices });
            }
            _ => missing = Some((kind.name, named)),
        }
    }
    match missing {
        Some((type_name, name)) if chosen.is_empty() => Err(PositionTopicError::Missing {
            source_name: source.name(),
            type_name,
            name,
            topics: list(recorded),
        }),
        _ => Ok(chosen),
    }
}

fn list(topics: &[(String, String)]) -> String {
    if topics.is_empty() {
        return "no topics".to_owned();
    }
    let named = topics.iter().take(MAX_LISTED).map(|(name, kind)| format!("{name} ({kind})"));
    let mut named: Vec<_> = named.collect();
    if topics.len() > MAX_LISTED {
        named.push(format!("{} more", topics.len() - MAX_LISTED));
    }
    named.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const JOINTS: &str = "sensor_msgs/msg/JointState";
    const TF: &str = "tf2_msgs/msg/TFMessage";

    fn chosen(
        topics: &[(&str, &str)],
        remap: Option<&str>,
        source: MotionSource,
    ) -> Result<Vec<String>, String> {
        let rule = |to: &str| ros2args::RemapRule::new_global("joint_states".into(), to.into());
        let rules: Vec<_> = remap.map(rule).into_iter().collect();
        let names = NodeNames::new("laser_profiler", &rules).unwrap();
        let topics: Vec<_> =
            topics.iter().map(|&(name, kind)| (name.to_owned(), kind.to_owned())).collect();
        choose(&topics, &names, "", source).map_err(|error| error.to_string())
    }

    #[test]
    fn the_default_the_remapped_or_the_only_topic_is_chosen() {
        let source = MotionSource::JointState;
        let one = [("/table/joint_states", JOINTS), ("/image_raw", "sensor_msgs/msg/Image")];
        assert_eq!(chosen(&one, None, source).unwrap(), ["/table/joint_states"]);
        let two = [("/table/joint_states", JOINTS), ("/joint_states", JOINTS)];
        assert_eq!(chosen(&two, None, source).unwrap(), ["/joint_states"]);
        assert_eq!(
            chosen(&two, Some("/table/joint_states"), source).unwrap(),
            ["/table/joint_states"]
        );
        assert!(
            chosen(&two, Some("/nobody"), source).unwrap_err().contains("/nobody; it has /table")
        );
        let several = [("/a", JOINTS), ("/b", JOINTS)];
        let error = chosen(&several, None, source).unwrap_err();
        assert!(
            error.ends_with("\n  --ros-args -r joint_states:=/a\n  --ros-args -r joint_states:=/b"),
            "{error}"
        );
        let error = chosen(&one[1..], None, source).unwrap_err();
        assert!(
            error.contains("motion.source is joint_state") && error.contains("/image_raw"),
            "{error}"
        );
    }

    #[test]
    fn tf_needs_one_of_its_topics_and_takes_both() {
        let both = [("/tf", TF), ("/tf_static", TF), ("/other", TF)];
        assert_eq!(chosen(&both, None, MotionSource::Tf).unwrap(), ["/tf", "/tf_static"]);
        assert_eq!(chosen(&both[1..2], None, MotionSource::Tf).unwrap(), ["/tf_static"]);
        assert!(chosen(&both[2..], None, MotionSource::Tf).is_err());
        assert!(chosen(&[], None, MotionSource::Encoder).unwrap_err().contains("it has no topics"));
        assert_eq!(chosen(&[], None, MotionSource::Constant), Ok(vec![]));
    }
}
