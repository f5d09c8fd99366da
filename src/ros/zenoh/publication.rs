//! Publishers.

use std::{sync::Arc, time::Duration};

use bytes::Bytes;
use hiroz_protocol::{
    EndpointKind,
    qos::{
        QosDurability, QosHistory, QosProfile as WireQos, QosReliability,
        RMW_ZENOH_DEFAULT_HISTORY_DEPTH,
    },
};
use zenoh::{
    Session, Wait,
    key_expr::KeyExpr,
    liveliness::LivelinessToken,
    qos::{CongestionControl, Reliability},
};
use zenoh_ext::{AdvancedPublisher, AdvancedPublisherBuilderExt, CacheConfig, MissDetectionConfig};

use super::{
    Node,
    attachment::Attachment,
    declare_token, endpoint_error,
    graph::Side,
    keys::{Endpoint, EndpointKeys, wire_qos},
};
use crate::ros::transport::{Publication, TopicEndpoint, TransportError};

/// Period at which a latched publisher announces its last sequence number if it is new; rmw's value.
const HEARTBEAT: Duration = Duration::from_millis(500);

/// A publisher of one topic. Fields are dropped in order: the token is withdrawn first.
pub(super) struct ZenohPublication {
    _token: LivelinessToken,
    publisher: AdvancedPublisher<'static>,
    keys: EndpointKeys,
    sequence: i64,
    topic: String,
    node: Arc<Node>,
}

impl ZenohPublication {
    pub(super) fn declare(node: &Arc<Node>, topic: &TopicEndpoint) -> Result<Self, TransportError> {
        let keys = node.next_keys(&Endpoint::of(topic, EndpointKind::Publisher))?;
        let refused = |error: zenoh::Error| endpoint_error(&topic.name, &error);
        let publisher = publisher(&node.session, keys.data.clone(), &wire_qos(&topic.qos));
        let publisher = publisher.map_err(refused)?;
        let token = declare_token(&node.session, keys.token.clone()).map_err(refused)?;
        let (node, topic) = (Arc::clone(node), topic.name.clone());
        Ok(Self { _token: token, publisher, keys, sequence: 0, topic, node })
    }
}

/// Declares a publisher like `rmw_zenoh_cpp`.
fn publisher(
    session: &Session,
    key: KeyExpr<'static>,
    qos: &WireQos,
) -> zenoh::Result<AdvancedPublisher<'static>> {
    let is_reliable = qos.reliability == QosReliability::Reliable;
    let may_block = is_reliable && qos.history == QosHistory::KeepAll;
    let publisher = session
        .declare_publisher(key)
        .congestion_control(if may_block {
            CongestionControl::Block
        } else {
            CongestionControl::Drop
        })
        .reliability(if is_reliable { Reliability::Reliable } else { Reliability::BestEffort });
    let mut publisher = publisher.advanced();
    if qos.durability == QosDurability::TransientLocal {
        let cache = CacheConfig::default().max_samples(kept_samples(qos.history));
        publisher = publisher.publisher_detection().cache(cache);
        if is_reliable {
            let heartbeat = MissDetectionConfig::default().sporadic_heartbeat(HEARTBEAT);
            publisher = publisher.sample_miss_detection(heartbeat);
        }
    }
    publisher.wait()
}

/// Returns the number of samples that a latched topic stores; rmw limits `KeepAll`, too.
pub(super) const fn kept_samples(history: QosHistory) -> usize {
    match history {
        QosHistory::KeepLast(depth) => depth,
        QosHistory::KeepAll => RMW_ZENOH_DEFAULT_HISTORY_DEPTH,
    }
}

impl Publication for ZenohPublication {
    fn publish(&mut self, data: &Arc<[u8]>, source_time_ns: i64) -> Result<(), TransportError> {
        self.sequence += 1;
        let attachment =
            Attachment { sequence: self.sequence, source_time_ns, sender: self.keys.id };
        let put = self.publisher.put(Bytes::from_owner(Arc::clone(data)));
        let sent = put.attachment(attachment.to_bytes()).wait();
        sent.map_err(|error| endpoint_error(&self.topic, &error))
    }

    fn num_matched(&self) -> usize {
        self.node.graph.num_on(Side::Subscriber, &self.keys.data)
    }
}
