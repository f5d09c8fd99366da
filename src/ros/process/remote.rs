//! The node's side: a [`Transport`] whose middleware runs in another process.

use std::{
    io,
    sync::{
        Arc, Condvar, Mutex, PoisonError,
        atomic::Ordering,
        mpsc::{Receiver, RecvTimeoutError, sync_channel},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use super::{
    events::{self, Inbox},
    link::WorkerCommand,
    lock,
    orders::Order,
    outbox::Kind,
    registry::{Entry, Orders, Registry, Request, Role},
    supervisor::{Stopper, Supervisor},
    wire::Payload,
};
use crate::ros::{
    middleware::{JoinRequest, Middleware},
    transport::{
        GraphTopic, Health, OnArrival, OnLateRequest, OnRequest, Publication, Responder, Server,
        ServiceEndpoint, Subscription, TopicEndpoint, Transport, TransportError, at_once,
    },
};

/// Longest wait for an endpoint, in a process that may start anew meanwhile.
const CREATION: Duration = Duration::from_secs(10);
/// Longest wait for the list of topics; afterwards, the last known one is returned.
const LISTING: Duration = Duration::from_millis(500);
/// Requests to a service that may wait.
const MAX_REQUESTS: usize = 16;

/// State shared by the threads of a transport.
#[derive(Default)]
pub(super) struct Shared {
    pub(super) registry: Registry,
    pub(super) health: Mutex<Health>,
    /// The last list of topics, and the number of lists so far.
    pub(super) topics: Mutex<(Vec<GraphTopic>, u64)>,
    pub(super) listed: Condvar,
}

/// A middleware in a process of its own: whatever happens to it, the node goes on, and the process is replaced.
pub(crate) struct RemoteTransport {
    shared: Arc<Shared>,
    middleware: Middleware,
    max_reliable_bytes: Option<usize>,
    stopper: Arc<Stopper>,
    supervisor: Option<JoinHandle<()>>,
}

impl RemoteTransport {
    /// Starts the process and joins the network.
    ///
    /// # Errors
    /// The process cannot be started, or cannot join the network.
    pub(crate) fn start(
        command: WorkerCommand,
        request: JoinRequest,
    ) -> Result<Self, TransportError> {
        let middleware = request.middleware;
        let (shared, stopper) = (Arc::<Shared>::default(), Arc::<Stopper>::default());
        let (supervisor, max_reliable_bytes) =
            Supervisor::start(command, request, Arc::clone(&shared), Arc::clone(&stopper))?;
        let supervisor = thread::Builder::new()
            .name("middleware".to_owned())
            .spawn(move || supervisor.run())
            .map_err(|error| no_thread(&error))?;
        let supervisor = Some(supervisor);
        Ok(Self { shared, middleware, max_reliable_bytes, stopper, supervisor })
    }

    fn create(&self, entry: &Arc<Entry>) -> Result<u64, TransportError> {
        let (sender, created) = sync_channel(1);
        let id = self.shared.registry.add(entry, sender);
        match created.recv_timeout(CREATION) {
            Ok(Some(error)) => {
                self.shared.registry.remove(id);
                Err(error)
            }
            // Without a process, the next one creates it.
            Ok(None) | Err(RecvTimeoutError::Disconnected) => Ok(id),
            Err(RecvTimeoutError::Timeout) => {
                tracing::warn!("{}: the middleware takes long to create it", entry.name);
                Ok(id)
            }
        }
    }
}

pub(super) fn no_thread(error: &io::Error) -> TransportError {
    TransportError::Unreachable(format!("cannot start the middleware process: {error}"))
}

impl Drop for RemoteTransport {
    fn drop(&mut self) {
        self.stopper.stop();
        if let Some(supervisor) = self.supervisor.take() {
            // A thread that panicked has reported it.
            drop(supervisor.join());
        }
    }
}

impl Transport for RemoteTransport {
    fn name(&self) -> &'static str {
        self.middleware.name()
    }

    fn max_reliable_bytes(&self) -> Option<usize> {
        self.max_reliable_bytes
    }

    fn advertise(&self, topic: &TopicEndpoint) -> Result<Box<dyn Publication>, TransportError> {
        let entry = Arc::new(Entry::publisher(topic));
        let id = self.create(&entry)?;
        Ok(Box::new(RemotePublication { id, entry, shared: Arc::clone(&self.shared) }))
    }

    fn subscribe(
        &self,
        topic: &TopicEndpoint,
        limit_bytes: usize,
        on_arrival: OnArrival,
    ) -> Result<Box<dyn Subscription>, TransportError> {
        let entry = Arc::new(Entry::subscriber(topic, limit_bytes, on_arrival));
        let id = self.create(&entry)?;
        Ok(Box::new(RemoteSubscription { id, entry, shared: Arc::clone(&self.shared) }))
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
        let (sender, requests) = sync_channel(MAX_REQUESTS);
        let entry = Arc::new(Entry::server(service, sender));
        let thread = thread::Builder::new()
            .name(format!("service {}", service.name))
            .spawn(move || answer_all(&requests, on_request))
            .map_err(|error| TransportError::Endpoint {
                name: service.name.clone(),
                reason: format!("cannot start a thread: {error}"),
            })?;
        let id = self.create(&entry)?;
        let shared = Arc::clone(&self.shared);
        Ok(Box::new(RemoteServer { id, entry: Some(entry), shared, thread: Some(thread) }))
    }

    fn topics(&self) -> Vec<GraphTopic> {
        let known = lock(&self.shared.topics);
        let num_before = known.1;
        let Some(orders) = self.shared.registry.orders() else { return known.0.clone() };
        orders.push(Kind::Control, Order::ListTopics, Payload::None);
        let is_old = |known: &mut (Vec<GraphTopic>, u64)| known.1 == num_before;
        let waited = self.shared.listed.wait_timeout_while(known, LISTING, is_old);
        waited.unwrap_or_else(PoisonError::into_inner).0.0.clone()
    }

    fn health(&self) -> Health {
        lock(&self.shared.health).clone()
    }
}

fn answer_all(requests: &Receiver<Request>, mut on_request: OnLateRequest) {
    for Request { call, data, asker } in requests {
        let unanswered = Unanswered(Some(asker), call);
        on_request(&data, Responder::new(move |answer| unanswered.answer(answer)));
    }
}

/// A request that the process waits to be answered. Dropping it answers that there is no response.
struct Unanswered(Option<Arc<Orders>>, u64);

impl Unanswered {
    fn answer(mut self, answer: Option<Vec<u8>>) {
        self.send(answer);
    }

    fn send(&mut self, answer: Option<Vec<u8>>) {
        let Some(asker) = self.0.take() else { return };
        let order = Order::Answer { call: self.1, is_answered: answer.is_some() };
        asker.push(Kind::Control, order, answer.map_or(Payload::None, Payload::Owned));
    }
}

impl Drop for Unanswered {
    fn drop(&mut self) {
        self.send(None);
    }
}

struct RemotePublication {
    id: u64,
    entry: Arc<Entry>,
    shared: Arc<Shared>,
}

impl Publication for RemotePublication {
    /// An error may be that of an earlier message: the process reports it later.
    fn publish(&mut self, data: &Arc<[u8]>, source_time_ns: i64) -> Result<(), TransportError> {
        let is_kept = self.entry.keep(data, source_time_ns);
        if let Some(orders) = self.shared.registry.orders() {
            let publish = Order::Publish { id: self.id, source_time_ns };
            let dropped = orders.push(Kind::Message, publish, Payload::Shared(Arc::clone(data)));
            events::note_dropped(&self.shared.registry, &dropped);
        } else if !is_kept {
            let reason = "the middleware is being started again, the message is dropped";
            self.entry.note_unsent(TransportError::Endpoint {
                name: self.entry.name.clone(),
                reason: reason.to_owned(),
            });
        }
        self.entry.take_unsent().map_or(Ok(()), Err)
    }

    fn num_matched(&self) -> usize {
        self.entry.num_matched.load(Ordering::Relaxed)
    }
}

impl Drop for RemotePublication {
    fn drop(&mut self) {
        self.shared.registry.remove(self.id);
    }
}

struct RemoteSubscription {
    id: u64,
    entry: Arc<Entry>,
    shared: Arc<Shared>,
}

impl Subscription for RemoteSubscription {
    fn num_matched(&self) -> usize {
        self.entry.num_matched.load(Ordering::Relaxed)
    }
}

impl Drop for RemoteSubscription {
    fn drop(&mut self) {
        self.shared.registry.remove(self.id);
        // Waits for a delivery under way, unless this is it.
        if let Role::Subscriber { on_arrival, .. } = &self.entry.role
            && !Inbox::is_delivering()
        {
            drop(lock(on_arrival));
        }
    }
}

struct RemoteServer {
    id: u64,
    entry: Option<Arc<Entry>>,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Server for RemoteServer {}

impl Drop for RemoteServer {
    fn drop(&mut self) {
        self.shared.registry.remove(self.id);
        // The thread ends when no request can come any more.
        drop(self.entry.take());
        let Some(thread) = self.thread.take() else { return };
        if thread.thread().id() != thread::current().id() && thread.join().is_err() {
            tracing::error!("the thread of a service panicked");
        }
    }
}
