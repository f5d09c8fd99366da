//! Quality of service as RustDDS policies.

use rustdds::{
    Duration, QosPolicies, QosPolicyBuilder,
    policy::{
        Deadline, Durability, History, Lifespan, Liveliness, Ownership, Reliability, ResourceLimits,
    },
};

use crate::msg::qos::{self, QosProfile, QosTime};

/// Time for which a writer waits for a slow reliable subscriber before it rejects the message.
const MAX_BLOCKING: Duration = Duration::from_millis(20);
/// Largest number of unacknowledged messages that a reliable writer stores.
const MAX_UNACKNOWLEDGED: i32 = 256;
/// The same for latched topics, where every late subscriber receives all of them.
const MAX_LATCHED: i32 = 8;

/// Side of a topic, which determines the policies that rmw leaves open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Writer,
    Reader,
}

/// Returns the policies of an endpoint with limits on RustDDS's memory; without them, 64 messages per reader and 8192
/// per writer.
pub(super) fn policies(profile: &QosProfile, side: Side) -> QosPolicies {
    let depth = i32::try_from(profile.depth).unwrap_or(i32::MAX - 1).max(1);
    let durability = durability(profile.durability, side);
    let max_samples = match side {
        Side::Reader => depth + 1,
        Side::Writer if durability == Durability::Volatile => depth.max(MAX_UNACKNOWLEDGED),
        Side::Writer => depth.max(MAX_LATCHED),
    };
    let mut builder = QosPolicyBuilder::new()
        .history(match profile.history {
            qos::History::KeepAll => History::KeepAll,
            _ => History::KeepLast { depth },
        })
        .reliability(reliability(profile.reliability, side))
        .durability(durability)
        .ownership(Ownership::Shared)
        .liveliness(liveliness(profile))
        .resource_limits(ResourceLimits {
            max_samples,
            max_instances: 1,
            max_samples_per_instance: max_samples,
        });
    if let Some(period) = finite(profile.deadline) {
        builder = builder.deadline(Deadline(period));
    }
    if let (Side::Writer, Some(duration)) = (side, finite(profile.lifespan)) {
        builder = builder.lifespan(Lifespan { duration });
    }
    builder.build()
}

/// Resolves the reliability; by DDS's defaults, writers are reliable and readers best effort.
fn reliability(wanted: qos::Reliability, side: Side) -> Reliability {
    let is_reliable = match wanted {
        qos::Reliability::Reliable => true,
        qos::Reliability::BestEffort => false,
        _ => side == Side::Writer,
    };
    if is_reliable {
        Reliability::Reliable { max_blocking_time: MAX_BLOCKING }
    } else {
        Reliability::BestEffort
    }
}

fn durability(wanted: qos::Durability, side: Side) -> Durability {
    match (wanted, side) {
        (qos::Durability::TransientLocal, _) | (qos::Durability::BestAvailable, Side::Writer) => {
            Durability::TransientLocal
        }
        _ => Durability::Volatile,
    }
}

fn liveliness(profile: &QosProfile) -> Liveliness {
    let lease_duration = finite(profile.liveliness_lease_duration).unwrap_or(Duration::INFINITE);
    match profile.liveliness {
        qos::Liveliness::ManualByNode => Liveliness::ManualByParticipant { lease_duration },
        qos::Liveliness::ManualByTopic => Liveliness::ManualByTopic { lease_duration },
        _ => Liveliness::Automatic { lease_duration },
    }
}

/// Converts a duration; `None`: infinite, for rmw's "unspecified" (0) and for durations that exceed DDS's 31 bits of
/// seconds.
fn finite(time: QosTime) -> Option<Duration> {
    let nanoseconds = i128::from(time.sec) * 1_000_000_000 + i128::from(time.nsec);
    let fits = i64::try_from(nanoseconds).ok().filter(|_| time.sec < i32::MAX as u64);
    fits.filter(|nanoseconds| *nanoseconds > 0).map(Duration::from_nanos)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_subscription_is_best_effort_and_stores_six() {
        let policies = policies(&QosProfile::best_effort(5), Side::Reader);
        assert!(!policies.is_reliable());
        assert!(policies.is_volatile());
        assert_eq!(policies.history(), Some(History::KeepLast { depth: 5 }));
        assert_eq!(policies.resource_limits().map(|limits| limits.max_samples), Some(6));
        assert_eq!((policies.deadline(), policies.lifespan()), (None, None));
    }

    #[test]
    fn a_latched_topic_stores_at_least_its_depth() {
        for (depth, kept) in [(1, MAX_LATCHED), (1000, 1000)] {
            let policies = policies(&QosProfile::latched(depth), Side::Writer);
            assert!(policies.is_reliable());
            assert_eq!(policies.durability(), Some(Durability::TransientLocal));
            assert_eq!(policies.resource_limits().map(|limits| limits.max_samples), Some(kept));
        }
    }

    #[test]
    fn open_policies_match_most_peers() {
        let open = QosProfile {
            reliability: qos::Reliability::BestAvailable,
            durability: qos::Durability::BestAvailable,
            ..QosProfile::reliable(10)
        };
        let (writer, reader) = (policies(&open, Side::Writer), policies(&open, Side::Reader));
        assert!(writer.is_reliable() && !reader.is_reliable());
        assert!(!writer.is_volatile() && reader.is_volatile());
    }

    #[test]
    fn finite_times_are_converted() {
        let second = QosTime { sec: 1, nsec: 500_000_000 };
        let zero = QosTime { sec: 0, nsec: 0 };
        let profile = QosProfile {
            deadline: second,
            lifespan: second,
            liveliness: qos::Liveliness::ManualByTopic,
            liveliness_lease_duration: zero,
            ..QosProfile::reliable(10)
        };
        let policies = policies(&profile, Side::Writer);
        let expected = Duration::from_millis(1500);
        assert_eq!(policies.deadline(), Some(Deadline(expected)));
        assert_eq!(policies.lifespan(), Some(Lifespan { duration: expected }));
        let lease_duration = Duration::INFINITE;
        assert_eq!(policies.liveliness(), Some(Liveliness::ManualByTopic { lease_duration }));
    }
}
