//! The WebSocket server and the messages it publishes to viewers.

use std::{
    collections::BTreeMap,
    io,
    net::{SocketAddr, TcpListener},
    ops::RangeInclusive,
    sync::{Arc, Mutex, atomic::Ordering},
    time::{Duration, SystemTime},
};

use tokio::runtime::{Builder, Runtime};
use tokio_tungstenite::tungstenite::Message;

use super::{
    Channel, ChannelDescription, ConnectionGraph, Desk, Entrance, ServiceDescription, ViewError,
    access::Rights,
    channels::Channels,
    door::Door,
    graph::Graph,
    protocol::{self, Level, Parameter, PlaybackState, Reply, Time},
    services::Services,
    viewers::{Viewer, Viewers, lock},
};

/// Number of threads for all connections.
const NUM_THREADS: usize = 2;
/// Timeout for closing the viewers' connections.
const CLOSE_TIMEOUT: Duration = Duration::from_millis(500);
/// Time between two looks whether the viewers' connections are closed.
const CLOSE_PERIOD: Duration = Duration::from_millis(10);

/// Settings of the server.
#[derive(Clone, Debug, Default)]
pub(crate) struct Settings {
    /// Name shown in viewers.
    pub(crate) name: String,
    /// Times of the first and last message of a recording, nanoseconds since the epoch; `None` for a live node.
    pub(crate) time_range_ns: Option<RangeInclusive<i64>>,
}

impl Settings {
    /// Returns the first message to every viewer.
    fn server_info(&self) -> String {
        let capabilities: &[&str] = if self.time_range_ns.is_some() {
            &["parameters", "parametersSubscribe", "time", "playbackControl"]
        } else {
            &["parameters", "parametersSubscribe", "services", "connectionGraph"]
        };
        let time = |time_ns: i64| Time::from_ns(time_ns.max(0) as u64);
        // Viewers forget what they know of a server that was started anew.
        let started = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        let info = Reply::ServerInfo {
            name: &self.name,
            capabilities,
            supported_encodings: &["cdr"],
            session_id: &started.unwrap_or_default().as_millis().to_string(),
            data_start_time: self.time_range_ns.as_ref().map(|range| time(*range.start())),
            data_end_time: self.time_range_ns.as_ref().map(|range| time(*range.end())),
        };
        info.encode()
    }
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
    pub(super) services: Services,
    pub(super) graph: Graph,
    viewers: Arc<Viewers>,
    info: String,
    /// Warnings shown to every viewer, by key.
    notes: Mutex<BTreeMap<String, String>>,
}

impl Server {
    /// Starts a server at an entrance.
    ///
    /// # Errors
    /// The port is in use, a file of the certificate is wrong, or the server cannot start.
    pub(crate) fn start(
        entrance: &Entrance,
        settings: &Settings,
        desk: Arc<dyn Desk>,
    ) -> Result<Self, ViewError> {
        let address = entrance.address.socket();
        let io = |source| ViewError::Io { address, source };
        let tls = entrance.tls.as_ref().map(super::TlsFiles::load).transpose()?;
        let listener = TcpListener::bind(address).map_err(|error| refusal(error, address))?;
        listener.set_nonblocking(true).map_err(io)?;
        let runtime = Builder::new_multi_thread()
            .worker_threads(NUM_THREADS)
            .thread_name("view")
            .enable_all()
            .build()
            .map_err(io)?;
        let shared = Arc::new(ServerState::new(desk, settings));
        let address = listener.local_addr().map_err(io)?;
        let door = Door::new(Arc::clone(&shared), entrance.access.clone(), tls);
        let inside = runtime.enter();
        let listener = tokio::net::TcpListener::from_std(listener).map_err(io)?;
        drop(inside);
        runtime.spawn(door.let_in(listener));
        Ok(Self { shared, address, runtime: Some(runtime) })
    }

    /// Address that the server listens on.
    pub(crate) const fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves a topic until the channel is dropped.
    ///
    /// # Errors
    /// The definition of its type is no text.
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
        self.shared.services.offer(description, on_request)
    }

    /// Removes a service.
    pub(crate) fn withdraw(&self, name: &str) {
        self.shared.services.withdraw(name);
    }

    /// Shows a warning to all current and later viewers. A later note with the same key replaces it.
    pub(crate) fn note(&self, key: &str, text: &str) {
        let mut notes = lock(&self.shared.notes);
        notes.insert(key.to_owned(), text.to_owned());
        self.shared.viewers.tell(&note(key, text));
    }

    /// Publishes the playback time, nanoseconds since the epoch.
    pub(crate) fn publish_time(&self, time_ns: i64) {
        self.shared.viewers.send(&Message::binary(protocol::time(time_ns.max(0) as u64)));
    }

    /// Publishes the playback state.
    pub(crate) fn publish_playback(&self, state: &PlaybackState) {
        self.shared.publish_playback(state);
    }

    /// Publishes the current parameter values to the viewers that subscribed to them.
    pub(crate) fn publish_parameters(&self) {
        self.shared.publish_parameters(&self.shared.desk.parameters(&[]));
    }

    /// True while a viewer is subscribed to the connection graph.
    pub(crate) fn is_graph_wanted(&self) -> bool {
        self.shared.viewers.all().iter().any(|viewer| viewer.wants_graph.load(Ordering::Relaxed))
    }

    /// Publishes the connection graph.
    pub(crate) fn publish_graph(&self, graph: ConnectionGraph) {
        self.shared.graph.publish(&self.shared.viewers, graph);
    }
}

impl ServerState {
    /// Returns the state of a server without viewers.
    pub(super) fn new(desk: Arc<dyn Desk>, settings: &Settings) -> Self {
        let viewers = Arc::<Viewers>::default();
        Self {
            desk,
            channels: Channels::new(Arc::clone(&viewers)),
            services: Services::new(Arc::clone(&viewers)),
            graph: Graph::default(),
            viewers,
            info: settings.server_info(),
            notes: Mutex::default(),
        }
    }

    /// Lets a viewer in: tells it everything that is there.
    pub(super) fn introduce(&self, rights: Rights) -> Arc<Viewer> {
        let viewer = self.channels.introduce(|| {
            let viewer = self.viewers.add(rights);
            viewer.outbox.push(Message::text(self.info.clone()));
            viewer
        });
        self.services.introduce(&viewer);
        for (key, text) in &*lock(&self.notes) {
            viewer.tell(&note(key, text));
        }
        self.desk.on_viewer();
        viewer
    }

    /// Forgets a viewer.
    pub(super) fn dismiss(&self, viewer: &Viewer) {
        self.viewers.remove(viewer.id);
        self.channels.leave(viewer);
    }

    pub(super) fn publish_playback(&self, state: &PlaybackState) {
        self.viewers.send(&Message::binary(state.encode()));
    }

    pub(super) fn publish_parameters(&self, parameters: &[Parameter]) {
        self.viewers.all().iter().for_each(|viewer| viewer.tell_watched(parameters));
    }
}

fn note<'a>(key: &'a str, text: &'a str) -> Reply<'a> {
    Reply::Status { level: Level::Warning as u8, message: text, id: Some(key) }
}

impl Drop for Server {
    fn drop(&mut self) {
        let Some(runtime) = self.runtime.take() else { return };
        let viewers = &self.shared.viewers;
        viewers.close();
        runtime.block_on(async {
            // Viewers that do not respond in time are disconnected.
            _ = tokio::time::timeout(CLOSE_TIMEOUT, async {
                while viewers.len() > 0 {
                    tokio::time::sleep(CLOSE_PERIOD).await;
                }
            })
            .await;
        });
        runtime.shutdown_background();
    }
}

fn refusal(source: io::Error, address: SocketAddr) -> ViewError {
    if source.kind() == io::ErrorKind::AddrInUse {
        ViewError::PortTaken(address)
    } else {
        ViewError::Io { address, source }
    }
}
