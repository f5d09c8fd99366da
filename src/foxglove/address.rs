//! Address of the server.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};

use super::ViewError;

/// Default address of the server, which viewers also use by default.
pub(crate) const DEFAULT_ADDRESS: &str = "127.0.0.1:8765";

/// An address of this machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Address(SocketAddr);

impl Address {
    /// Parses `HOST:PORT` or `PORT`; port 0 selects any free port.
    ///
    /// # Errors
    /// The text has another form.
    pub(crate) fn parse(text: &str) -> Result<Self, ViewError> {
        let loopback = IpAddr::V4(Ipv4Addr::LOCALHOST);
        match text.strip_prefix("localhost:").unwrap_or(text).parse::<u16>() {
            Ok(port) => Ok(Self(SocketAddr::new(loopback, port))),
            Err(_no_port) => {
                let parsed = text.parse().map(Self);
                parsed.map_err(|_no_address| ViewError::Address(text.to_owned()))
            }
        }
    }

    /// Returns the socket address.
    pub(crate) const fn socket(self) -> SocketAddr {
        self.0
    }

    /// True if only this machine can reach it.
    pub(crate) const fn is_loopback(self) -> bool {
        self.0.ip().is_loopback()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_accepted_in_every_form() {
        for (text, expected, is_loopback) in [
            (DEFAULT_ADDRESS, "127.0.0.1:8765", true),
            ("9000", "127.0.0.1:9000", true),
            ("localhost:0", "127.0.0.1:0", true),
            ("127.1.2.3:80", "127.1.2.3:80", true),
            ("[::1]:8765", "[::1]:8765", true),
            ("0.0.0.0:8765", "0.0.0.0:8765", false),
            ("[::]:8765", "[::]:8765", false),
            ("192.168.0.7:1", "192.168.0.7:1", false),
        ] {
            let address = Address::parse(text).unwrap();
            assert_eq!(address.socket().to_string(), expected);
            assert_eq!(address.is_loopback(), is_loopback, "{text}");
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
