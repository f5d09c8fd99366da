//! Quality of service as rosbag2 writes it beside a topic: the words of metadata version 9.

use serde::{Deserialize, Serialize};

/// What a publisher of a topic offered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct QosProfile {
    /// How many samples are kept.
    pub history: History,
    /// Number of samples for `keep_last`.
    pub depth: u64,
    /// Whether lost samples are sent again.
    pub reliability: Reliability,
    /// Whether late subscribers get earlier samples.
    pub durability: Durability,
    /// Longest time between two samples.
    pub deadline: QosTime,
    /// How long a sample is valid.
    pub lifespan: QosTime,
    /// Who says that the publisher lives.
    pub liveliness: Liveliness,
    /// How often that must be said.
    pub liveliness_lease_duration: QosTime,
    /// Whether topic names are used as they are.
    #[serde(default)]
    pub avoid_ros_namespace_conventions: bool,
}

// The aliases are the numbers that metadata before version 9 holds (rmw's enumerations).

/// How many samples are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the words are rmw's")]
pub enum History {
    #[serde(alias = "0")]
    SystemDefault,
    #[serde(alias = "1")]
    KeepLast,
    #[serde(alias = "2")]
    KeepAll,
    #[serde(alias = "3")]
    Unknown,
}

/// Whether lost samples are sent again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the words are rmw's")]
pub enum Reliability {
    #[serde(alias = "0")]
    SystemDefault,
    #[serde(alias = "1")]
    Reliable,
    #[serde(alias = "2")]
    BestEffort,
    #[serde(alias = "3")]
    Unknown,
    #[serde(alias = "4")]
    BestAvailable,
}

/// Whether late subscribers get earlier samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the words are rmw's")]
pub enum Durability {
    #[serde(alias = "0")]
    SystemDefault,
    #[serde(alias = "1")]
    TransientLocal,
    #[serde(alias = "2")]
    Volatile,
    #[serde(alias = "3")]
    Unknown,
    #[serde(alias = "4")]
    BestAvailable,
}

/// Who says that the publisher lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the words are rmw's")]
pub enum Liveliness {
    #[serde(alias = "0")]
    SystemDefault,
    #[serde(alias = "1")]
    Automatic,
    #[serde(alias = "2")]
    ManualByNode,
    #[serde(alias = "3")]
    ManualByTopic,
    #[serde(alias = "4")]
    Unknown,
    #[serde(alias = "5")]
    BestAvailable,
}

/// A span of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct QosTime {
    /// Whole seconds.
    pub sec: u64,
    /// The rest, nanoseconds.
    pub nsec: u64,
}

/// rmw's "for ever": `i64::MAX` nanoseconds.
const INFINITE: QosTime = QosTime { sec: 9_223_372_036, nsec: 854_775_807 };

impl QosProfile {
    /// Reliable, volatile, the last `depth` samples.
    pub const fn reliable(depth: u64) -> Self {
        Self {
            history: History::KeepLast,
            depth,
            reliability: Reliability::Reliable,
            durability: Durability::Volatile,
            deadline: INFINITE,
            lifespan: INFINITE,
            liveliness: Liveliness::Automatic,
            liveliness_lease_duration: INFINITE,
            avoid_ros_namespace_conventions: false,
        }
    }

    /// Best effort, volatile, the last `depth` samples.
    pub const fn best_effort(depth: u64) -> Self {
        Self { reliability: Reliability::BestEffort, ..Self::reliable(depth) }
    }

    /// Reliable, and late subscribers get the last `depth` samples.
    pub const fn latched(depth: u64) -> Self {
        Self { durability: Durability::TransientLocal, ..Self::reliable(depth) }
    }

    /// The YAML list with this profile alone, for [`super::Topic::qos`].
    pub fn to_yaml(self) -> String {
        to_yaml(&[self])
    }
}

/// The profiles as a YAML list.
pub(super) fn to_yaml(profiles: &[QosProfile]) -> String {
    // Plain data of words and integers always has a YAML form.
    serde_saphyr::to_string(&profiles).unwrap_or_default()
}

/// Reads a YAML list of profiles, in the words of version 9 or the numbers of earlier ones. Empty text is no profile;
/// `None` for anything else.
pub(super) fn parse(yaml: &str) -> Option<Vec<QosProfile>> {
    if yaml.trim().is_empty() {
        return Some(Vec::new());
    }
    serde_saphyr::from_str(yaml).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As rosbag2 (Jazzy) writes it.
    const VERSION_9: &str = "- history: keep_last\n  depth: 10\n  reliability: reliable\n  durability: volatile\n  \
        deadline:\n    sec: 9223372036\n    nsec: 854775807\n  lifespan:\n    sec: 9223372036\n    nsec: 854775807\n  \
        liveliness: automatic\n  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: 854775807\n  \
        avoid_ros_namespace_conventions: false\n";

    #[test]
    fn is_written_in_the_words_of_version_9() {
        assert_eq!(QosProfile::reliable(10).to_yaml(), VERSION_9);
        assert_eq!(parse(VERSION_9), Some(vec![QosProfile::reliable(10)]));
    }

    #[test]
    fn numbers_of_earlier_versions_are_understood() {
        let numbers = "- history: 1\n  depth: 5\n  reliability: 2\n  durability: 2\n  deadline: {sec: 9223372036, \
            nsec: 854775807}\n  lifespan: {sec: 9223372036, nsec: 854775807}\n  liveliness: 1\n  \
            liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}\n";
        assert_eq!(parse(numbers), Some(vec![QosProfile::best_effort(5)]));
    }

    #[test]
    fn nothing_is_no_profile_and_nonsense_is_refused() {
        assert_eq!(parse(" \n"), Some(vec![]));
        assert_eq!(parse("[]"), Some(vec![]));
        assert_eq!(parse("- history: sometimes"), None);
        assert_eq!(parse("{{"), None);
    }
}
