//! TLS: where a router listens, whose certificates are accepted, and what the log says.

use std::{fs, path::Path, process::Command};

use super::network::free_port;
use crate::{
    live::Node,
    program::{end, laser_profiler},
};

/// Makes an authority and a certificate of 127.0.0.1 from it; false after reporting that there is no OpenSSL.
fn certificates(place: &Path, name: &str) -> bool {
    let openssl = |line: &str| {
        let words = line.split_whitespace();
        let done = Command::new("openssl").args(words).current_dir(place).output();
        match done {
            Ok(output) if output.status.success() => true,
            other => {
                eprintln!("SKIPPED zenoh::encryption: openssl {line}: {other:?}");
                assert!(std::env::var_os("CI").is_none(), "CI skips nothing");
                false
            }
        }
    };
    fs::write(place.join("san"), "subjectAltName=IP:127.0.0.1").unwrap();
    let new_key = "req -newkey rsa:2048 -nodes -subj";
    openssl(&format!("{new_key} /CN={name} -x509 -days 2 -keyout {name}.key -out {name}.pem"))
        && openssl(&format!("{new_key} /CN=router -keyout {name}-router.key -out {name}.csr"))
        && openssl(&format!(
            "x509 -req -in {name}.csr -CA {name}.pem -CAkey {name}.key -CAcreateserial -days 2 -extfile san \
             -out {name}-router.pem"
        ))
}

/// The configuration of a router that listens on a port with TLS.
fn router_file(place: &Path, port: u16) -> String {
    let file = place.join("router.json5");
    let [certificate, key] = ["router.pem", "router.key"]
        .map(|end| place.join(format!("own-{end}")).display().to_string());
    let text = format!(
        "{{ mode: 'router', scouting: {{ multicast: {{ enabled: false }} }}, listen: {{ endpoints: ['tls/127.0.0.1:{port}'] }}, \
         transport: {{ link: {{ tls: {{ listen_certificate: '{certificate}', listen_private_key: '{key}' }} }} }} }}"
    );
    fs::write(&file, text).unwrap();
    file.display().to_string()
}

/// The configuration of a session that trusts an authority.
fn session_file(place: &Path, port: u16, authority: &str) -> String {
    let file = place.join(format!("session-{authority}.json5"));
    let authority = place.join(format!("{authority}.pem")).display().to_string();
    let text = format!(
        "{{ mode: 'peer', scouting: {{ multicast: {{ enabled: false }} }}, connect: {{ endpoints: ['tls/127.0.0.1:{port}'], \
         timeout_ms: -1, exit_on_failure: false }}, listen: {{ endpoints: ['tcp/127.0.0.1:0'] }}, transport: {{ link: {{ tls: \
         {{ root_ca_certificate: '{authority}' }} }} }} }}"
    );
    fs::write(&file, text).unwrap();
    file.display().to_string()
}

const ZENOH: [&str; 2] = ["--transport", "zenoh"];

#[test]
fn a_router_says_that_it_is_encrypted_and_a_refused_certificate_is_named() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    if !(certificates(place, "own") && certificates(place, "other")) {
        return;
    }
    let port = free_port();
    let domain = ("ROS_DOMAIN_ID", (port % 200).to_string());
    let file = ("ZENOH_ROUTER_CONFIG_URI", router_file(place, port));
    let router = Node::spawn(&[&ZENOH[..], &["--router"]].concat(), &[domain.clone(), file]);
    let line = router.wait_for("listens on");
    assert!(line.contains(&format!("tls/127.0.0.1:{port} (encrypted)")), "{line}");
    router.wait_for(" is on ");

    let file = |authority| ("ZENOH_SESSION_CONFIG_URI", session_file(place, port, authority));
    let stranger = Node::spawn(&ZENOH, &[domain.clone(), file("other")]);
    let line = stranger.wait_for("Until then, this node");
    for part in ["the encrypted connection", "certificate", "root_ca_certificate"] {
        assert!(line.contains(part), "{line}");
    }
    assert!(!line.contains("no Zenoh router"), "{line}");
    drop(stranger);

    let attempts = ("ZENOH_ROUTER_CHECK_ATTEMPTS", "0".to_owned());
    let friend = Node::spawn(&ZENOH, &[domain.clone(), file("own"), attempts]);
    friend.wait_for("joined the Zenoh router");
    drop(router);

    let absent = Node::spawn(&ZENOH, &[domain, file("own")]);
    let line = absent.wait_for("Until then, this node");
    assert!(line.contains("no Zenoh router at") && line.contains("refused"), "{line}");
}

#[test]
fn a_router_with_the_configuration_of_a_session_does_not_start() {
    let place = tempfile::tempdir().unwrap();
    let file = session_file(place.path(), 9, "own");
    let mut command = laser_profiler(&["run", "--transport", "zenoh", "--router"]);
    let ended = end(command.env("ZENOH_SESSION_CONFIG_URI", &file));
    assert_eq!(ended.code, Some(2), "{ended:?}");
    for part in ["ZENOH_SESSION_CONFIG_URI", &file, "ZENOH_ROUTER_CONFIG_URI"] {
        assert!(ended.stderr.contains(part), "{ended:?}");
    }
}
