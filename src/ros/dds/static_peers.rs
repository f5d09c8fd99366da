//! Telling named machines of this node where multicast does not reach them.
//!
//! RustDDS announces a participant by multicast, and to the first ports of participants on this machine, but to no
//! other address. So one of those ports is taken here, and what RustDDS sends there of itself is sent on to the peers.
//! They answer to the addresses in it, and discovery goes on without help.

use std::{
    io,
    net::{Ipv4Addr, SocketAddr, ToSocketAddrs, UdpSocket},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
};

use rustdds::GUID;

use super::settings::{DdsSettings, setting};
use crate::ros::transport::TransportError;

/// Participants on this machine that RustDDS sends its announcements to.
const LOCAL_PARTICIPANTS: u16 = 12;
/// Participants on a peer that are told: as many as Cyclone DDS looks for.
const PEER_PARTICIPANTS: u16 = 32;
/// RTPS: four letters, version, vendor, then the sender's prefix.
const PREFIX_AT: usize = 8;
const PREFIX_BYTES: usize = 12;
/// Longest UDP datagram.
const MAX_DATAGRAM_BYTES: usize = 65_536;

/// The port where a participant expects announcements (RTPS 9.6.2.3); `None` above 65535.
fn discovery_port(domain_id: u16, participant: u16) -> Option<u16> {
    u16::try_from(7410 + 250 * u32::from(domain_id) + 2 * u32::from(participant)).ok()
}

/// A port where announcements arrive, and where they go.
pub(super) struct Tap {
    socket: UdpSocket,
    peers: Vec<SocketAddr>,
}

impl Tap {
    /// Takes a port before the participant is made, so that not even the first announcement is missed; `None` when
    /// there are no static peers.
    ///
    /// # Errors
    /// A peer without an address; no free port.
    pub(super) fn open(settings: &DdsSettings) -> Result<Option<Self>, TransportError> {
        if settings.static_peers.is_empty() {
            return Ok(None);
        }
        let mut peers = Vec::new();
        for peer in &settings.static_peers {
            let address = address(peer)?;
            let ports = (0..PEER_PARTICIPANTS)
                .filter_map(|participant| discovery_port(settings.domain_id, participant));
            peers.extend(ports.map(|port| SocketAddr::from((address, port))));
        }
        // From above: participants take the lowest.
        let mut ports = (0..LOCAL_PARTICIPANTS)
            .rev()
            .filter_map(|participant| discovery_port(settings.domain_id, participant));
        let socket = ports.find_map(|port| UdpSocket::bind((Ipv4Addr::LOCALHOST, port)).ok());
        let occupied = || {
            let reason = format!(
                "the first {LOCAL_PARTICIPANTS} participant ports of domain {} are taken on this machine: give \
                 another ROS_DOMAIN_ID",
                settings.domain_id
            );
            setting("ROS_STATIC_PEERS", reason)
        };
        Ok(Some(Self { socket: socket.ok_or_else(occupied)?, peers }))
    }
}

/// RustDDS speaks IPv4 only.
fn address(peer: &str) -> Result<Ipv4Addr, TransportError> {
    let reason = || format!("{peer:?} is neither an IPv4 address nor the name of a host with one");
    let mut found = (peer, 0).to_socket_addrs().into_iter().flatten();
    let address = found.find_map(|address| match address {
        SocketAddr::V4(address) => Some(*address.ip()),
        SocketAddr::V6(_) => None,
    });
    address.ok_or_else(|| setting("ROS_STATIC_PEERS", reason()))
}

/// The thread that sends announcements on. It ends when dropped, after the participant's farewell has gone out.
pub(super) struct StaticPeers {
    socket: UdpSocket,
    is_stopped: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl StaticPeers {
    /// Starts sending on what `participant` says.
    ///
    /// # Errors
    /// The system has no socket or thread left.
    pub(super) fn start(tap: Tap, participant: GUID) -> Result<Self, TransportError> {
        let failed = |error: io::Error| setting("ROS_STATIC_PEERS", error.to_string());
        let socket = tap.socket.try_clone().map_err(failed)?;
        let is_stopped = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&is_stopped);
        let thread = thread::Builder::new()
            .name("dds static peers".to_owned())
            .spawn(move || forward(&tap, &participant.to_bytes()[..PREFIX_BYTES], &stop))
            .map_err(failed)?;
        Ok(Self { socket, is_stopped, thread: Some(thread) })
    }
}

impl Drop for StaticPeers {
    fn drop(&mut self) {
        self.is_stopped.store(true, Ordering::Release);
        // An empty datagram behind all that RustDDS sent wakes the thread.
        let woken = self.socket.local_addr().and_then(|own| self.socket.send_to(&[], own));
        match (woken, self.thread.take()) {
            (Ok(_), Some(thread)) => drop(thread.join()),
            (Err(error), _) => tracing::error!("static peers: {error}"),
            (Ok(_), None) => {}
        }
    }
}

fn forward(tap: &Tap, prefix: &[u8], is_stopped: &AtomicBool) {
    let mut buffer = vec![0; MAX_DATAGRAM_BYTES];
    loop {
        // An error is another host's refusal, told late: peers need not be there.
        let length = tap.socket.recv(&mut buffer).unwrap_or(0);
        if length == 0 && is_stopped.load(Ordering::Acquire) {
            return;
        }
        let datagram = &buffer[..length];
        if datagram.get(PREFIX_AT..PREFIX_AT + PREFIX_BYTES) != Some(prefix) {
            continue;
        }
        for peer in &tap.peers {
            if let Err(error) = tap.socket.send_to(datagram, peer) {
                tracing::debug!("static peer {peer}: {error}");
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_are_those_of_the_standard() {
        assert_eq!(discovery_port(0, 0), Some(7410));
        assert_eq!(discovery_port(232, 11), Some(65_432));
        assert_eq!(discovery_port(232, 100), None);
    }

    #[test]
    fn a_peer_without_an_address_is_refused_by_name() {
        for peer in ["", "::1", "no.such.host.invalid"] {
            let message = address(peer).unwrap_err().to_string();
            assert!(message.contains("ROS_STATIC_PEERS") && message.contains(peer), "{message}");
        }
        assert_eq!(address("192.0.2.1").unwrap(), Ipv4Addr::new(192, 0, 2, 1));
    }
}
