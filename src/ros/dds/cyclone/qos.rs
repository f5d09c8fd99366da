//! Quality of service as Cyclone's policies.

use std::time::Duration;

use cyclone_topics::{Durability, History, Liveliness, Qos, Reliability};

use super::super::qos::Side;
use crate::msg::qos::{self, QosProfile, QosTime};

/// Longest time for which a publisher that keeps all messages waits for slow subscribers.
const MAX_BLOCKING: Duration = Duration::from_millis(20);
/// Most messages stored without a depth (`keep_all`).
const MAX_STORED: u32 = 256;

/// Converts a profile; what it leaves open is as on RustDDS. `type_hash` is shown to others, as in rmw; empty: none.
///
/// Publishers keep the last messages, so that a subscriber that has stopped delays nobody: it loses the oldest.
pub(super) fn convert(profile: &QosProfile, side: Side, type_hash: &str) -> Qos {
    let is_writer = side == Side::Writer;
    Qos {
        reliability: match profile.reliability {
            qos::Reliability::Reliable => Reliability::Reliable,
            qos::Reliability::BestEffort => Reliability::BestEffort,
            // DDS's defaults.
            _ if is_writer => Reliability::Reliable,
            _ => Reliability::BestEffort,
        },
        max_blocking: MAX_BLOCKING,
        durability: match (profile.durability, side) {
            (qos::Durability::TransientLocal, _)
            | (qos::Durability::BestAvailable, Side::Writer) => Durability::TransientLocal,
            _ => Durability::Volatile,
        },
        history: match profile.history {
            qos::History::KeepAll => History::KeepAll(MAX_STORED),
            _ => History::KeepLast(u32::try_from(profile.depth).unwrap_or(u32::MAX).max(1)),
        },
        deadline: finite(profile.deadline),
        lifespan: finite(profile.lifespan).filter(|_| is_writer),
        liveliness: match profile.liveliness {
            qos::Liveliness::ManualByNode => Liveliness::ManualByParticipant,
            qos::Liveliness::ManualByTopic => Liveliness::ManualByTopic,
            _ => Liveliness::Automatic,
        },
        liveliness_lease: finite(profile.liveliness_lease_duration),
        user_data: match type_hash {
            "" => Vec::new(),
            hash => format!("typehash={hash};").into_bytes(),
        },
    }
}

/// Converts a duration; `None`: infinite, for rmw's "unspecified" (0) and for durations that exceed DDS's 31 bits of
/// seconds.
fn finite(time: QosTime) -> Option<Duration> {
    let total = Duration::from_secs(time.sec).checked_add(Duration::from_nanos(time.nsec))?;
    Some(total).filter(|total| !total.is_zero() && total.as_secs() < i32::MAX as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profiles_keep_their_depth() {
        let images = convert(&QosProfile::best_effort(5), Side::Reader, "");
        assert_eq!(images.reliability, Reliability::BestEffort);
        assert_eq!(
            (images.durability, images.history),
            (Durability::Volatile, History::KeepLast(5))
        );
        assert_eq!((images.deadline, images.lifespan, images.liveliness_lease), (None, None, None));
        assert!(images.user_data.is_empty());
        let latched = convert(&QosProfile::latched(1), Side::Writer, "RIHS01_0a");
        assert_eq!(latched.reliability, Reliability::Reliable);
        assert_eq!(
            (latched.durability, latched.history),
            (Durability::TransientLocal, History::KeepLast(1))
        );
        assert_eq!(latched.user_data, b"typehash=RIHS01_0a;");
    }

    #[test]
    fn open_policies_match_most_peers() {
        let open = QosProfile {
            reliability: qos::Reliability::BestAvailable,
            durability: qos::Durability::BestAvailable,
            ..QosProfile::reliable(10)
        };
        let [writer, reader] = [Side::Writer, Side::Reader].map(|side| convert(&open, side, ""));
        assert_eq!(writer.reliability, Reliability::Reliable);
        assert_eq!(writer.durability, Durability::TransientLocal);
        assert_eq!(writer.terms().conflict(&reader.terms()), None);
        assert_eq!(reader.durability, Durability::Volatile);
    }

    #[test]
    fn finite_times_are_converted() {
        let time = QosTime { sec: 1, nsec: 500_000_000 };
        let profile = QosProfile {
            deadline: time,
            lifespan: time,
            liveliness: qos::Liveliness::ManualByTopic,
            liveliness_lease_duration: QosTime { sec: 0, nsec: 0 },
            history: qos::History::KeepAll,
            ..QosProfile::reliable(10)
        };
        let converted = convert(&profile, Side::Writer, "");
        let expected = Some(Duration::from_millis(1500));
        assert_eq!((converted.deadline, converted.lifespan), (expected, expected));
        assert_eq!(
            (converted.liveliness, converted.liveliness_lease),
            (Liveliness::ManualByTopic, None)
        );
        assert_eq!(converted.history, History::KeepAll(MAX_STORED));
        assert_eq!(convert(&profile, Side::Reader, "").lifespan, None);
    }
}
