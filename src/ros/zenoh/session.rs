//! Sessions: configured like `rmw_zenoh_cpp`, with errors that state the remedy.

use std::{thread, time::Duration};

use tracing::{info, warn};
use zenoh::{Config, Session, Wait, config::Locator};

use super::{
    probe,
    settings::{Role, RouterCheck, ZenohSettings, config_variable},
};
use crate::ros::transport::TransportError;

/// Key and JSON5 value.
type Values = &'static [(&'static str, &'static str)];

/// As in rmw's two configuration files, except where noted.
const COMMON: Values = &[
    ("scouting/multicast/enabled", "false"),
    ("scouting/gossip/target", "{ router: ['router', 'peer'], peer: ['router'] }"),
    ("timestamping/enabled", "{ router: true, peer: true, client: true }"),
    ("transport/unicast/open_timeout", "60000"),
    ("transport/unicast/accept_timeout", "60000"),
    ("transport/unicast/accept_pending", "10000"),
    ("transport/unicast/max_sessions", "10000"),
    ("transport/link/tx/lease", "60000"),
    ("transport/link/tx/keep_alive", "2"),
    ("transport/shared_memory/enabled", "false"),
    ("transport/shared_memory/transport_optimization/pool_size", "50331648"),
    ("transport/shared_memory/transport_optimization/message_size_threshold", "512"),
    // rmw drops a message after 1 and 50 ms, which loses clouds and images on a busy machine.
    ("transport/link/tx/queue/congestion_control/drop/wait_before_drop", "50000"),
    ("transport/link/tx/queue/congestion_control/drop/max_wait_before_drop_fragments", "500000"),
    // rmw accepts messages of up to 1 GiB before they can be rejected.
    ("transport/link/rx/max_message_size", "268435456"),
];

const NODE: Values = &[
    ("mode", "'peer'"),
    ("connect/endpoints", "['tcp/localhost:7447']"),
    ("connect/timeout_ms", "{ router: -1, peer: -1, client: 0 }"),
    ("connect/exit_on_failure", "{ router: false, peer: false, client: true }"),
    // rmw waits up to 4 s between attempts; here a returning router is joined sooner.
    ("connect/retry", "{ period_init_ms: 500, period_max_ms: 1000, period_increase_factor: 2 }"),
    ("listen/endpoints", "['tcp/localhost:0']"),
    (
        "scouting/gossip/autoconnect_strategy",
        "{ peer: { to_router: 'always', to_peer: 'greater-zid' } }",
    ),
    ("queries_default_timeout", "600000"),
    ("transport/link/tx/queue/congestion_control/block/wait_before_close", "60000000"),
];

const ROUTER: Values = &[
    ("mode", "'router'"),
    ("connect/endpoints", "[]"),
    ("listen/endpoints", "['tcp/[::]:7447']"),
    ("transport/link/tx/queue/congestion_control/block/wait_before_close", "5000000"),
];

/// Time between two checks for a router.
const CHECK_PERIOD: Duration = Duration::from_secs(1);

/// Remedy for a missing router.
pub(super) const START_ROUTER: &str = "start one (`--router` here, or `ros2 run rmw_zenoh_cpp rmw_zenohd`), or set its address: \
                            ZENOH_CONFIG_OVERRIDE='connect/endpoints=[\"tcp/192.168.1.1:7447\"]'";

/// Opens a session; waits for a router according to the settings.
///
/// # Errors
/// Settings that Zenoh rejects; a port that cannot be opened.
pub(super) fn open(settings: &ZenohSettings) -> Result<Session, TransportError> {
    let config = config(settings)?;
    let peers = config.get_json("connect/endpoints").unwrap_or_default();
    let ports = config.get_json("listen/endpoints").unwrap_or_default();
    let session = zenoh::open(config).wait().map_err(|error| {
        let words = words(&error);
        TransportError::Unreachable(if settings.role == Role::Router {
            format!(
                "cannot open a Zenoh router on {ports}: {words}. If another router uses the port, omit --router or \
                 choose another port: ZENOH_CONFIG_OVERRIDE='listen/endpoints=[\"tcp/[::]:7448\"]'"
            )
        } else {
            format!(
                "cannot open a Zenoh session that connects to {peers} and listens on {ports}: {words}. If there is no \
                 router, {START_ROUTER}"
            )
        })
    })?;
    match settings.role {
        Role::Node => check_for_router(&session, settings, &peers),
        Role::Router => info!("the Zenoh router listens on {}", addresses(&session)),
    }
    Ok(session)
}

/// Returns Zenoh's configuration: rmw's or the file's, with the overrides applied.
///
/// # Errors
/// A file or override that Zenoh rejects.
pub(super) fn config(settings: &ZenohSettings) -> Result<Config, TransportError> {
    let variable = config_variable(settings.role);
    let mut config = match &settings.config_file {
        Some(path) => Config::from_file(path).map_err(|error| {
            setting(
                variable,
                format!("{} is not a Zenoh configuration: {}", path.display(), words(&error)),
            )
        })?,
        None => ros_config(settings.role)?,
    };
    for pair in &settings.overrides {
        config.insert_json5(&pair.key, &pair.value).map_err(|error| {
            let (key, value, words) = (&pair.key, &pair.value, words(&error));
            setting(pair.variable, format!("Zenoh rejects {key}={value}: {words}"))
        })?;
    }
    let is_router = config.get_json("mode").is_ok_and(|mode| mode == "\"router\"");
    if is_router != (settings.role == Role::Router) {
        let reason = if is_router { "add --router" } else { "omit --router" };
        return Err(setting(
            "mode",
            format!("the configuration contradicts the command line: {reason}"),
        ));
    }
    Ok(config)
}

fn ros_config(role: Role) -> Result<Config, TransportError> {
    let own = match role {
        Role::Node => NODE,
        Role::Router => ROUTER,
    };
    let mut config = Config::default();
    for (key, value) in COMMON.iter().chain(own) {
        config.insert_json5(key, value).map_err(|error| setting(key, words(&error)))?;
    }
    Ok(config)
}

fn setting(name: &str, reason: String) -> TransportError {
    TransportError::Setting { setting: name.to_owned(), reason }
}

/// Returns the addresses that a session listens on, and whether they are encrypted.
fn addresses(session: &Session) -> String {
    let address = |locator: &Locator| {
        let locator = locator.to_string();
        let note = if is_encrypted(&locator) { "encrypted" } else { "not encrypted" };
        format!("{locator} ({note})")
    };
    let addresses: Vec<_> = session.info().locators().wait().iter().map(address).collect();
    if addresses.is_empty() { "no address".to_owned() } else { addresses.join(", ") }
}

/// Protocols with TLS, as addresses begin.
pub(super) const ENCRYPTED: [&str; 3] = ["tls/", "quic/", "quic-datagram/"];

/// True for an address with TLS.
fn is_encrypted(locator: &str) -> bool {
    ENCRYPTED.iter().any(|protocol| locator.starts_with(protocol))
}

fn check_for_router(session: &Session, settings: &ZenohSettings, peers: &str) {
    let attempts = match settings.router_check {
        RouterCheck::Skip => return,
        RouterCheck::Attempts(attempts) => attempts,
        RouterCheck::Forever => u64::MAX,
    };
    for attempt in 1..=attempts {
        if let Some(router) = session.info().routers_zid().wait().next() {
            info!("joined the Zenoh router {router}");
            return;
        }
        if attempt == 1 {
            warn!(
                "{}. Until then, this node receives nothing and is not discovered",
                probe::reason(settings, peers)
            );
        }
        if attempt < attempts {
            thread::sleep(CHECK_PERIOD);
        }
    }
}

/// Returns the text of a Zenoh error without its source location.
pub(super) fn words(error: &zenoh::Error) -> String {
    let text = error.to_string();
    text.split(" at /").next().unwrap_or_default().trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::ros::zenoh::settings::Override;

    fn settings(role: Role, overrides: &[(&str, &str)]) -> ZenohSettings {
        let plain = ZenohSettings::from_environment(&|_| None, role).unwrap();
        let overrides = overrides.iter().map(|(key, value)| Override {
            variable: "ZENOH_CONFIG_OVERRIDE",
            key: (*key).to_owned(),
            value: (*value).to_owned(),
        });
        ZenohSettings { overrides: overrides.collect(), ..plain }
    }

    fn rejection(settings: &ZenohSettings) -> String {
        config(settings).err().unwrap().to_string()
    }

    #[test]
    fn zenoh_accepts_every_default() {
        for (role, mode) in [(Role::Node, "\"peer\""), (Role::Router, "\"router\"")] {
            let config = config(&settings(role, &[])).unwrap();
            let get = |key| config.get_json(key).unwrap();
            assert_eq!(get("mode"), mode);
            assert_eq!(get("scouting/multicast/enabled"), "false");
            assert_eq!(get("transport/shared_memory/enabled"), "false");
        }
    }

    #[test]
    fn overrides_replace_defaults() {
        let settings =
            settings(Role::Node, &[("mode", "'client'"), ("connect/endpoints", "['tcp/a:1']")]);
        let config = config(&settings).unwrap();
        assert_eq!(config.get_json("mode").unwrap(), "\"client\"");
        assert_eq!(config.get_json("connect/endpoints").unwrap(), "[\"tcp/a:1\"]");
    }

    #[test]
    fn wrong_keys_and_values_are_named() {
        for (key, value) in [("no/such/key", "1"), ("mode", "'boss'"), ("connect/endpoints", "[")] {
            let message = rejection(&settings(Role::Node, &[(key, value)]));
            let start = format!("ZENOH_CONFIG_OVERRIDE: Zenoh rejects {key}={value}: ");
            assert!(message.starts_with(&start), "{message}");
        }
    }

    #[test]
    fn files_replace_the_defaults() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("session.json5");
        let mut settings = settings(Role::Node, &[]);
        settings.config_file = Some(path.clone());
        assert!(rejection(&settings).starts_with("ZENOH_SESSION_CONFIG_URI: "));
        fs::write(&path, "{ mode: 'client', /* rmw's is 10 min */ queries_default_timeout: 5 }")
            .unwrap();
        let config = config(&settings).unwrap();
        assert_eq!(config.get_json("mode").unwrap(), "\"client\"");
        assert_eq!(config.get_json("queries_default_timeout").unwrap(), "5");
        fs::write(&path, "{ mode: ").unwrap();
        let message = rejection(&settings);
        assert!(message.contains("session.json5 is not a Zenoh configuration"), "{message}");
    }

    #[test]
    fn a_contradicting_role_is_rejected() {
        let message = rejection(&settings(Role::Router, &[("mode", "'client'")]));
        assert!(message.contains("omit --router"), "{message}");
        let message = rejection(&settings(Role::Node, &[("mode", "'router'")]));
        assert!(message.contains("add --router"), "{message}");
    }

    #[test]
    fn the_error_of_a_client_without_router_states_the_remedy() {
        let mode = ("mode", "'client'");
        // Port 9 is the discard service, if there is any.
        let settings = settings(Role::Node, &[mode, ("connect/endpoints", "['tcp/127.0.0.1:9']")]);
        let message = open(&settings).err().unwrap().to_string();
        assert!(message.contains("connects to [\"tcp/127.0.0.1:9\"]"), "{message}");
        assert!(message.contains("start one (`--router` here"), "{message}");
    }

    #[test]
    fn a_router_states_its_addresses() {
        let listen = ("listen/endpoints", "['tcp/127.0.0.1:0']");
        let session = open(&settings(Role::Router, &[listen])).unwrap();
        let addresses = addresses(&session);
        assert!(addresses.starts_with("tcp/127.0.0.1:"), "{addresses}");
        assert!(addresses.ends_with(" (not encrypted)"), "{addresses}");
        assert!(is_encrypted("tls/10.0.0.1:7447") && is_encrypted("quic/[::1]:7447"));
        assert!(!is_encrypted("ws/10.0.0.1:7447"));
    }

    #[test]
    fn source_locations_are_omitted() {
        let error: zenoh::Error = "No route. at /x/y.rs:7.".into();
        assert_eq!(words(&error), "No route");
    }
}
