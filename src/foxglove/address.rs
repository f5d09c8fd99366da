//! Address of the server, restricted to the loopback interface.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};

use super::ViewError;

/// Default address of the server, which viewers also use by default.
pub(crate) const DEFAULT_ADDRESS: &str = "127.0.0.1:8765";

/// A loopback address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Address(SocketAddr);

impl Address {
    /// Parses `HOST:PORT` or `PORT`; port 0 selects any free port.
    ///
    /// # Errors
    /// The text has another form, or the address is not a loopback address.
    pub(crate) fn parse(text: &str) -> Result<Self, ViewError> {
        let loopback = IpAddr::V4(Ipv4Addr::LOCALHOST);
        let address = match text.strip_prefix("localhost:").unwrap_or(text).parse::<u16>() {
            Ok(port) => SocketAddr::new(loopback, port),
            Err(_no_port) => {
                text.parse().map_err(|_no_address| ViewError::Address(text.to_owned()))?
            }
        };
        if address.ip().is_loopback() {
            Ok(Self(address))
        } else {
            Err(ViewError::NotLoopback(address.ip(), address.port()))
        }
    }

    /// Returns the socket address.
    pub(crate) const fn socket(self) -> SocketAddr {
        self.0
    }

    /// Returns the host as written before `:PORT`.
    pub(super) fn host(self) -> String {
        match self.0.ip() {
            IpAddr::V4(ip) => ip.to_string(),
            IpAddr::V6(ip) => format!("[{ip}]"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loopback_addresses_are_accepted_in_every_form() {
        for (text, expected) in [
            (DEFAULT_ADDRESS, "127.0.0.1:8765"),
            ("9000", "127.0.0.1:9000"),
            ("localhost:0", "127.0.0.1:0"),
            ("127.1.2.3:80", "127.1.2.3:80"),
            ("[::1]:8765", "[::1]:8765"),
        ] {
            let address = Address::parse(text).unwrap();
            assert_eq!(address.socket().to_string(), expected);
            assert_eq!(format!("{}:{}", address.host(), address.socket().port()), expected);
        }
    }

    #[test]
    fn addresses_other_than_loopback_are_rejected() {
        for text in ["0.0.0.0:8765", "192.168.0.7:1", "[::]:8765", "8.8.8.8:8765"] {
            let error = Address::parse(text).unwrap_err();
            assert!(error.is_usage() && error.to_string().contains("ssh -L"), "{error}");
        }
    }

    #[test]
    fn a_malformed_address_is_rejected_with_the_expected_form() {
        for text in ["", "host", "127.0.0.1", "127.0.0.1:", "127.0.0.1:70000", ":80", "-1"] {
            let error = Address::parse(text).unwrap_err();
            assert!(error.is_usage() && error.to_string().contains("HOST:PORT"), "{error}");
        }
    }
}
