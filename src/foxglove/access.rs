//! Access control: judges from the head of the WebSocket handshake who may look and who may change things.
//!
//! Every page that an operator opens can connect to this machine; its browser states the page's origin. A program that
//! is no browser states none.

use std::{fmt::Write, net::IpAddr};

use thiserror::Error;
use tokio_tungstenite::tungstenite::{
    handshake::server::Request,
    http::{HeaderMap, HeaderValue, StatusCode, header},
};

use super::{protocol::SUBPROTOCOL, token::Token};

/// Foxglove's own page.
const FOXGLOVE: &str = "https://app.foxglove.dev";
/// Letters of a foreign name that are repeated in a warning.
const MAX_QUOTED: usize = 200;

/// Rights of a viewer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rights {
    /// Receive topics and read parameters.
    Look,
    /// Also set parameters, call services and control the playback.
    Change,
}

/// The reason that a viewer is refused.
#[derive(Debug, Error, PartialEq, Eq)]
pub(super) enum Refusal {
    /// The page is not trusted.
    #[error("the page {0} may not connect; --view-origin={0} allows it")]
    Origin(String),
    /// The name under which the server was reached is not one of this machine.
    #[error(
        "the host name {0:?} is not one of this machine; --view-origin=https://NAME allows a name, for a reverse proxy"
    )]
    Host(String),
    /// The token is wrong.
    #[error("its token is wrong; leave it out to look only")]
    Token,
    /// The viewer is too old.
    #[error("its WebSocket handshake failed: it does not speak {SUBPROTOCOL}; update Foxglove")]
    Protocol,
}

impl Refusal {
    /// Status of the HTTP response.
    pub(super) const fn status(&self) -> StatusCode {
        match self {
            Self::Origin(_) | Self::Host(_) => StatusCode::FORBIDDEN,
            Self::Token => StatusCode::UNAUTHORIZED,
            Self::Protocol => StatusCode::BAD_REQUEST,
        }
    }
}

/// The rules of a server.
#[derive(Clone, Debug, Default)]
pub(crate) struct Access {
    /// Origins of trusted pages, besides those of this machine and Foxglove's.
    pub(crate) origins: Vec<String>,
    /// Token that a viewer must state to change things. Without a token, every admitted viewer may.
    pub(crate) token: Option<Token>,
    /// Names under which the server may be reached.
    pub(crate) hosts: Hosts,
}

/// Names under which a server may be reached.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Hosts {
    /// Names of this machine and of the trusted pages: a page of a foreign name that was made to point here is refused.
    #[default]
    Local,
    /// Any: the certificate states the name.
    Any,
}

impl Access {
    /// Judges the head of a handshake.
    ///
    /// # Errors
    /// The reason for a refusal.
    pub(super) fn judge(&self, request: &Request) -> Result<Rights, Refusal> {
        let headers = request.headers();
        self.check_host(headers)?;
        self.check_origin(headers)?;
        let rights = self.rights(request.uri().query().unwrap_or_default())?;
        if speaks_protocol(headers) { Ok(rights) } else { Err(Refusal::Protocol) }
    }

    fn check_host(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        let hosts: Vec<_> = headers.get_all(header::HOST).iter().collect();
        let is_known = match (self.hosts, &*hosts) {
            (Hosts::Any, _) => true,
            (Hosts::Local, [host]) => host.to_str().is_ok_and(|host| {
                let name = without_port(host);
                is_local(name)
                    || self.origins.iter().any(|it| host_of(it.trim_end_matches('/')) == Some(name))
            }),
            (Hosts::Local, _) => false,
        };
        if is_known { Ok(()) } else { Err(Refusal::Host(quoted(&hosts))) }
    }

    fn check_origin(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        let origins: Vec<_> = headers.get_all(header::ORIGIN).iter().collect();
        let is_trusted = match &*origins {
            [] => true,
            [origin] => origin.to_str().is_ok_and(|origin| self.trusts(origin)),
            _ => false,
        };
        if is_trusted { Ok(()) } else { Err(Refusal::Origin(quoted(&origins))) }
    }

    fn trusts(&self, origin: &str) -> bool {
        let is_same = |known: &str| known.trim_end_matches('/').eq_ignore_ascii_case(origin);
        is_same(FOXGLOVE)
            || self.origins.iter().any(|known| is_same(known))
            || host_of(origin).is_some_and(is_local)
    }

    fn rights(&self, query: &str) -> Result<Rights, Refusal> {
        let stated = query.split('&').find_map(|part| part.strip_prefix("token="));
        match (&self.token, stated) {
            (None, _) => Ok(Rights::Change),
            (Some(_), None) => Ok(Rights::Look),
            (Some(token), Some(stated)) if token.is(stated) => Ok(Rights::Change),
            (Some(_), Some(_)) => Err(Refusal::Token),
        }
    }
}

fn speaks_protocol(headers: &HeaderMap) -> bool {
    let offered = headers.get_all(header::SEC_WEBSOCKET_PROTOCOL).iter();
    let mut names = offered.filter_map(|it| it.to_str().ok()).flat_map(|it| it.split(','));
    names.any(|name| name.trim() == SUBPROTOCOL)
}

/// True for the origin of a page: scheme and host, perhaps with a port. Pages in files and apps have other schemes.
pub(super) fn is_origin(text: &str) -> bool {
    let is_plain = text.bytes().all(|letter| letter.is_ascii_graphic());
    let rest = text.split_once("://").map(|(_, rest)| rest.trim_end_matches('/'));
    is_plain && rest.is_some_and(|rest| !rest.contains(['/', '@', '?', '#', '*', ',']))
}

/// The host of an origin of the web, without its port.
fn host_of(origin: &str) -> Option<&str> {
    let (scheme, rest) = origin.split_once("://")?;
    let is_web = scheme.eq_ignore_ascii_case("http") || scheme.eq_ignore_ascii_case("https");
    // An origin has neither a user nor a path.
    (is_web && !rest.contains(['/', '@', '?', '#'])).then(|| without_port(rest))
}

fn without_port(host: &str) -> &str {
    match host.rsplit_once(':') {
        // The colons of an address in brackets are part of it.
        Some((name, port)) if port.bytes().all(|it| it.is_ascii_digit()) => name,
        _ => host,
    }
}

fn is_local(name: &str) -> bool {
    let address = name.strip_prefix('[').and_then(|it| it.strip_suffix(']')).unwrap_or(name);
    name.eq_ignore_ascii_case("localhost")
        || address.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

/// Foreign names for a warning.
fn quoted(names: &[&HeaderValue]) -> String {
    let mut text = String::new();
    for name in names {
        let separator = if text.is_empty() { "" } else { ", " };
        // Writing to a text cannot fail.
        _ = write!(text, "{separator}{}", name.as_bytes().escape_ascii());
        if text.len() > MAX_QUOTED {
            text.truncate(MAX_QUOTED);
            text.push_str("...");
            break;
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(access: &Access, uri: &str, headers: &[(&str, &str)]) -> Result<Rights, Refusal> {
        let mut request = Request::builder().uri(uri);
        let protocol = [("Sec-WebSocket-Protocol", "foxglove.sdk.v1.1, foxglove.sdk.v1")];
        for (name, value) in protocol.iter().chain(headers) {
            request = request.header(*name, *value);
        }
        access.judge(&request.body(()).unwrap())
    }

    fn from(access: &Access, origin: &str) -> Result<Rights, Refusal> {
        judged(access, "/", &[("Host", "localhost:8765"), ("Origin", origin)])
    }

    #[test]
    fn pages_of_this_machine_and_of_foxglove_may_connect() {
        let access = Access { origins: vec!["https://lab.example/".into()], ..Access::default() };
        for origin in [
            FOXGLOVE,
            "https://lab.example",
            "http://localhost",
            "http://LOCALHOST:8080",
            "http://127.0.0.1:3000",
            "http://[::1]:3000",
        ] {
            assert_eq!(from(&access, origin), Ok(Rights::Change), "{origin}");
        }
        let program = judged(&access, "/", &[("Host", "127.0.0.1:8765")]);
        assert_eq!(program, Ok(Rights::Change), "a program states no origin");
    }

    #[test]
    fn other_pages_may_not() {
        let access = Access { origins: vec!["https://lab.example".into()], ..Access::default() };
        for origin in [
            "https://evil.example",
            "http://lab.example",
            "https://lab.example.evil.example",
            "https://app.foxglove.dev.evil.example",
            "https://app.foxglove.dev@evil.example",
            "https://evil.example/https://app.foxglove.dev",
            "http://localhost.evil.example",
            "http://127.0.0.1.evil.example",
            "http://evil.example:80/localhost",
            "http://localhost@evil.example",
            "http://evil.example#localhost",
            "chrome-extension://localhost",
            "file://",
            "null",
            "",
        ] {
            let refusal = from(&access, origin).unwrap_err();
            assert_eq!(refusal.status(), StatusCode::FORBIDDEN, "{origin}");
            let text = refusal.to_string();
            assert!(text.contains(origin) && text.contains("--view-origin"), "{text}");
        }
        let two = [("Host", "localhost"), ("Origin", FOXGLOVE), ("Origin", "https://evil.example")];
        assert!(matches!(judged(&access, "/", &two), Err(Refusal::Origin(_))));
    }

    #[test]
    fn a_foreign_name_that_points_to_this_machine_is_refused() {
        let access = Access { origins: vec!["https://lab.example".into()], ..Access::default() };
        for (host, is_known) in [
            ("localhost:8765", true),
            ("127.0.0.1:8765", true),
            ("127.8.9.1", true),
            ("[::1]:8765", true),
            ("lab.example", true),
            ("evil.example:8765", false),
            ("localhost.evil.example:8765", false),
            ("127.0.0.1.evil.example", false),
            ("0.0.0.0:8765", false),
            ("", false),
        ] {
            let judgement = judged(&access, "/", &[("Host", host)]);
            assert_eq!(judgement.is_ok(), is_known, "{host}: {judgement:?}");
        }
        assert!(matches!(judged(&access, "/", &[]), Err(Refusal::Host(_))));
        let two = [("Host", "localhost"), ("Host", "evil.example")];
        assert!(matches!(judged(&access, "/", &two), Err(Refusal::Host(_))));
        let anywhere = Access { hosts: Hosts::Any, ..Access::default() };
        assert_eq!(judged(&anywhere, "/", &[("Host", "10.0.0.7:8765")]), Ok(Rights::Change));
    }

    #[test]
    fn with_a_token_only_those_who_state_it_may_change_things() {
        let access = Access { token: Some(Token::new("s3cret").unwrap()), ..Access::default() };
        let with = |uri: &str| judged(&access, uri, &[("Host", "localhost")]);
        assert_eq!(with("/"), Ok(Rights::Look));
        assert_eq!(with("/?a=b&token=s3cret"), Ok(Rights::Change));
        for uri in ["/?token=", "/?token=s3cre", "/?token=s3crets", "/?token=x&token=s3cret"] {
            assert_eq!(with(uri), Err(Refusal::Token), "{uri}");
        }
    }

    #[test]
    fn a_long_name_is_quoted_in_part_and_without_control_characters() {
        let value = HeaderValue::from_bytes(&[0xff; 9000]).unwrap();
        let text = quoted(&[&value]);
        assert!(text.len() < 300 && text.starts_with("\\xff") && text.ends_with("..."), "{text}");
    }

    #[test]
    fn an_old_viewer_is_refused() {
        let old = Request::builder().header("Host", "localhost");
        let old = old.header("Sec-WebSocket-Protocol", "foxglove.websocket.v1").body(()).unwrap();
        assert_eq!(Access::default().judge(&old), Err(Refusal::Protocol));
    }
}
