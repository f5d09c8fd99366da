//! Live view: a server to which Foxglove connects over its WebSocket protocol.
//!
//! Edge: sockets and threads. It forwards encoded messages and passes viewer requests to a `Desk`; it depends neither
//! on the node nor on recordings. A slow viewer never blocks others: messages are dropped for that viewer only.
//! `access` decides who comes in.

mod protocol;
mod token;
mod access;
mod address;
mod tls;
mod outbox;
mod viewers;
mod channels;
mod services;
mod graph;
mod connection;
mod door;
mod server;

pub(crate) use access::{Access, Hosts};
pub(crate) use address::{Address, DEFAULT_ADDRESS};
pub(crate) use channels::{Channel, ChannelDescription};
pub use graph::ConnectionGraph;
pub use protocol::{
    Parameter, ParameterType, ParameterValue, PlaybackCommand, PlaybackControlRequest,
    PlaybackState, PlaybackStatus,
};
pub(crate) use server::{Server, Settings};
pub(crate) use services::ServiceDescription;
pub(crate) use tls::TlsFiles;
pub(crate) use token::Token;

use std::path::PathBuf;

use thiserror::Error;

/// Errors of starting the view.
#[derive(Debug, Error)]
pub(crate) enum ViewError {
    /// The address is malformed.
    #[error("--view={0:?}: must be HOST:PORT or PORT, as in {DEFAULT_ADDRESS}")]
    Address(String),
    /// Other machines could reach the server, and read along.
    #[error(
        "--view={0}: other machines can reach this address, so --view-cert and --view-key must name a certificate and its \
         key in PEM; without them use --view on 127.0.0.1 and an SSH tunnel (ssh -L {1}:127.0.0.1:{1} THIS_MACHINE) or a \
         reverse proxy with TLS",
        address.ip(), address.port()
    )]
    Unencrypted {
        /// The address.
        address: std::net::SocketAddr,
    },
    /// Only one of the two files of a certificate is given.
    #[error("--view-cert and --view-key: give both or neither")]
    HalfCertificate,
    /// A file of the certificate is wrong.
    #[error("{}: {why}; --view-cert must name certificates and --view-key their private key, in PEM", path.display())]
    Tls {
        /// The file.
        path: PathBuf,
        /// The reason.
        why: String,
    },
    /// The token is malformed.
    #[error("--view-token: must be 6 to 128 letters, digits, '-', '_' or '.'")]
    Token,
    /// The system has no randomness for a token.
    #[error("--view: no token could be generated: {0}; give one with --view-token=TOKEN")]
    Randomness(#[source] std::io::Error),
    /// An origin is malformed.
    #[error(
        "--view-origin={0:?}: must be an origin such as https://studio.example.com or http://10.0.0.7:8080"
    )]
    Origin(String),
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
    /// The definition of a topic's type is no text.
    #[error("{0}: the definition of its type is no UTF-8 text")]
    Schema(String),
    /// Another service has the same name.
    #[error("{0}: another service has this name")]
    Service(String),
}

impl ViewError {
    /// True if the command line is wrong.
    pub(crate) const fn is_usage(&self) -> bool {
        matches!(
            self,
            Self::Address(_)
                | Self::Unencrypted { .. }
                | Self::HalfCertificate
                | Self::Token
                | Self::Origin(_)
        )
    }
}

/// Where viewers come in, and by which rules.
#[derive(Clone, Debug)]
pub(crate) struct Entrance {
    /// Address to listen on.
    pub(crate) address: Address,
    /// Rules of admission.
    pub(crate) access: Access,
    /// Encryption; `None` only on this machine.
    pub(crate) tls: Option<TlsFiles>,
}

impl Entrance {
    /// Makes the rules of an address. On this machine every admitted viewer may change things, unless there is a token.
    /// Elsewhere viewers need TLS, and a token to change things, which is made if none is given.
    ///
    /// # Errors
    /// An origin is malformed, or other machines could reach the address without TLS.
    pub(crate) fn new(
        address: Address,
        origins: Vec<String>,
        token: Option<Token>,
        tls: Option<TlsFiles>,
    ) -> Result<Self, ViewError> {
        if let Some(wrong) = origins.iter().find(|origin| !access::is_origin(origin)) {
            return Err(ViewError::Origin(wrong.clone()));
        }
        let (token, hosts) = match (address.is_loopback(), &tls) {
            (true, _) => (token, Hosts::Local),
            (false, None) => return Err(ViewError::Unencrypted { address: address.socket() }),
            (false, Some(_)) => (Some(token.map_or_else(Token::generate, Ok)?), Hosts::Any),
        };
        Ok(Self { address, access: Access { origins, token, hosts }, tls })
    }

    /// Returns the URL for viewers of the server that listens on `socket`. One that listens on all addresses is reached
    /// under any name of this machine.
    pub(crate) fn url(&self, socket: std::net::SocketAddr) -> String {
        let scheme = if self.tls.is_some() { "wss" } else { "ws" };
        let token = self.access.token.as_ref();
        let token = token.map(|token| format!("/?token={}", token.secret())).unwrap_or_default();
        if socket.ip().is_unspecified() {
            format!("{scheme}://THIS_MACHINE:{}{token}", socket.port())
        } else {
            format!("{scheme}://{socket}{token}")
        }
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

#[cfg(test)]
mod tests;
