//! The UDP sockets of this process: Cyclone neither restricts them to an interface nor tells their buffers.
//!
//! Cyclone receives on all interfaces, whatever is configured. Linux can bind an open socket to one.
#![expect(unsafe_code, reason = "sockets are opened by Cyclone and borrowed here by their number")]

use std::{
    collections::BTreeMap,
    fs, io,
    os::fd::{BorrowedFd, RawFd},
    path::Path,
};

use socket2::{SockRef, Type};

/// Open UDP sockets, by number; each with the kernel's name for it, which tells it from a later one of the same number.
#[derive(Debug, Default)]
pub(crate) struct Sockets(BTreeMap<RawFd, String>);

impl Sockets {
    /// Lists the open ones; none on systems without `/proc`.
    pub(crate) fn open() -> Self {
        let Ok(entries) = fs::read_dir("/proc/self/fd") else { return Self::default() };
        let sockets = entries.flatten().filter_map(|entry| {
            let number = entry.file_name().to_str()?.parse().ok()?;
            let name = name(&entry.path())?;
            let is_udp = with(number, |socket| {
                Ok(socket.r#type()? == Type::DGRAM && socket.local_addr()?.as_socket().is_some())
            });
            is_udp.unwrap_or(false).then_some((number, name))
        });
        Self(sockets.collect())
    }

    /// Returns those that were not open before.
    pub(crate) fn without(mut self, before: &Self) -> Self {
        self.0.retain(|number, name| before.0.get(number) != Some(name));
        self
    }

    /// Binds those that receive from anywhere to the loopback interface.
    ///
    /// # Errors
    /// The system cannot, or finds no such socket; then nothing is known to be restricted.
    #[cfg(target_os = "linux")]
    pub(crate) fn bind_to_loopback(&self) -> Result<(), String> {
        let why =
            |error: io::Error| format!("cannot bind a socket to the loopback interface: {error}");
        let mut num_bound = 0;
        for number in self.0.keys() {
            let is_open = |socket: &SockRef<'_>| {
                let address = socket.local_addr()?.as_socket();
                Ok(address.is_some_and(|address| address.ip().is_unspecified()))
            };
            if with(*number, is_open).map_err(why)? {
                with(*number, |socket| socket.bind_device(Some(b"lo"))).map_err(why)?;
                num_bound += 1;
            }
        }
        if num_bound == 0 {
            Err("the domain's sockets are not found in /proc".to_owned())
        } else {
            Ok(())
        }
    }

    #[cfg(not(target_os = "linux"))]
    pub(crate) fn bind_to_loopback(&self) -> Result<(), String> {
        Err("sockets can be restricted to the loopback interface on Linux only".to_owned())
    }

    /// Returns the interfaces to which sockets are bound that receive on these ports.
    #[cfg(test)]
    pub(crate) fn devices(&self, is_wanted: impl Fn(u16) -> bool) -> Vec<Option<String>> {
        let devices = self.0.keys().filter_map(|number| {
            with(*number, |socket| {
                let address = socket.local_addr()?.as_socket();
                let is_wanted = address.is_some_and(|address| {
                    address.ip().is_unspecified() && is_wanted(address.port())
                });
                let device =
                    socket.device()?.map(|name| String::from_utf8_lossy(&name).into_owned());
                Ok(is_wanted.then_some(device))
            })
            .ok()
            .flatten()
        });
        devices.collect()
    }

    /// Returns the smallest receive buffer, bytes, as it was asked for.
    pub(crate) fn receive_buffer_bytes(&self) -> Option<usize> {
        let sizes = self.0.keys().filter_map(|number| {
            // Those bound to an address only send.
            let is_receiver = |socket: &SockRef<'_>| {
                let address = socket.local_addr()?.as_socket();
                Ok(address.is_some_and(|address| address.ip().is_unspecified()))
            };
            let is_receiver = with(*number, is_receiver).unwrap_or(false);
            is_receiver.then(|| with(*number, |socket| socket.recv_buffer_size()).ok()).flatten()
        });
        // Linux doubles it for its own bookkeeping.
        sizes.min().map(|size| if cfg!(target_os = "linux") { size / 2 } else { size })
    }
}

/// Returns the kernel's name of a socket, such as `socket:[12345]`.
fn name(entry: &Path) -> Option<String> {
    let target = fs::read_link(entry).ok()?;
    target.to_str().filter(|name| name.starts_with("socket:")).map(str::to_owned)
}

fn with<T>(number: RawFd, use_it: impl FnOnce(&SockRef<'_>) -> io::Result<T>) -> io::Result<T> {
    // SAFETY: it is not -1. Another thread may close it meanwhile; then the calls fail, or ask another socket, which
    // is harmless: only sockets that appeared while a domain was created are changed.
    let borrowed = unsafe { BorrowedFd::borrow_raw(number) };
    use_it(&SockRef::from(&borrowed))
}
