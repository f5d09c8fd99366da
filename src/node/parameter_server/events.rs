//! Publishes the parameters of the node and every change on `/parameter_events`.

use std::{borrow::Cow, sync::Arc};

use crate::{
    msg::{
        builtin_interfaces::Time,
        cdr,
        qos::QosProfile,
        rcl_interfaces::{Parameter, ParameterEvent},
        schema::Message,
    },
    ros::{
        parameters::Parameters,
        qos_overrides::Side,
        transport::{Publication, TopicEndpoint, Transport, TransportError},
        value::Value,
    },
};

use super::convert;

pub(super) const TOPIC: &str = "/parameter_events";
/// Depth of rmw's profile for this topic.
const QOS: QosProfile = QosProfile::reliable(1000);

/// The node's time, nanoseconds since the epoch.
pub(super) type Now = Box<dyn Fn() -> i64 + Send + Sync>;

/// The publisher of one node's events.
pub(super) struct Events {
    publication: Box<dyn Publication>,
    node: String,
    now_ns: Now,
    has_failed: bool,
}

impl Events {
    /// Creates a publisher on `topic`, the absolute name after remapping, with the quality-of-service overrides in
    /// these values.
    pub(super) fn new(
        transport: &dyn Transport,
        topic: String,
        node: String,
        now_ns: Now,
        values: &Parameters,
    ) -> Result<Self, TransportError> {
        let qos = values.qos_overrides().apply(&topic, Side::Publisher, QOS);
        let topic = TopicEndpoint { name: topic, kind: ParameterEvent::TYPE, qos };
        let publication = transport.advertise(&topic)?;
        Ok(Self { publication, node, now_ns, has_failed: false })
    }

    /// Publishes all parameters of the node.
    pub(super) fn publish_all(&mut self, values: &Parameters) {
        let all = values.iter().map(|declared| (declared.name(), declared.value()));
        let new_parameters = messages(all);
        self.publish(ParameterEvent { new_parameters, ..ParameterEvent::default() });
    }

    /// Publishes changed parameters.
    pub(super) fn publish_changed(&mut self, changed: &[(&str, Value)]) {
        let changed_parameters = messages(changed.iter().map(|(name, value)| (*name, value)));
        self.publish(ParameterEvent { changed_parameters, ..ParameterEvent::default() });
    }

    fn publish(&mut self, event: ParameterEvent<'_>) {
        let now_ns = (self.now_ns)();
        let node = Cow::Borrowed(self.node.as_str());
        let event = ParameterEvent { stamp: Time::from_ns(now_ns), node, ..event };
        let mut bytes = Vec::new();
        let sent = match cdr::encode(&event, &mut bytes) {
            Ok(()) => self
                .publication
                .publish(&Arc::from(bytes), now_ns)
                .map_err(|error| error.to_string()),
            Err(error) => Err(error.to_string()),
        };
        match sent {
            Ok(()) => self.has_failed = false,
            Err(error) if !self.has_failed => {
                self.has_failed = true;
                tracing::warn!(
                    "a parameter event was lost: {error}; further losses are not reported"
                );
            }
            Err(_) => {}
        }
    }
}

fn messages<'a>(values: impl Iterator<Item = (&'a str, &'a Value)>) -> Vec<Parameter<'a>> {
    values.map(|(name, value)| convert::parameter_message(name, value)).collect()
}
