//! The door of the server: how many come in, and in what time. Nobody who waits at the door costs more than a few
//! kilobytes for a few seconds.

use std::{
    net::SocketAddr,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use tokio::{
    io::{AsyncRead, AsyncWrite},
    net::{TcpListener, TcpStream},
    sync::{OwnedSemaphorePermit, Semaphore},
    time::timeout,
};
use tokio_rustls::TlsAcceptor;

use super::{
    access::{Access, Refusal},
    connection::{self, Times, Unadmitted},
    server::ServerState,
};

/// Viewers that may be connected. Each may cost the bytes of its outbox.
pub(super) const MAX_VIEWERS: usize = 16;
/// Handshakes under way; the head of each may have 64 KB. Others wait in the system's queue.
const MAX_HANDSHAKES: usize = 32;
/// Time in which a handshake must end.
const HANDSHAKE_TIMEOUT: Duration = Duration::from_secs(5);
/// Pause after the system could not accept a connection, for example because it has no more files.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Lets viewers in.
pub(super) struct Door {
    state: Arc<ServerState>,
    access: Access,
    tls: Option<TlsAcceptor>,
    seats: Arc<Semaphore>,
    handshakes: Arc<Semaphore>,
    was_old_reported: AtomicBool,
}

impl Door {
    /// Returns a door with these rules.
    pub(super) fn new(state: Arc<ServerState>, access: Access, tls: Option<TlsAcceptor>) -> Self {
        Self {
            state,
            access,
            tls,
            seats: Arc::new(Semaphore::new(MAX_VIEWERS)),
            handshakes: Arc::new(Semaphore::new(MAX_HANDSHAKES)),
            was_old_reported: AtomicBool::new(false),
        }
    }

    /// Lets viewers in, for ever.
    pub(super) async fn let_in(self, listener: TcpListener) {
        let door = Arc::new(self);
        loop {
            let Ok(permit) = Arc::clone(&door.handshakes).acquire_owned().await else { return };
            match listener.accept().await {
                Ok((stream, peer)) => {
                    tokio::spawn(Arc::clone(&door).receive(stream, peer, permit));
                }
                Err(error) => {
                    tracing::warn!("--view: a viewer cannot connect: {error}");
                    tokio::time::sleep(ACCEPT_PAUSE).await;
                }
            }
        }
    }

    async fn receive(
        self: Arc<Self>,
        stream: TcpStream,
        peer: SocketAddr,
        permit: OwnedSemaphorePermit,
    ) {
        // Without a delay for more: pictures are followed by their lines.
        _ = stream.set_nodelay(true);
        let Some(tls) = &self.tls else { return self.attend(stream, peer, permit).await };
        match timeout(HANDSHAKE_TIMEOUT, tls.accept(stream)).await {
            Ok(Ok(stream)) => self.attend(stream, peer, permit).await,
            Ok(Err(error)) => tracing::debug!("viewer {peer}: {error}"),
            Err(_late) => tracing::debug!("viewer {peer}: no TLS handshake in time"),
        }
    }

    async fn attend<S: AsyncRead + AsyncWrite + Unpin>(
        &self,
        stream: S,
        peer: SocketAddr,
        handshake: OwnedSemaphorePermit,
    ) {
        let admitted = timeout(HANDSHAKE_TIMEOUT, connection::admit(stream, &self.access)).await;
        drop(handshake);
        match admitted {
            Ok(Ok((socket, rights))) => {
                // Only now, so that silent connections take no viewer's seat.
                let Ok(_seat) = self.seats.try_acquire() else {
                    // Dropping the socket disconnects it.
                    return tracing::warn!(
                        "viewer {peer} is refused: {MAX_VIEWERS} viewers are connected, the most this view serves; close \
                         one"
                    );
                };
                connection::serve(socket, &self.state, rights, Times::default()).await;
            }
            Ok(Err(Unadmitted::Refused(refusal))) => self.report(&refusal, peer),
            Ok(Err(error @ Unadmitted::Failed(_))) => tracing::debug!("viewer {peer}: {error}"),
            Err(_late) => tracing::debug!("viewer {peer}: no handshake in time"),
        }
    }

    fn report(&self, refusal: &Refusal, peer: SocketAddr) {
        // A viewer that is too old keeps trying.
        let is_repeated =
            *refusal == Refusal::Protocol && self.was_old_reported.swap(true, Ordering::Relaxed);
        if !is_repeated {
            tracing::warn!("viewer {peer} is refused: {refusal}");
        }
    }
}
