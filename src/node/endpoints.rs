//! Creates the topics and services of a live node under their remapped names.

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
            OnRequest, Publication, Server, ServiceEndpoint, TopicEndpoint, Transport,
            TransportError,
        },
    },
};

/// The reason that a message cannot be sent.
#[derive(Debug, Error)]
pub(crate) enum SendError {
    /// It cannot be encoded.
    #[error(transparent)]
    Encode(#[from] CdrError),
    /// The middleware rejects it.
    #[error(transparent)]
    Transport(#[from] TransportError),
}

/// Creates a publisher of `M` under the resolved name of `topic`.
///
/// # Errors
/// ROS does not allow the name, or the middleware rejects the endpoint.
pub(crate) fn advertise<M: Message>(
    transport: &dyn Transport,
    names: &NodeNames,
    topic: &str,
    qos: QosProfile,
) -> Result<Box<dyn Publication>, TransportError> {
    transport.advertise(&topic_of::<M>(names, topic, qos)?)
}

/// Describes a topic of `M` under the resolved name of `topic`.
///
/// # Errors
/// ROS does not allow the name.
pub(crate) fn topic_of<M: Message>(
    names: &NodeNames,
    topic: &str,
    qos: QosProfile,
) -> Result<TopicEndpoint, TransportError> {
    Ok(TopicEndpoint { name: resolved(names, topic)?, kind: M::TYPE, qos })
}

/// Creates a service server.
///
/// # Errors
/// ROS does not allow the name, or the middleware rejects the endpoint.
pub(crate) fn serve(
    transport: &dyn Transport,
    names: &NodeNames,
    service: &str,
    kind: &'static ServiceType,
    on_request: OnRequest,
) -> Result<Box<dyn Server>, TransportError> {
    transport.serve(&ServiceEndpoint { name: resolved(names, service)?, kind }, on_request)
}

/// Encodes and publishes a message with time `time_ns`, nanoseconds since the epoch.
///
/// # Errors
/// The message cannot be encoded, or the middleware rejects it.
pub(crate) fn send<M: Message>(
    publication: &mut dyn Publication,
    message: &M,
    time_ns: i64,
) -> Result<(), SendError> {
    let mut bytes = Vec::new();
    cdr::encode(message, &mut bytes)?;
    Ok(publication.publish(&Arc::from(bytes), time_ns)?)
}

/// Encodes a response. Logs an error and returns `None` if it cannot be encoded.
pub(crate) fn answer<M: Message>(response: &M) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    match cdr::encode(response, &mut bytes) {
        Ok(()) => Some(bytes),
        Err(error) => {
            tracing::error!("cannot encode a response: {error}");
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
