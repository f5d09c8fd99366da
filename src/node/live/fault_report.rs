//! The node's own status on `/diagnostics`: it outlives the cameras, so that it can name a thread that panicked.

use std::borrow::Cow;

use super::{error::LiveError, notes};
use crate::{
    msg::{
        builtin_interfaces::Time,
        diagnostic_msgs::{DiagnosticArray, DiagnosticStatus, KeyValue},
        std_msgs::Header,
    },
    node::{
        clock::RosClock,
        endpoints,
        topics::{self, Output},
    },
    ros::{
        names::NodeNames,
        node_params::NodeParams,
        qos_overrides::Side,
        transport::{Publication, Transport},
    },
};

/// Publishes the node's own status.
pub(super) struct FaultReport {
    publication: Box<dyn Publication>,
    node: String,
    clock: RosClock,
}

impl FaultReport {
    /// Creates the publisher.
    pub(super) fn advertise(
        transport: &dyn Transport,
        names: &NodeNames,
        params: &NodeParams,
        clock: RosClock,
    ) -> Result<Self, LiveError> {
        let mut topic =
            topics::published(names, "", None)?.swap_remove(Output::Diagnostics as usize);
        topic.qos = params.qos_overrides.apply(&topic.name, Side::Publisher, topic.qos);
        let publication = transport.advertise(&topic)?;
        Ok(Self { publication, node: names.fully_qualified(), clock })
    }

    /// Publishes that a thread panicked.
    pub(super) fn on_panic(&mut self, name: &str) {
        let note = notes::on_panic(name);
        let value = KeyValue { key: Cow::Borrowed(note.key), value: Cow::Borrowed(&note.text) };
        let now_ns = self.clock.now_ns();
        let status = DiagnosticStatus {
            level: note.level,
            name: Cow::Owned(format!("{}: node", self.node.trim_start_matches('/'))),
            message: Cow::Borrowed(&note.text),
            hardware_id: Cow::Borrowed(""),
            values: vec![value],
        };
        let header = Header { stamp: Time::from_ns(now_ns), frame_id: Cow::Borrowed("") };
        let report = DiagnosticArray { header, status: vec![status] };
        if let Err(error) = endpoints::send(&mut *self.publication, &report, now_ns) {
            tracing::warn!("/diagnostics: {error}");
        }
    }
}
