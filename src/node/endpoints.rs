//! Topics and services of a live node, under the names that its user gives them.

use std::sync::Arc;

use thiserror::Error;

use crate::{
    msg::{
        cdr::{self, CdrError},
        qos::QosProfile,
        schema::{Message, ServiceType},
    },
    ros::{
        names::NodeNames,
        transport::{
            OnArrival, OnRequest, Publication, Server, ServiceEndpoint, Subscription,
            TopicEndpoint, Transport, TransportError,
        },
    },
};

/// The reason that a message is not sent.
#[derive(Debug, Error)]
pub enum SendError {
    /// It has no bytes.
    #[error(transparent)]
    Encode(#[from] CdrError),
    /// The middleware refuses it.
    #[error(transparent)]
    Transport(#[from] TransportError),
}

/// Makes a publisher of `M` under the resolved name of `topic`.
///
/// # Errors
/// A name that ROS does not allow, or the middleware refuses.
pub fn advertise<M: Message>(
    transport: &dyn Transport,
    names: &NodeNames,
    topic: &str,
    qos: QosProfile,
) -> Result<Box<dyn Publication>, TransportError> {
    transport.advertise(&TopicEndpoint { name: resolved(names, topic)?, kind: M::TYPE, qos })
}

/// Makes a subscriber of `M`, for messages of up to `limit_bytes`.
///
/// # Errors
/// A name that ROS does not allow, or the middleware refuses.
pub fn subscribe<M: Message>(
    transport: &dyn Transport,
    (names, topic): (&NodeNames, &str),
    qos: QosProfile,
    limit_bytes: usize,
    on_arrival: OnArrival,
) -> Result<Box<dyn Subscription>, TransportError> {
    let endpoint = TopicEndpoint { name: resolved(names, topic)?, kind: M::TYPE, qos };
    transport.subscribe(&endpoint, limit_bytes, on_arrival)
}

/// Offers a service.
///
/// # Errors
/// A name that ROS does not allow, or the middleware refuses.
pub fn serve(
    transport: &dyn Transport,
    names: &NodeNames,
    service: &str,
    kind: &'static ServiceType,
    on_request: OnRequest,
) -> Result<Box<dyn Server>, TransportError> {
    transport.serve(&ServiceEndpoint { name: resolved(names, service)?, kind }, on_request)
}

/// Encodes and sends a message of the time `time_ns`, nanoseconds since the epoch.
///
/// # Errors
/// The message has no bytes, or the middleware refuses them.
pub fn send<M: Message>(
    publication: &mut dyn Publication,
    message: &M,
    time_ns: i64,
) -> Result<(), SendError> {
    let mut bytes = Vec::new();
    cdr::encode(message, &mut bytes)?;
    Ok(publication.publish(&Arc::from(bytes), time_ns)?)
}

/// The bytes of a response; `None`, and a line in the log, where it has none.
pub fn answer<M: Message>(response: &M) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    match cdr::encode(response, &mut bytes) {
        Ok(()) => Some(bytes),
        Err(error) => {
            tracing::error!("a request gets no answer: {error}");
            None
        }
    }
}

fn resolved(names: &NodeNames, name: &str) -> Result<String, TransportError> {
    names.resolve(name).map_err(|error| TransportError::Endpoint {
        name: name.to_owned(),
        reason: error.to_string(),
    })
}
