//! Asks new clients for the request that they may have sent too early.
//!
//! A client sends its first request once it knows this node, which may be some milliseconds before RustDDS knows the
//! client and accepts its requests. RustDDS then asks with an `ACKNACK` whose count is 0, but Fast DDS takes counts from
//! 1, so that the request would come again only with Fast DDS's next heartbeat: 3 s later.

use std::{
    net::{SocketAddr, UdpSocket},
    sync::mpsc::{self, Receiver, SyncSender},
    thread::{self, JoinHandle},
    time::Duration,
};

use rustdds::{DomainParticipant, GUID};

use super::{rtps, second_copies::usable};

/// Most clients that wait to be asked; more are not asked.
const MAX_WAITING: usize = 16;
/// A match may be reported before the client's addresses can be looked up: lookups, and the time between them.
pub(super) const NUM_LOOKUPS: usize = 10;
pub(super) const LOOKUP_PERIOD: Duration = Duration::from_millis(5);

/// A match of an own reader of requests with a client's writer.
pub(super) struct Match {
    pub(super) reader: GUID,
    pub(super) writer: GUID,
}

/// The thread that asks. It ends when dropped.
pub(super) struct FirstRequests {
    matches: Option<SyncSender<Match>>,
    thread: Option<JoinHandle<()>>,
}

impl FirstRequests {
    /// Starts the thread, which sends by `socket`.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub(super) fn start(domain: DomainParticipant, socket: UdpSocket) -> std::io::Result<Self> {
        let (matches, waiting) = mpsc::sync_channel(MAX_WAITING);
        let thread = thread::Builder::new()
            .name("dds first requests".to_owned())
            .spawn(move || ask_all(&domain, &socket, &waiting))?;
        Ok(Self { matches: Some(matches), thread: Some(thread) })
    }

    /// Asks a client. Returns at once.
    pub(super) fn ask(&self, client: Match) {
        // If the queue is full, the client's first request comes late, as without this module.
        _ = self.matches.as_ref().map(|matches| matches.try_send(client));
    }
}

impl Drop for FirstRequests {
    fn drop(&mut self) {
        drop(self.matches.take());
        if self.thread.take().is_some_and(|thread| thread.join().is_err()) {
            tracing::error!("the thread of first DDS requests panicked");
        }
    }
}

fn ask_all(domain: &DomainParticipant, socket: &UdpSocket, waiting: &Receiver<Match>) {
    for Match { reader, writer } in waiting {
        let Some(addresses) = addresses_of(domain, writer) else { continue };
        let message = rtps::ask_for_first(reader, writer);
        for address in usable(&addresses) {
            if let Err(error) = socket.send_to(&message, address) {
                tracing::debug!("a client at {address}: {error}");
            }
        }
    }
}

fn addresses_of(domain: &DomainParticipant, writer: GUID) -> Option<Vec<SocketAddr>> {
    for _ in 0..NUM_LOOKUPS {
        let mut known = domain.discovered_writers().into_iter().map(|known| known.writer_proxy);
        if let Some(known) = known.find(|known| known.remote_writer_guid == writer) {
            return Some(known.unicast_locator_list.into_iter().map(SocketAddr::from).collect());
        }
        thread::sleep(LOOKUP_PERIOD);
    }
    None
}
