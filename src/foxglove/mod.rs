//! Live view: this process as a server that Foxglove connects to, over its WebSocket protocol.
//!
//! Edge: sockets and threads. It hands on bytes that others made and asks a [`Desk`] for what viewers want; it knows
//! neither the node nor recordings. Nobody ever waits for a viewer: what one cannot take in time is lost to it alone.

mod address;
mod channels;
mod listener;
mod parameters;
mod services;
mod server;

pub use address::{Address, DEFAULT_ADDRESS};
pub use channels::{Channel, ChannelDescription};
pub use foxglove::websocket::{
    ConnectionGraph, Parameter, ParameterType, ParameterValue, PlaybackCommand,
    PlaybackControlRequest, PlaybackState, PlaybackStatus,
};
pub use server::{Server, Settings};
pub use services::ServiceDescription;

use thiserror::Error;

/// Why there is no view.
#[derive(Debug, Error)]
pub enum ViewError {
    /// An address that is none.
    #[error("--view={0:?}: must be HOST:PORT or PORT, as in {DEFAULT_ADDRESS}")]
    Address(String),
    /// An address that others could reach.
    #[error(
        "--view={0}: the view is for this machine only, because nobody who connects is asked who he is: give a loopback \
         address (127.0.0.1, [::1] or localhost), and from elsewhere come through ssh -L {1}:127.0.0.1:{1}"
    )]
    NotLoopback(std::net::IpAddr, u16),
    /// Somebody else has the port.
    #[error(
        "--view: port {} of {} is taken, by another view perhaps: end that, or choose a port by --view={}:PORT",
        .0.port(), .0.ip(), .0.ip()
    )]
    PortTaken(std::net::SocketAddr),
    /// The system refuses.
    #[error("--view: {address}: {source}")]
    Io {
        /// Where the server was to listen.
        address: std::net::SocketAddr,
        /// Why it cannot.
        #[source]
        source: std::io::Error,
    },
    /// The library refuses.
    #[error("--view: {0}")]
    Library(#[from] foxglove::FoxgloveError),
}

impl ViewError {
    /// Whether what was asked for is to blame.
    pub const fn is_usage(&self) -> bool {
        matches!(self, Self::Address(_) | Self::NotLoopback(..))
    }
}

/// What viewers may ask for. Called on a thread of the server's; the answers to playback must come at once.
pub trait Desk: Send + Sync + 'static {
    /// The named parameters, all of them where no name is given. Names that do not exist are left out.
    fn parameters(&self, names: &[String]) -> Vec<Parameter>;

    /// Sets one after another; why some of them were refused, in words. May take a moment.
    fn set_parameters(&self, wishes: Vec<Parameter>) -> Vec<String>;

    /// Plays, pauses, jumps; the state that follows. `None`: nothing is played here.
    fn control(&self, request: &PlaybackControlRequest) -> Option<PlaybackState>;

    /// A viewer has come.
    fn on_viewer(&self);

    /// A viewer wants a topic that it did not want before.
    fn on_subscribe(&self, topic: &str);
}
