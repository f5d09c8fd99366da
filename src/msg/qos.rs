//! Quality of service of a topic, in the terms of rosbag2 (metadata version 9).

use serde::{Deserialize, Serialize};

/// Quality of service that a publisher offered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct QosProfile {
    /// Limit on the number of stored samples.
    pub(crate) history: History,
    /// Number of samples for `keep_last`.
    pub(crate) depth: u64,
    /// Retransmission of lost samples.
    pub reliability: Reliability,
    /// Delivery of earlier samples to late subscribers.
    pub(crate) durability: Durability,
    /// Longest time between two samples.
    pub(crate) deadline: QosTime,
    /// Time after which a sample expires.
    pub(crate) lifespan: QosTime,
    /// Source of the publisher's liveliness.
    pub(crate) liveliness: Liveliness,
    /// Longest time between two assertions of liveliness.
    pub(crate) liveliness_lease_duration: QosTime,
    /// True if topic names are used without the ROS prefix.
    #[serde(default)]
    pub(crate) avoid_ros_namespace_conventions: bool,
}

// The aliases are the numbers in metadata before version 9 (rmw's enumerations).

/// Limit on the number of stored samples.
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

/// Source of the publisher's liveliness.
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
    /// Remaining nanoseconds.
    pub(crate) nsec: u64,
}

/// Infinite duration of rmw: `i64::MAX` nanoseconds.
const INFINITE: QosTime = QosTime { sec: 9_223_372_036, nsec: 854_775_807 };

impl QosProfile {
    /// Returns a reliable, volatile profile with a queue of `depth` samples.
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

    /// Returns a best-effort, volatile profile with a queue of `depth` samples.
    pub const fn best_effort(depth: u64) -> Self {
        Self { reliability: Reliability::BestEffort, ..Self::reliable(depth) }
    }

    /// Returns a reliable profile in which late subscribers receive the last `depth` samples.
    pub const fn latched(depth: u64) -> Self {
        Self { durability: Durability::TransientLocal, ..Self::reliable(depth) }
    }
}
