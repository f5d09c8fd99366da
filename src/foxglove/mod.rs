//! Live view: this process as a server that Foxglove connects to, over its WebSocket protocol.
//!
//! Edge: sockets and threads. It forwards encoded messages and passes viewer requests to a `Desk`; it depends on
//! neither the node nor recordings. A slow viewer never blocks others: messages are dropped for that viewer only.

mod address;
mod channels;
mod listener;
mod parameters;
mod services;
mod server;

pub(crate) use address::{Address, DEFAULT_ADDRESS};
pub(crate) use channels::{Channel, ChannelDescription};
pub use foxglove::websocket::{
    ConnectionGraph, Parameter, ParameterType, ParameterValue, PlaybackCommand,
    PlaybackControlRequest, PlaybackState, PlaybackStatus,
};
pub(crate) use server::{Server, Settings};
pub(crate) use services::ServiceDescription;

use thiserror::Error;

/// Errors of starting the view.
#[derive(Debug, Error)]
pub(crate) enum ViewError {
    /// An address that is none.
    #[error("--view={0:?}: must be HOST:PORT or PORT, as in {DEFAULT_ADDRESS}")]
    Address(String),
    /// An address that other machines could reach.
    #[error(
        "--view={0}: must be a loopback address (127.0.0.1, [::1] or localhost), because the server has no client \
         authentication; for remote access use an SSH tunnel: ssh -L {1}:127.0.0.1:{1}"
    )]
    NotLoopback(std::net::IpAddr, u16),
    /// The port is in use.
    #[error(
        "--view: port {} of {} is already in use, perhaps by another view: stop it, or choose another port with --view={}:PORT",
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
    /// True if the command line is wrong.
    pub(crate) const fn is_usage(&self) -> bool {
        matches!(self, Self::Address(_) | Self::NotLoopback(..))
    }
}

/// Requests of viewers. Called on a server thread; playback requests must return immediately.
pub(crate) trait Desk: Send + Sync + 'static {
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
