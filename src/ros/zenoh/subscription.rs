//! Subscribers.

use std::{
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use hiroz_protocol::{
    EndpointKind,
    qos::{QosDurability, QosProfile as WireQos, QosReliability},
};
use zenoh::{
    Session, Wait, key_expr::KeyExpr, liveliness::LivelinessToken, pubsub::Subscriber,
    sample::Sample,
};
use zenoh_ext::{AdvancedSubscriber, AdvancedSubscriberBuilderExt, HistoryConfig, RecoveryConfig};

use super::{
    Node,
    attachment::Attachment,
    declare_token, endpoint_error,
    graph::Side,
    keys::{Endpoint, has_buffer, wire_qos},
    publication::kept_samples,
};
use crate::ros::transport::{
    Arrival, Fault, OnArrival, Subscription, TopicEndpoint, TransportError,
};

/// Time for which a latched subscriber waits for earlier samples: unlimited, as in rmw.
const HISTORY_TIMEOUT: Duration = Duration::from_millis(u64::MAX);

/// A subscriber of one topic. Fields are dropped in order: the token is withdrawn first.
pub(super) struct ZenohSubscription {
    _token: LivelinessToken,
    _subscriber: AdvancedSubscriber<()>,
    _buffer_group: Option<Subscriber<()>>,
    intake: Intake,
    data: KeyExpr<'static>,
    node: Arc<Node>,
}

impl ZenohSubscription {
    pub(super) fn declare(
        node: &Arc<Node>,
        topic: &TopicEndpoint,
        limit_bytes: usize,
        on_arrival: OnArrival,
    ) -> Result<Self, TransportError> {
        let mut keys = node.next_keys(&Endpoint::of(topic, EndpointKind::Subscription))?;
        let refused = |error: zenoh::Error| endpoint_error(&topic.name, &error);
        let qos = wire_qos(&topic.qos);
        let intake = Intake { on_arrival: Arc::new(Mutex::new(Some(on_arrival))), limit_bytes };
        // Declared before the token, so that the subscriber is ready when others see the token.
        let subscriber = subscriber(&node.session, keys.data.clone(), &qos, intake.clone());
        let subscriber = subscriber.map_err(refused)?;
        let mut buffer_group = None;
        // Earlier samples arrive on the topic's own key only.
        if qos.durability != QosDurability::TransientLocal && has_buffer(topic.kind) {
            let key = keys.join_buffer_group().map_err(refused)?;
            let intake = intake.clone();
            let group = node.session.declare_subscriber(key);
            let group = group.callback(move |sample| intake.take(&sample)).wait();
            buffer_group = Some(group.map_err(refused)?);
        }
        let token = declare_token(&node.session, keys.token.clone()).map_err(refused)?;
        node.graph.expect(&topic.name, keys.data.as_str());
        Ok(Self {
            _token: token,
            _subscriber: subscriber,
            _buffer_group: buffer_group,
            intake,
            data: keys.data,
            node: Arc::clone(node),
        })
    }
}

/// Declares a subscriber like `rmw_zenoh_cpp`.
fn subscriber(
    session: &Session,
    key: KeyExpr<'static>,
    qos: &WireQos,
    intake: Intake,
) -> zenoh::Result<AdvancedSubscriber<()>> {
    let subscriber = session.declare_subscriber(key);
    let mut subscriber = subscriber.callback(move |sample| intake.take(&sample)).advanced();
    if qos.durability == QosDurability::TransientLocal {
        let history = HistoryConfig::default().detect_late_publishers();
        subscriber = subscriber
            .history(history.max_samples(kept_samples(qos.history)))
            .query_timeout(HISTORY_TIMEOUT)
            .subscriber_detection();
        if qos.reliability == QosReliability::Reliable {
            subscriber = subscriber.recovery(RecoveryConfig::default().heartbeat());
        }
    }
    subscriber.wait()
}

/// Delivers all samples of a subscription, one at a time; discards them once it is dropped.
#[derive(Clone)]
struct Intake {
    on_arrival: Arc<Mutex<Option<OnArrival>>>,
    limit_bytes: usize,
}

impl Intake {
    fn lock(&self) -> MutexGuard<'_, Option<OnArrival>> {
        self.on_arrival.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take(&self, sample: &Sample) {
        if let Some(on_arrival) = self.lock().as_mut() {
            on_arrival(arrival(sample, self.limit_bytes));
        }
    }
}

fn arrival(sample: &Sample, limit_bytes: usize) -> Result<Arrival, Fault> {
    let bytes = sample.payload().len();
    if bytes > limit_bytes {
        return Err(Fault::TooLarge { bytes, limit_bytes });
    }
    let attachment = Attachment::parse(sample.attachment())?;
    Ok(Arrival {
        // The only copy: a large message is fragmented, or in memory shared with its sender.
        data: sample.payload().to_bytes().into_owned(),
        publisher: attachment.sender,
        sequence: Some(attachment.sequence),
        source_time_ns: attachment.source_time_ns,
        receive_time_ns: now_ns(),
    })
}

/// Returns the time of this machine's clock, nanoseconds since the epoch.
pub(super) fn now_ns() -> i64 {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since_epoch.as_nanos()).unwrap_or(i64::MAX)
}

impl Subscription for ZenohSubscription {
    fn num_matched(&self) -> usize {
        self.node.graph.num_on(Side::Publisher, &self.data)
    }
}

impl Drop for ZenohSubscription {
    fn drop(&mut self) {
        // Waits for a running call. Zenoh may still deliver samples for a moment, which are discarded.
        *self.intake.lock() = None;
    }
}
