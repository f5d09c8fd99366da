//! `qos_overrides.<topic>.<publisher|subscription>.<policy>`: quality of service from parameters, with the names of
//! rclcpp.

use laser_triangulation::parameters::{Kind, Parameter, Value};
use ros2args::names;

use crate::msg::qos::{Durability, History, QosProfile, QosTime, Reliability};

/// Prefix of their names.
pub(super) const PREFIX: &str = "qos_overrides.";

const NS_PER_S: u64 = 1_000_000_000;

const fn policy(
    name: &'static str,
    unit: &'static str,
    kind: Kind,
    text: &'static str,
) -> Parameter {
    Parameter { name, unit, kind, is_read_only: true, text }
}

const fn words(
    name: &'static str,
    names: &'static [&'static str],
    text: &'static str,
) -> Parameter {
    policy(name, "", Kind::Choice { default: names[0], names }, text)
}

const fn time(name: &'static str, text: &'static str) -> Parameter {
    policy(name, "ns", Kind::Integer { default: 0, min: 0, max: i64::MAX }, text)
}

/// The policies. Their defaults are unused: a policy that is not set keeps the topic's own value.
const POLICIES: &[Parameter] = &[
    words(
        "reliability",
        &["reliable", "best_effort"],
        "reliable: lost samples are sent again; best_effort: they are not.",
    ),
    words(
        "durability",
        &["volatile", "transient_local"],
        "transient_local: late subscribers receive earlier samples; volatile: they do not.",
    ),
    words(
        "history",
        &["keep_last", "keep_all"],
        "keep_last: the queue holds the last samples, depth of them; keep_all: all samples.",
    ),
    policy(
        "depth",
        "samples",
        Kind::Integer { default: 10, min: 1, max: 1000 },
        "Queue length for keep_last.",
    ),
    time("deadline", "Longest expected time between two samples; 0: no limit."),
    time("lifespan", "Time after which a sample expires; 0: never."),
];

/// Side of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    /// Sending side.
    Publisher,
    /// Receiving side.
    Subscription,
}

/// Overrides that are set.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct QosOverrides(Vec<Override>);

#[derive(Clone, Debug, PartialEq)]
struct Override {
    topic: String,
    side: Side,
    policy: &'static str,
    value: Value,
}

impl QosOverrides {
    /// Returns the overrides among these names and values of parameters.
    pub(super) fn new<'a>(values: impl Iterator<Item = (&'a str, &'a Value)>) -> Self {
        let one = |(name, value): (&str, &Value)| {
            let (topic, side, policy) = parse(name).ok()?;
            let topic = topic.to_owned();
            Some(Override { topic, side, policy: policy.name, value: value.clone() })
        };
        Self(values.filter_map(one).collect())
    }

    /// Applies the overrides for one side of a topic, whose name is absolute and after remapping.
    #[must_use]
    pub(crate) fn apply(&self, topic: &str, side: Side, mut qos: QosProfile) -> QosProfile {
        for change in self.0.iter().filter(|change| change.topic == topic && change.side == side) {
            change.apply(&mut qos);
        }
        qos
    }
}

impl Override {
    fn apply(&self, qos: &mut QosProfile) {
        match (self.policy, &self.value) {
            (_, Value::Text(word)) => match word.as_str() {
                "reliable" => qos.reliability = Reliability::Reliable,
                "best_effort" => qos.reliability = Reliability::BestEffort,
                "volatile" => qos.durability = Durability::Volatile,
                "transient_local" => qos.durability = Durability::TransientLocal,
                "keep_last" => qos.history = History::KeepLast,
                "keep_all" => qos.history = History::KeepAll,
                _ => {}
            },
            ("depth", Value::Integer(depth)) => qos.depth = depth.unsigned_abs(),
            ("deadline", Value::Integer(time_ns)) => qos.deadline = span(*time_ns),
            ("lifespan", Value::Integer(time_ns)) => qos.lifespan = span(*time_ns),
            _ => {}
        }
    }
}

/// Converts nanoseconds; 0 is rmw's "unspecified", which means no limit.
fn span(time_ns: i64) -> QosTime {
    let time_ns = if time_ns == 0 { i64::MAX } else { time_ns }.unsigned_abs();
    QosTime { sec: time_ns / NS_PER_S, nsec: time_ns % NS_PER_S }
}

/// Returns the policy that a parameter's name selects.
///
/// # Errors
/// Description of valid names.
pub(super) fn row(name: &str) -> Result<&'static Parameter, String> {
    parse(name).map(|(_, _, policy)| policy)
}

fn parse(name: &str) -> Result<(&str, Side, &'static Parameter), String> {
    let wrong = || {
        let policies: Vec<_> = POLICIES.iter().map(|policy| policy.name).collect();
        format!(
            "write {PREFIX}/TOPIC.publisher.POLICY or {PREFIX}/TOPIC.subscription.POLICY, with the topic's absolute \
             name after remapping and a policy of {}",
            policies.join(", ")
        )
    };
    let mut parts = name.strip_prefix(PREFIX).unwrap_or_default().split('.');
    let (Some(topic), Some(side), Some(policy), None) =
        (parts.next(), parts.next(), parts.next(), parts.next())
    else {
        return Err(wrong());
    };
    let side = match side {
        "publisher" => Side::Publisher,
        "subscription" => Side::Subscription,
        _ => return Err(wrong()),
    };
    names::validate_fully_qualified_name(topic).or(Err(wrong()))?;
    let policy = POLICIES.iter().find(|declared| declared.name == policy).ok_or_else(wrong)?;
    Ok((topic, side, policy))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overrides_change_only_what_they_set() {
        let values = [
            ("qos_overrides./a/image.subscription.reliability", Value::Text("reliable".into())),
            (
                "qos_overrides./a/image.subscription.durability",
                Value::Text("transient_local".into()),
            ),
            ("qos_overrides./a/image.subscription.depth", Value::Integer(3)),
            ("qos_overrides./a/image.subscription.deadline", Value::Integer(2_500_000_000)),
            ("qos_overrides./a/image.publisher.history", Value::Text("keep_all".into())),
            ("slice.profiles", Value::Integer(7)),
        ];
        let overrides = QosOverrides::new(values.iter().map(|(name, value)| (*name, value)));
        let own = QosProfile::best_effort(5);
        let expected = QosProfile {
            deadline: QosTime { sec: 2, nsec: 500_000_000 },
            ..QosProfile::latched(3)
        };
        assert_eq!(overrides.apply("/a/image", Side::Subscription, own), expected);
        let expected = QosProfile { history: History::KeepAll, ..own };
        assert_eq!(overrides.apply("/a/image", Side::Publisher, own), expected);
        assert_eq!(overrides.apply("/a", Side::Subscription, own), own);
    }

    #[test]
    fn zero_is_no_limit() {
        let value = Value::Integer(0);
        let values = [("qos_overrides./a.publisher.lifespan", &value)];
        let own = QosProfile { lifespan: QosTime { sec: 1, nsec: 0 }, ..QosProfile::reliable(1) };
        let qos = QosOverrides::new(values.into_iter()).apply("/a", Side::Publisher, own);
        assert_eq!(qos, QosProfile::reliable(1));
    }

    #[test]
    fn the_error_of_an_invalid_name_describes_valid_ones() {
        for name in [
            "qos_overrides.a.publisher.depth",
            "qos_overrides./a.writer.depth",
            "qos_overrides./a.publisher.colour",
            "qos_overrides./a.publisher",
            "qos_overrides./a b.publisher.depth",
            "qos_overrides./a.publisher.depth.x",
        ] {
            let error = row(name).unwrap_err();
            assert!(
                error.contains("/TOPIC.subscription.POLICY") && error.contains("depth"),
                "{error}"
            );
        }
        assert_eq!(row("qos_overrides./a.publisher.depth").unwrap().name, "depth");
    }
}
