//! ROS 2 over Zenoh, compatible with `rmw_zenoh_cpp` 0.2.5 and later (Jazzy, Kilted, Lyrical): its keys, attachments,
//! liveliness tokens, quality of service and session settings.
//!
//! Zenoh's calls block on its own runtime: do not call anything here from a single-threaded tokio runtime.

mod attachment;
mod graph;
mod keys;
mod probe;
mod publication;
mod service;
mod session;
mod settings;
mod subscription;

use std::sync::{
    Arc,
    atomic::{AtomicUsize, Ordering},
};

use zenoh::{Session, Wait, key_expr::KeyExpr, liveliness::LivelinessToken};

pub use settings::{Override, Role, RouterCheck, ZenohSettings};

use self::{
    graph::Graph,
    keys::{Endpoint, EndpointKeys, NodeKeys},
    publication::ZenohPublication,
    service::{Requests, ZenohServer},
    subscription::ZenohSubscription,
};
use super::transport::{
    GraphTopic, NodeIdentity, OnArrival, OnLateRequest, OnRequest, Publication, Server,
    ServiceEndpoint, Subscription, TopicEndpoint, Transport, TransportError, at_once,
};

/// A node in the graph of a Zenoh network. The session closes when this and all its endpoints are dropped.
pub struct ZenohTransport(Arc<Node>);

/// State shared by the endpoints of a node. Fields are dropped in order: tokens are withdrawn before the session
/// closes.
struct Node {
    _token: LivelinessToken,
    graph: Graph,
    requests: Requests,
    keys: NodeKeys,
    num_endpoints: AtomicUsize,
    session: Session,
}

impl ZenohTransport {
    /// Opens a session and declares the node in it.
    ///
    /// If there is no router, warns and joins one when it appears, unless the settings require waiting for it.
    ///
    /// # Errors
    /// Settings that Zenoh rejects; for a router, a port that cannot be opened.
    pub fn open(settings: &ZenohSettings, node: &NodeIdentity) -> Result<Self, TransportError> {
        let session = session::open(settings)?;
        let name = format!("{}/{}", node.namespace.trim_end_matches('/'), node.name);
        let refused = |error: zenoh::Error| endpoint_error(&name, &error);
        let keys = NodeKeys::new(settings.domain_id, session.zid(), node);
        let graph = Graph::watch(&session, settings.domain_id).map_err(refused)?;
        let requests = Requests::start().map_err(|error| refused(error.into()))?;
        let token = declare_token(&session, keys.token().map_err(refused)?).map_err(refused)?;
        let num_endpoints = AtomicUsize::new(0);
        Ok(Self(Arc::new(Node { _token: token, graph, requests, keys, num_endpoints, session })))
    }
}

impl Node {
    /// Returns the keys of the node's next endpoint.
    fn next_keys(&self, endpoint: &Endpoint<'_>) -> Result<EndpointKeys, TransportError> {
        // The node itself has number 0.
        let id = self.num_endpoints.fetch_add(1, Ordering::Relaxed) + 1;
        let keys = self.keys.endpoint(id, endpoint);
        keys.map_err(|error| endpoint_error(endpoint.name, &error))
    }
}

fn declare_token(session: &Session, key: KeyExpr<'static>) -> zenoh::Result<LivelinessToken> {
    session.liveliness().declare_token(key).wait()
}

fn endpoint_error(name: &str, error: &zenoh::Error) -> TransportError {
    TransportError::Endpoint { name: name.to_owned(), reason: session::words(error) }
}

impl Transport for ZenohTransport {
    fn name(&self) -> &'static str {
        "zenoh"
    }

    fn max_reliable_bytes(&self) -> Option<usize> {
        None
    }

    fn advertise(&self, topic: &TopicEndpoint) -> Result<Box<dyn Publication>, TransportError> {
        Ok(Box::new(ZenohPublication::declare(&self.0, topic)?))
    }

    fn subscribe(
        &self,
        topic: &TopicEndpoint,
        limit_bytes: usize,
        on_arrival: OnArrival,
    ) -> Result<Box<dyn Subscription>, TransportError> {
        Ok(Box::new(ZenohSubscription::declare(&self.0, topic, limit_bytes, on_arrival)?))
    }

    fn serve(
        &self,
        service: &ServiceEndpoint,
        on_request: OnRequest,
    ) -> Result<Box<dyn Server>, TransportError> {
        self.serve_late(service, at_once(on_request))
    }

    fn serve_late(
        &self,
        service: &ServiceEndpoint,
        on_request: OnLateRequest,
    ) -> Result<Box<dyn Server>, TransportError> {
        Ok(Box::new(ZenohServer::declare(&self.0, service, on_request)?))
    }

    fn topics(&self) -> Vec<GraphTopic> {
        self.0.graph.topics()
    }

    fn failure(&self) -> Option<String> {
        self.0.session.is_closed().then(|| "the Zenoh session is closed".to_owned())
    }
}

/// Parses bytes as an attachment, and as the key of a liveliness token.
#[cfg(fuzzing)]
pub(crate) fn fuzz(data: &[u8]) {
    drop(attachment::Attachment::parse(Some(&data.into())));
    if let Ok(token) = std::str::from_utf8(data) {
        graph::fuzz(token);
    }
}
