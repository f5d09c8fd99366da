//! The middleware process: carries out orders from standard input and reports events on standard output.

use std::{
    collections::BTreeMap,
    io::{self, Read, Write},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
        mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel},
    },
    thread,
    time::Duration,
};

use rustix::process::{Signal, getpid, getppid, kill_process};
use thiserror::Error;

use super::{
    calls::Calls,
    orders::{Event, Order, Origin, Types},
    outbox::{Kind, Outbox},
    wire::{self, Payload, WireError},
};
use crate::ros::{
    middleware::JoinRequest,
    transport::{
        OnArrival, Publication, Responder, Server, ServiceEndpoint, Subscription, TopicEndpoint,
        Transport, TransportError,
    },
};

/// Orders that may wait while one is carried out.
const MAX_ORDERS: usize = 64;
/// Time for leaving the network after the node has gone.
const FAREWELL: Duration = Duration::from_millis(1500);
const NODE_CHECK: Duration = Duration::from_millis(200);
/// Period at which matches and the state of the middleware are looked at.
const LOOK_PERIOD: Duration = Duration::from_millis(100);

/// Events for the node; clones share one queue.
#[derive(Clone, Default)]
pub(crate) struct Events {
    outbox: Arc<Outbox<Event>>,
    /// Messages and faults that made room for newer ones, since they were last reported.
    num_overrun: Arc<AtomicU64>,
}

impl Events {
    /// Adds an event without a payload, which stays.
    fn report(&self, event: Event) {
        self.outbox.push(Kind::Control, event, Payload::None);
    }

    /// Adds an event that may be dropped if the node is slow. Older ones make room for it.
    pub(super) fn deliver(&self, event: Event, payload: Payload) {
        for dropped in self.outbox.push(Kind::Message, event, payload) {
            if matches!(dropped, Event::Arrived { .. } | Event::Faulty { .. }) {
                self.num_overrun.fetch_add(1, Ordering::Relaxed);
            }
        }
    }
}

/// Errors that end the process.
#[derive(Debug, Error)]
pub(crate) enum HostError {
    /// The node's orders cannot be read, or a thread cannot be started.
    #[error("the middleware process: {0}")]
    Io(#[from] io::Error),
    /// The first order is not to join a network.
    #[error("the middleware process is started by `laser_profiler run`, not by hand")]
    NoNode,
}

/// Joins a network in this process.
pub(crate) type Join = fn(&JoinRequest) -> Result<Arc<dyn Transport>, TransportError>;

/// Carries out orders until the node closes `input`, then leaves the network. The node ends a process that hangs, and
/// [`end_with_node`] one whose node has gone.
///
/// # Errors
/// The system cannot create a thread, or there is no node.
pub(crate) fn run(
    input: impl Read + Send + 'static,
    output: impl Write + Send + 'static,
    events: &Events,
    join: Join,
) -> Result<(), HostError> {
    let writer = Arc::clone(&events.outbox);
    let written = spawn("to node", move || {
        // The node is gone: the reader sees it, too.
        drop(writer.write_to(output));
    })?;
    let (sender, orders) = sync_channel(MAX_ORDERS);
    spawn("from node", move || forward(input, &sender))?;
    let Some((Order::Join(request), _)) = orders.recv().ok() else {
        return Err(HostError::NoNode);
    };
    match join(&request) {
        Ok(transport) => {
            let max_reliable_bytes = transport.max_reliable_bytes();
            events.report(Event::Joined { max_reliable_bytes });
            Host::new(transport, events.clone()).carry_out(&orders);
        }
        Err(error) => events.report(Event::NotJoined(error)),
    }
    events.outbox.close();
    // A thread that panicked has reported it.
    drop(written.join());
    Ok(())
}

/// Starts a thread that kills this process some time after its node, so that one that hangs does not outlive it.
///
/// # Errors
/// The system cannot create a thread.
pub(crate) fn end_with_node() -> io::Result<()> {
    let node = getppid();
    let watch = move || {
        while getppid() == node {
            thread::sleep(NODE_CHECK);
        }
        thread::sleep(FAREWELL);
        // A signal, because a hung library may hang in `exit`, too.
        _ = kill_process(getpid(), Signal::KILL);
    };
    spawn("node watch", watch).map(drop)
}

fn spawn(name: &str, run: impl FnOnce() + Send + 'static) -> io::Result<thread::JoinHandle<()>> {
    thread::Builder::new().name(name.to_owned()).spawn(run)
}

/// Passes orders on until the node closes the pipe.
fn forward(mut input: impl Read, orders: &SyncSender<(Order, Vec<u8>)>) {
    loop {
        match wire::read(&mut input) {
            Ok(Some(order)) => {
                if orders.send(order).is_err() {
                    return;
                }
            }
            Ok(None) | Err(WireError::Pipe(_)) => return,
            Err(error) => return tracing::error!("orders of the node: {error}"),
        }
    }
}

enum Endpoint {
    Publication(Box<dyn Publication>),
    Subscription(Box<dyn Subscription>),
    Service { _server: Box<dyn Server> },
}

impl Endpoint {
    fn num_matched(&self) -> usize {
        match self {
            Self::Publication(publication) => publication.num_matched(),
            Self::Subscription(subscription) => subscription.num_matched(),
            Self::Service { .. } => 0,
        }
    }
}

struct Host {
    events: Events,
    types: Types,
    calls: Arc<Calls>,
    endpoints: BTreeMap<u64, Endpoint>,
    /// Last reported number of matches, by endpoint.
    matched: BTreeMap<u64, usize>,
    has_failed: bool,
    transport: Arc<dyn Transport>,
}

impl Host {
    fn new(transport: Arc<dyn Transport>, events: Events) -> Self {
        Self {
            events,
            types: Types::default(),
            calls: Arc::default(),
            endpoints: BTreeMap::new(),
            matched: BTreeMap::new(),
            has_failed: false,
            transport,
        }
    }

    fn carry_out(mut self, orders: &Receiver<(Order, Vec<u8>)>) {
        let mut looked = std::time::Instant::now();
        loop {
            match orders.recv_timeout(LOOK_PERIOD.saturating_sub(looked.elapsed())) {
                Ok((order, payload)) => self.obey(order, payload),
                Err(RecvTimeoutError::Timeout) => {}
                // Services that wait for an answer would not end.
                Err(RecvTimeoutError::Disconnected) => return self.calls.close(),
            }
            if looked.elapsed() >= LOOK_PERIOD {
                looked = std::time::Instant::now();
                self.look();
            }
        }
    }

    fn obey(&mut self, order: Order, payload: Vec<u8>) {
        match order {
            Order::Advertise { id, topic } => {
                let topic = self.types.topic(topic);
                let created = self.transport.advertise(&topic);
                self.enter(id, created.map(Endpoint::Publication));
            }
            Order::Subscribe { id, topic, limit_bytes } => {
                let topic = self.types.topic(topic);
                let created = self.subscribe(id, &topic, limit_bytes);
                self.enter(id, created.map(Endpoint::Subscription));
            }
            Order::Serve { id, service } => {
                let service = self.types.service(service);
                let created = self.serve(id, &service);
                self.enter(id, created.map(|server| Endpoint::Service { _server: server }));
            }
            Order::Publish { id, source_time_ns } => {
                self.publish(id, &payload.into(), source_time_ns);
            }
            Order::Answer { call, is_answered } => {
                self.calls.answer(call, is_answered.then_some(payload));
            }
            Order::Remove { id } => {
                // A service that waits for an answer would not end.
                self.calls.end(id);
                self.endpoints.remove(&id);
                self.matched.remove(&id);
            }
            Order::ListTopics => self.events.report(Event::Topics(self.transport.topics())),
            Order::Join(_) => {
                tracing::error!("the middleware process has joined a network already");
            }
        }
    }

    fn enter(&mut self, id: u64, created: Result<Endpoint, TransportError>) {
        let error = match created {
            Ok(endpoint) => {
                self.endpoints.insert(id, endpoint);
                None
            }
            Err(error) => Some(error),
        };
        self.events.report(Event::Created { id, error });
    }

    fn publish(&mut self, id: u64, data: &Arc<[u8]>, source_time_ns: i64) {
        // A publisher that was rejected has been reported.
        let Some(Endpoint::Publication(publication)) = self.endpoints.get_mut(&id) else { return };
        if let Err(error) = publication.publish(data, source_time_ns) {
            self.events.report(Event::Unsent { id, error });
        }
    }

    fn subscribe(
        &self,
        id: u64,
        topic: &TopicEndpoint,
        limit_bytes: usize,
    ) -> Result<Box<dyn Subscription>, TransportError> {
        let events = self.events.clone();
        let on_arrival: OnArrival = Box::new(move |arrival| match arrival {
            Ok(arrival) => {
                let origin = Origin {
                    publisher: arrival.publisher,
                    sequence: arrival.sequence,
                    source_time_ns: arrival.source_time_ns,
                    receive_time_ns: arrival.receive_time_ns,
                };
                events.deliver(Event::Arrived { id, origin }, Payload::Owned(arrival.data));
            }
            Err(fault) => events.deliver(Event::Faulty { id, fault }, Payload::None),
        });
        self.transport.subscribe(topic, limit_bytes, on_arrival)
    }

    fn serve(&self, id: u64, service: &ServiceEndpoint) -> Result<Box<dyn Server>, TransportError> {
        let (events, calls) = (self.events.clone(), Arc::clone(&self.calls));
        let on_request = Box::new(move |request: &[u8], responder: Responder| {
            if let Some(call) = calls.begin(id, responder) {
                let requested = Event::Requested { id, call };
                events.outbox.push(Kind::Control, requested, Payload::Owned(request.to_vec()));
            }
        });
        self.transport.serve_late(service, on_request)
    }

    /// Reports that orders are carried out, new matches, losses, and a middleware that no longer works.
    fn look(&mut self) {
        self.events.deliver(Event::Alive, Payload::None);
        for (id, endpoint) in &self.endpoints {
            let num_matched = endpoint.num_matched();
            if self.matched.insert(*id, num_matched).unwrap_or(0) != num_matched {
                self.events.report(Event::Matched { id: *id, num_matched });
            }
        }
        let num_messages = self.events.num_overrun.swap(0, Ordering::Relaxed);
        if num_messages > 0 {
            self.events.report(Event::Overrun { num_messages });
        }
        if !self.has_failed
            && let Some(reason) = self.transport.failure()
        {
            self.has_failed = true;
            self.events.report(Event::Failed { reason });
        }
    }
}
