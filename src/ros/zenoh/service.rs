//! Services: Zenoh's threads put requests into one bounded queue, and one thread of this node answers them in order.

use std::{
    io,
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        mpsc::{Receiver, SyncSender, TrySendError, sync_channel},
    },
    thread,
};

use hiroz_protocol::EndpointKind;
use tracing::warn;
use zenoh::{
    Wait,
    key_expr::KeyExpr,
    liveliness::LivelinessToken,
    query::{Query, Queryable},
};

use super::{
    Node, attachment::Attachment, declare_token, endpoint_error, keys::Endpoint, session::words,
    subscription::now_ns,
};
use crate::{
    msg::qos::QosProfile,
    ros::transport::{OnLateRequest, Responder, Server, ServiceEndpoint, TransportError},
};

/// Largest number of waiting requests. With [`MAX_REQUEST_BYTES`], limits their memory.
const MAX_WAITING: usize = 256;
/// Largest request, bytes. Sets of parameters are much smaller.
const MAX_REQUEST_BYTES: usize = 1 << 20;
/// Quality of service of rmw's services.
const QOS: QosProfile = QosProfile::reliable(10);

struct Request {
    query: Query,
    service: Arc<Service>,
}

struct Service {
    name: String,
    key: KeyExpr<'static>,
    /// `None` once the service is dropped.
    on_request: Mutex<Option<OnLateRequest>>,
}

/// Sender to the thread that answers requests; the thread ends when the last sender is dropped.
#[derive(Clone)]
pub(super) struct Requests(SyncSender<Request>);

impl Requests {
    pub(super) fn start() -> io::Result<Self> {
        let (sender, receiver) = sync_channel(MAX_WAITING);
        thread::Builder::new().name("zenoh services".to_owned()).spawn(move || serve(&receiver))?;
        Ok(Self(sender))
    }

    /// Queues a request without blocking; rejects it if the queue is full.
    fn put(&self, query: Query, service: &Arc<Service>) {
        let request = Request { query, service: Arc::clone(service) };
        if let Err(TrySendError::Full(request) | TrySendError::Disconnected(request)) =
            self.0.try_send(request)
        {
            refuse(&request.query, &request.service.name, "too many requests are waiting");
        }
    }
}

fn serve(requests: &Receiver<Request>) {
    while let Ok(Request { query, service }) = requests.recv() {
        service.answer(query);
    }
}

impl Service {
    fn lock(&self) -> MutexGuard<'_, Option<OnLateRequest>> {
        self.on_request.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn answer(&self, query: Query) {
        let attachment = match Attachment::parse(query.attachment()) {
            Ok(attachment) => attachment,
            Err(fault) => return refuse(&query, &self.name, &fault.to_string()),
        };
        let Some(payload) = query.payload().filter(|payload| payload.len() <= MAX_REQUEST_BYTES)
        else {
            return refuse(&query, &self.name, "the request is empty or longer than 1 MiB");
        };
        let request = payload.to_bytes().into_owned();
        if let Some(on_request) = self.lock().as_mut() {
            let (name, key) = (self.name.clone(), self.key.clone());
            let send = Sending { query, attachment, name, key };
            on_request(&request, Responder::new(move |response| send.respond(response)));
        }
    }
}

/// A request whose response may come later.
struct Sending {
    query: Query,
    attachment: Attachment,
    name: String,
    key: KeyExpr<'static>,
}

impl Sending {
    fn respond(self, response: Option<Vec<u8>>) {
        let Self { query, attachment, name, key } = self;
        let Some(response) = response else {
            return refuse(&query, &name, "the request is malformed");
        };
        // The client recognises its response by its own sequence number and identity.
        let echo = Attachment { source_time_ns: now_ns(), ..attachment };
        let reply = query.reply(key, response).attachment(echo.to_bytes());
        if let Err(error) = reply.wait() {
            warn!("{name}: cannot send the response: {}", words(&error));
        }
    }
}

/// Sends the reason for a failure to the client; clients of rmw log it.
fn refuse(query: &Query, service: &str, reason: &str) {
    warn!("{service}: a request gets no response: {reason}");
    if let Err(error) = query.reply_err(reason).wait() {
        warn!("{service}: cannot send the error: {}", words(&error));
    }
}

/// A running service. Fields are dropped in order: the token is withdrawn first.
pub(super) struct ZenohServer {
    _token: LivelinessToken,
    _queryable: Queryable<()>,
    service: Arc<Service>,
    _node: Arc<Node>,
}

impl ZenohServer {
    pub(super) fn declare(
        node: &Arc<Node>,
        endpoint: &ServiceEndpoint,
        on_request: OnLateRequest,
    ) -> Result<Self, TransportError> {
        let ServiceEndpoint { name, kind } = endpoint;
        let keys = node.next_keys(&Endpoint {
            kind: EndpointKind::Service,
            name,
            type_name: kind.name,
            hash: kind.hash,
            qos: &QOS,
        })?;
        let refused = |error: zenoh::Error| endpoint_error(name, &error);
        let service = Arc::new(Service {
            name: name.clone(),
            key: keys.data.clone(),
            on_request: Mutex::new(Some(on_request)),
        });
        let (queried, requests) = (Arc::clone(&service), node.requests.clone());
        let queryable = node.session.declare_queryable(keys.data).complete(true);
        let queryable = queryable.callback(move |query| requests.put(query, &queried)).wait();
        let queryable = queryable.map_err(refused)?;
        let token = declare_token(&node.session, keys.token).map_err(refused)?;
        Ok(Self { _token: token, _queryable: queryable, service, _node: Arc::clone(node) })
    }
}

impl Server for ZenohServer {}

impl Drop for ZenohServer {
    fn drop(&mut self) {
        // Waits for a request in progress; waiting requests get no response.
        *self.service.lock() = None;
    }
}
