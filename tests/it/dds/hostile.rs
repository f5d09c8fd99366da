//! Datagrams that are meant to do harm: the node's memory stays bounded, images go on, and it ends when asked to.

use std::{
    path::Path,
    process::{Command, Stdio},
    thread,
    time::Duration,
};

use super::line::Line;

/// Memory of the node and its middleware process together.
const MAX_BYTES: u64 = 300 << 20;
const SAMPLE_PERIOD: Duration = Duration::from_millis(20);

/// Numbers of the node's participants: Cyclone's comes first.
const PARTICIPANTS: &[&str] = if cfg!(feature = "cyclone") { &["0", "1"] } else { &["0"] };

/// Runs `tests/peers/rtps_attack.py` against each of the node's participants.
fn survives(attack: &[&str]) {
    for participant in PARTICIPANTS {
        survives_at(participant, attack);
    }
}

fn survives_at(participant: &str, attack: &[&str]) {
    let mut line = Line::start();
    line.wait_for_a_result();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/rtps_attack.py");
    let mut attacker = Command::new("python3");
    attacker.arg(script).args(attack).args(["--participant", participant]);
    attacker.args(["--domain", &line.domain.id.to_string()]);
    let mut attacker = attacker.stdout(Stdio::null()).spawn().expect("python3 starts");
    let mut largest = 0;
    while attacker.try_wait().unwrap().is_none() {
        largest = largest.max(line.node.resident_bytes());
        thread::sleep(SAMPLE_PERIOD);
    }
    assert!(attacker.wait().unwrap().success());
    line.wait_for_a_result();
    largest = largest.max(line.node.resident_bytes());
    assert!(largest < MAX_BYTES, "{attack:?}: {} MB", largest >> 20);
    line.end();
}

#[test]
fn a_claim_of_two_to_the_62nd_samples() {
    survives(&["heartbeat"]);
}

#[test]
fn a_gap_of_two_to_the_62nd_samples() {
    survives(&["gap"]);
}

#[test]
fn a_sample_of_almost_4_gigabytes() {
    survives(&["claimed-size"]);
}

#[test]
fn twenty_thousand_participants() {
    survives(&["announcements", "20000"]);
}

#[test]
fn a_hundred_thousand_damaged_datagrams() {
    survives(&["mutated", "100000", "--seed", "1"]);
}
