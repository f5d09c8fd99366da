//! Quality of service of a topic, in the words that rosbag2 has for it (metadata version 9).

use serde::{Deserialize, Serialize};

/// What a publisher of a topic offered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct QosProfile {
    /// Limit on the samples that are kept.
    pub(crate) history: History,
    /// Number of samples for `keep_last`.
    pub(crate) depth: u64,
    /// Retransmission of lost samples.
    pub reliability: Reliability,
    /// Delivery of earlier samples to late subscribers.
    pub(crate) durability: Durability,
    /// Longest time between two samples.
    pub(crate) deadline: QosTime,
    /// How long a sample is valid.
    pub(crate) lifespan: QosTime,
    /// Who says that the publisher lives.
    pub(crate) liveliness: Liveliness,
    /// How often that must be said.
    pub(crate) liveliness_lease_duration: QosTime,
    /// Whether topic names are used as they are.
    #[serde(default)]
    pub(crate) avoid_ros_namespace_conventions: bool,
}

// The aliases are the numbers that metadata before version 9 holds (rmw's enumerations).

/// Limit on the samples that are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum History {
    #[serde(alias = "0")]
    SystemDefault,
    #[serde(alias = "1")]
    KeepLast,
    #[serde(alias = "2")]
    KeepAll,
    #[serde(alias = "3")]
    Unknown,
}

/// Retransmission of lost samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the names are those of rmw")]
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

/// Delivery of earlier samples to late subscribers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Durability {
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
pub(crate) enum Liveliness {
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
pub(crate) struct QosTime {
    /// Whole seconds.
    pub(crate) sec: u64,
    /// The rest, nanoseconds.
    pub(crate) nsec: u64,
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
}
