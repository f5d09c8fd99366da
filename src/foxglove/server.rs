//! The WebSocket server and the messages it publishes to viewers.

use std::{
    collections::BTreeMap,
    io,
    net::SocketAddr,
    ops::RangeInclusive,
    sync::{
        Arc, Mutex, PoisonError, RwLock,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use foxglove::{
    FoxgloveError, WebSocketServer, WebSocketServerHandle,
    websocket::{Capability, ConnectionGraph, Parameter, PlaybackState, Status},
};
use tokio::runtime::{Builder, Runtime};

use super::{
    Address, Channel, ChannelDescription, Desk, ServiceDescription, ViewError, channels::Channels,
    listener::Listener, parameters::Parameters, services,
};

/// Messages queued per viewer; the oldest are dropped first. About 50 MB of previews.
const BACKLOG_MESSAGES: usize = 256;
/// Number of threads for all connections.
const NUM_THREADS: usize = 2;
/// Timeout for closing the viewers' connections.
const CLOSE_TIMEOUT: Duration = Duration::from_millis(500);

/// Settings of the server.
#[derive(Clone, Debug, Default)]
pub(crate) struct Settings {
    /// Name shown in viewers.
    pub(crate) name: String,
    /// Times of the first and last message of a recording, nanoseconds since the epoch; `None` for a live node.
    pub(crate) time_range_ns: Option<RangeInclusive<i64>>,
}

/// A server that viewers connect to, until it is dropped.
pub(crate) struct Server {
    shared: Arc<ServerState>,
    address: SocketAddr,
    runtime: Option<Runtime>,
}

/// State shared by the server's threads.
pub(super) struct ServerState {
    pub(super) desk: Arc<dyn Desk>,
    pub(super) channels: Channels,
    handle: RwLock<Option<WebSocketServerHandle>>,
    /// Warnings shown to every viewer, by key.
    notes: Mutex<BTreeMap<String, String>>,
    is_graph_wanted: AtomicBool,
}

impl Server {
    /// Starts a server that listens on `address`.
    ///
    /// # Errors
    /// The port is in use, or the server cannot start.
    pub(crate) fn start(
        address: Address,
        settings: Settings,
        desk: Arc<dyn Desk>,
    ) -> Result<Self, ViewError> {
        let io = |source| ViewError::Io { address: address.socket(), source };
        let runtime = Builder::new_multi_thread()
            .worker_threads(NUM_THREADS)
            .thread_name("view")
            .enable_all()
            .build()
            .map_err(io)?;
        let shared = Arc::new(ServerState {
            desk,
            channels: Channels::new(),
            handle: RwLock::default(),
            notes: Mutex::default(),
            is_graph_wanted: AtomicBool::new(false),
        });
        let parameters = Parameters::start(Arc::downgrade(&shared)).map_err(io)?;
        let mut capabilities = vec![Capability::Parameters];
        let mut server = WebSocketServer::new()
            .name(settings.name)
            .bind(address.host(), address.socket().port())
            .context(&shared.channels.context)
            .message_backlog_size(BACKLOG_MESSAGES)
            .supported_encodings(["cdr"])
            .parameter_handler(Arc::new(parameters))
            .listener(Arc::new(Listener(Arc::downgrade(&shared))));
        if let Some(range_ns) = settings.time_range_ns {
            capabilities.extend([Capability::Time, Capability::PlaybackControl]);
            server = server.playback_time_range(
                *range_ns.start().max(&0) as u64,
                *range_ns.end().max(&0) as u64,
            );
        } else {
            capabilities.extend([Capability::Services, Capability::ConnectionGraph]);
        }
        let started = runtime.block_on(server.capabilities(capabilities).start());
        let handle = started.map_err(|error| refusal(error, address.socket()))?;
        let address = SocketAddr::new(address.socket().ip(), handle.port());
        *shared.handle.write().unwrap_or_else(PoisonError::into_inner) = Some(handle);
        Ok(Self { shared, address, runtime: Some(runtime) })
    }

    /// Address that the server listens on.
    pub(crate) const fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves a topic until the channel is dropped.
    ///
    /// # Errors
    /// The Foxglove library rejects the topic.
    pub(crate) fn open(&self, topic: ChannelDescription) -> Result<Arc<Channel>, ViewError> {
        self.shared.channels.open(topic)
    }

    /// Number of messages sent to viewers so far.
    pub(crate) fn num_sent(&self) -> u64 {
        self.shared.channels.num_sent()
    }

    /// Offers a service. `on_request` receives and returns CDR bytes, or returns `None` for a malformed request.
    ///
    /// # Errors
    /// Another service has the same name.
    pub(crate) fn serve(
        &self,
        description: ServiceDescription<'_>,
        on_request: impl Fn(&[u8]) -> Option<Vec<u8>> + Send + Sync + 'static,
    ) -> Result<(), ViewError> {
        let service = services::service(description, on_request);
        Ok(self.shared.with(|handle| handle.add_services([service])).unwrap_or(Ok(()))?)
    }

    /// Removes a service.
    pub(crate) fn withdraw(&self, name: &str) {
        self.shared.with(|handle| handle.remove_services([name]));
    }

    /// Shows a warning to all current and later viewers. A later note with the same key replaces it.
    pub(crate) fn note(&self, key: &str, text: &str) {
        let mut notes = self.shared.notes.lock().unwrap_or_else(PoisonError::into_inner);
        notes.insert(key.to_owned(), text.to_owned());
        drop(notes);
        self.shared.publish_notes();
    }

    /// Publishes the playback time, nanoseconds since the epoch.
    pub(crate) fn publish_time(&self, time_ns: i64) {
        self.shared.with(|handle| handle.broadcast_time(time_ns.max(0) as u64));
    }

    /// Publishes the playback state.
    pub(crate) fn publish_playback(&self, state: PlaybackState) {
        self.shared.with(|handle| handle.broadcast_playback_state(state));
    }

    /// Publishes the current parameter values to the viewers that subscribed to them.
    pub(crate) fn publish_parameters(&self) {
        self.shared.publish_parameters(self.shared.desk.parameters(&[]));
    }

    /// True if a viewer has subscribed to the connection graph.
    pub(crate) fn is_graph_wanted(&self) -> bool {
        self.shared.is_graph_wanted.load(Ordering::Relaxed)
    }

    /// Publishes the connection graph.
    pub(crate) fn publish_graph(&self, graph: ConnectionGraph) {
        let published = self.shared.with(|handle| handle.publish_connection_graph(graph));
        if let Some(Err(error)) = published {
            tracing::debug!("cannot publish the connection graph: {error}");
        }
    }
}

impl ServerState {
    fn with<T>(&self, act: impl FnOnce(&WebSocketServerHandle) -> T) -> Option<T> {
        self.handle.read().unwrap_or_else(PoisonError::into_inner).as_ref().map(act)
    }

    pub(super) fn publish_notes(&self) {
        let notes = self.notes.lock().unwrap_or_else(PoisonError::into_inner).clone();
        for (key, text) in notes {
            self.with(|handle| handle.publish_status(Status::warning(text).with_id(key)));
        }
    }

    pub(super) fn publish_parameters(&self, parameters: Vec<Parameter>) {
        self.with(|handle| handle.publish_parameter_values(parameters));
    }

    pub(super) fn want_graph(&self) {
        self.is_graph_wanted.store(true, Ordering::Relaxed);
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let handle = self.shared.handle.write().unwrap_or_else(PoisonError::into_inner).take();
        let Some(runtime) = self.runtime.take() else { return };
        if let Some(handle) = handle {
            let stopped = handle.stop();
            runtime.block_on(async {
                // Viewers that do not respond in time are disconnected.
                _ = tokio::time::timeout(CLOSE_TIMEOUT, stopped.wait()).await;
            });
        }
        runtime.shutdown_background();
    }
}

fn refusal(error: FoxgloveError, address: SocketAddr) -> ViewError {
    match error {
        FoxgloveError::Bind(source) if source.kind() == io::ErrorKind::AddrInUse => {
            ViewError::PortTaken(address)
        }
        FoxgloveError::Bind(source) => ViewError::Io { address, source },
        other => ViewError::Library(other),
    }
}
