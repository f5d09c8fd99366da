//! Finds out why no router answers: a session connects in the background and keeps the reason to itself.

use std::{sync::mpsc::sync_channel, thread, time::Duration};

use zenoh::Wait;

use super::{
    session::{self, ENCRYPTED, START_ROUTER},
    settings::ZenohSettings,
};

/// Longest wait for an answer.
const TIMEOUT: Duration = Duration::from_secs(3);

/// Returns the reason that there is no router at `peers`, and the remedy.
pub(super) fn reason(settings: &ZenohSettings, peers: &str) -> String {
    // Without encryption, no router is the only reason.
    let is_encrypted = ENCRYPTED.iter().any(|protocol| peers.contains(protocol));
    match is_encrypted.then(|| cause(settings)).flatten() {
        Some(cause) if is_refusal(&cause) => format!(
            "the encrypted connection to the Zenoh router at {peers} fails: {cause}. Check root_ca_certificate, \
             connect_certificate, connect_private_key and verify_name_on_connect in transport/link/tls of the configuration"
        ),
        Some(cause) => format!("no Zenoh router at {peers} ({cause}): {START_ROUTER}"),
        None => format!("no Zenoh router at {peers}: {START_ROUTER}"),
    }
}

/// Connects once more, in a session of its own, which returns the error.
fn cause(settings: &ZenohSettings) -> Option<String> {
    let mut config = session::config(settings).ok()?;
    for (key, value) in [
        ("mode", "'peer'"),
        ("listen/endpoints", "[]"),
        ("connect/timeout_ms", "0"),
        ("connect/exit_on_failure", "true"),
    ] {
        config.insert_json5(key, value).ok()?;
    }
    let (sender, answer) = sync_channel(1);
    let open = move || {
        // Nobody may be waiting any more.
        drop(sender.send(zenoh::open(config).wait().err().map(|error| session::words(&error))));
    };
    thread::Builder::new().name("zenoh probe".to_owned()).spawn(open).ok()?;
    answer.recv_timeout(TIMEOUT).ok().flatten()
}

/// True if the other side was reached and one of the two refuses the other.
fn is_refusal(cause: &str) -> bool {
    let cause = cause.to_lowercase();
    ["certificate", "alert", "handshake"].iter().any(|word| cause.contains(word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_are_told_from_missing_routers() {
        assert!(is_refusal("invalid peer certificate: UnknownIssuer"));
        assert!(is_refusal("received fatal alert: CertificateRequired"));
        assert!(!is_refusal("Connection refused (os error 111)"));
    }
}
