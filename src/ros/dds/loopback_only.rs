//! Closes the ports of a participant to other machines.
//!
//! RustDDS 0.15.1 announces only the chosen networks, but binds its ports to all addresses
//! (`network/udp_listener.rs`). `SO_BINDTODEVICE` makes the kernel drop what arrives on other interfaces.

use std::{fs, io, os::fd::OwnedFd};

use rustix::{
    io::Errno,
    process::{PidfdFlags, PidfdGetfdFlags, getpid, pidfd_getfd, pidfd_open},
};
use socket2::{SockRef, Type};

/// First port of domain 0, and number of ports of a domain (RTPS 2.5, 9.6.2.3).
const FIRST_PORT: u32 = 7400;
const PORTS_PER_DOMAIN: u32 = 250;
const LOOPBACK: &[u8] = b"lo";

/// Restricts this process's ports in a domain to the loopback interface; returns their number.
///
/// # Errors
/// The system does not allow it, as in containers without `CAP_SYS_PTRACE`, or shows no such port.
pub(super) fn restrict(domain_id: u16) -> io::Result<usize> {
    let own = pidfd_open(getpid(), PidfdFlags::empty())?;
    let first = FIRST_PORT + PORTS_PER_DOMAIN * u32::from(domain_id);
    let ports = first..first + PORTS_PER_DOMAIN;
    let mut num_restricted = 0;
    for entry in fs::read_dir("/proc/self/fd")?.flatten() {
        let is_socket = fs::read_link(entry.path())
            .is_ok_and(|target| target.to_string_lossy().starts_with("socket:"));
        let Some(number) = entry.file_name().to_str().and_then(|name| name.parse().ok()) else {
            continue;
        };
        if !is_socket {
            continue;
        }
        // RustDDS keeps its sockets to itself: this is a second descriptor of the same one.
        let socket = match pidfd_getfd(&own, number, PidfdGetfdFlags::empty()) {
            // Another thread has closed it meanwhile.
            Err(Errno::BADF) => continue,
            socket => socket?,
        };
        if udp_port(&socket).is_some_and(|port| ports.contains(&port)) {
            SockRef::from(&socket).bind_device(Some(LOOPBACK))?;
            num_restricted += 1;
        }
    }
    if num_restricted == 0 {
        return Err(io::Error::other("no port of the domain is found in /proc/self/fd"));
    }
    Ok(num_restricted)
}

fn udp_port(socket: &OwnedFd) -> Option<u32> {
    let socket = SockRef::from(socket);
    let is_udp = socket.r#type().is_ok_and(|kind| kind == Type::DGRAM);
    let address = socket.local_addr().ok().filter(|_| is_udp)?;
    address.as_socket().map(|address| address.port().into())
}

#[cfg(test)]
mod tests {
    use std::net::UdpSocket;

    use super::*;

    #[test]
    fn only_ports_of_the_domain_are_restricted() {
        // Above the domains of other tests.
        let domain_id = 180;
        let first = u16::try_from(FIRST_PORT + PORTS_PER_DOMAIN * u32::from(domain_id)).unwrap();
        let inside = UdpSocket::bind(("0.0.0.0", first + 10)).unwrap();
        let outside = UdpSocket::bind(("0.0.0.0", 0)).unwrap();
        assert_eq!(restrict(domain_id).unwrap(), 1);
        let device = |socket: &UdpSocket| SockRef::from(socket).device().unwrap();
        assert_eq!(device(&inside).as_deref(), Some(LOOPBACK));
        assert_eq!(device(&outside), None);
    }
}
