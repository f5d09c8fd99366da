//! Live view: a server to which Foxglove connects over its WebSocket protocol.
//!
//! Edge: sockets and threads. It forwards encoded messages and passes viewer requests to a `Desk`; it depends neither
//! on the node nor on recordings. A slow viewer never blocks others: messages are dropped for that viewer only.

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
    /// The address is malformed.
    #[error("--view={0:?}: must be HOST:PORT or PORT, as in {DEFAULT_ADDRESS}")]
    Address(String),
    /// The address is not a loopback address.
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
    /// Input or output failed.
    #[error("--view: {address}: {source}")]
    Io {
        /// Address that the server was to listen on.
        address: std::net::SocketAddr,
        /// Cause.
        #[source]
        source: std::io::Error,
    },
    /// The Foxglove library reports an error.
    #[error("--view: {0}")]
    Library(#[from] foxglove::FoxgloveError),
}

impl ViewError {
    /// True if the command line is wrong.
    pub(crate) const fn is_usage(&self) -> bool {
        matches!(self, Self::Address(_) | Self::NotLoopback(..))
    }
}

/// Handler of viewer requests. The methods run on the server's threads; all but the parameter methods must not block.
pub(crate) trait Desk: Send + Sync + 'static {
    /// Returns the named parameters, or all if `names` is empty. Unknown names are ignored.
    fn parameters(&self, names: &[String]) -> Vec<Parameter>;

    /// Sets parameters one after another. Returns the reasons of refusals as text. May block.
    fn set_parameters(&self, parameters: Vec<Parameter>) -> Vec<String>;

    /// Plays, pauses or seeks. Returns the resulting state; `None` if there is no playback.
    fn control(&self, request: &PlaybackControlRequest) -> Option<PlaybackState>;

    /// Called when a viewer has connected.
    fn on_viewer(&self);

    /// Called when a viewer has subscribed to a topic.
    fn on_subscribe(&self, topic: &str);
}
