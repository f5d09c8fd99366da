//! Announces this node to named machines that multicast does not reach.
//!
//! RustDDS announces a participant by multicast and to the first participant ports on this machine, but to no other
//! address. This module therefore binds one of those ports and forwards the participant's own announcements to the
//! peers. They reply to the addresses in the announcement, and discovery continues on its own.

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

/// Number of participants on this machine to which RustDDS sends announcements.
const LOCAL_PARTICIPANTS: u16 = 12;
/// Number of participants on a peer that receive announcements; the number that Cyclone DDS checks.
const PEER_PARTICIPANTS: u16 = 32;
/// Offset of the sender's GUID prefix in RTPS: after four letters, version and vendor.
const PREFIX_AT: usize = 8;
const PREFIX_BYTES: usize = 12;
/// Largest UDP datagram.
const MAX_DATAGRAM_BYTES: usize = 65_536;

/// Returns the port on which a participant expects announcements (RTPS 9.6.2.3); `None` above 65535.
fn discovery_port(domain_id: u16, participant: u16) -> Option<u16> {
    u16::try_from(7410 + 250 * u32::from(domain_id) + 2 * u32::from(participant)).ok()
}

/// The port that receives announcements, and the peers they are forwarded to.
pub(super) struct Tap {
    socket: UdpSocket,
    peers: Vec<SocketAddr>,
}

impl Tap {
    /// Binds a port before the participant is created, so that the first announcement is not missed; `None` if there
    /// are no static peers.
    ///
    /// # Errors
    /// A peer without an IPv4 address; no free port.
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
        // From the highest: participants use the lowest.
        let mut ports = (0..LOCAL_PARTICIPANTS)
            .rev()
            .filter_map(|participant| discovery_port(settings.domain_id, participant));
        let socket = ports.find_map(|port| UdpSocket::bind((Ipv4Addr::LOCALHOST, port)).ok());
        let occupied = || {
            let reason = format!(
                "the first {LOCAL_PARTICIPANTS} participant ports of domain {} are in use on this machine: set \
                 another ROS_DOMAIN_ID",
                settings.domain_id
            );
            setting("ROS_STATIC_PEERS", reason)
        };
        Ok(Some(Self { socket: socket.ok_or_else(occupied)?, peers }))
    }
}

/// Resolves a peer; RustDDS supports IPv4 only.
pub(super) fn address(peer: &str) -> Result<Ipv4Addr, TransportError> {
    let reason = || format!("{peer:?} is neither an IPv4 address nor the name of a host with one");
    let mut found = (peer, 0).to_socket_addrs().into_iter().flatten();
    let address = found.find_map(|address| match address {
        SocketAddr::V4(address) => Some(*address.ip()),
        SocketAddr::V6(_) => None,
    });
    address.ok_or_else(|| setting("ROS_STATIC_PEERS", reason()))
}

/// The thread that forwards announcements. It ends when dropped, after forwarding the participant's farewell.
pub(super) struct StaticPeers {
    socket: UdpSocket,
    is_stopped: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl StaticPeers {
    /// Starts forwarding the announcements of `participant`.
    ///
    /// # Errors
    /// The system cannot create a socket or thread.
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
        // An empty datagram after all datagrams of RustDDS wakes the thread.
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
        // An error is a delayed rejection by another host; peers may be absent.
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
    fn a_peer_without_an_address_is_rejected_by_name() {
        for peer in ["", "::1", "no.such.host.invalid"] {
            let message = address(peer).unwrap_err().to_string();
            assert!(message.contains("ROS_STATIC_PEERS") && message.contains(peer), "{message}");
        }
        assert_eq!(address("192.0.2.1").unwrap(), Ipv4Addr::new(192, 0, 2, 1));
    }
}
