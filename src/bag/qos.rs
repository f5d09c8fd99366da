//! Quality of service of a topic in rosbag2's form: a YAML list of profiles.

use super::metadata::from_yaml;
use crate::msg::qos::QosProfile;

/// Returns the profiles as a YAML list.
pub(super) fn to_yaml(profiles: &[QosProfile]) -> String {
    // Words and integers can always be written as YAML.
    serde_saphyr::to_string(&profiles).unwrap_or_default()
}

/// Parses a YAML list of profiles, with the words of version 9 or the numbers of earlier versions. Empty text gives
/// an empty list; `None` for malformed text.
pub(super) fn parse(yaml: &str) -> Option<Vec<QosProfile>> {
    if yaml.trim().is_empty() {
        return Some(Vec::new());
    }
    from_yaml(yaml).ok()
}

/// Joins two lists of profiles without repeating any; `None` for malformed text.
pub(super) fn joined(first: &str, second: &str) -> Option<String> {
    let mut profiles = parse(first)?;
    for profile in parse(second)? {
        if !profiles.contains(&profile) {
            profiles.push(profile);
        }
    }
    Some(to_yaml(&profiles))
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
        assert_eq!(to_yaml(&[QosProfile::reliable(10)]), VERSION_9);
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
    fn empty_text_is_no_profile_and_malformed_text_is_refused() {
        assert_eq!(parse(" \n"), Some(vec![]));
        assert_eq!(parse("[]"), Some(vec![]));
        assert_eq!(parse("- history: sometimes"), None);
        assert_eq!(parse("{{"), None);
    }
}
