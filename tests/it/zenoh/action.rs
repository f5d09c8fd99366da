//! The action `~/scan`, called from Python.

use laser_profiler::msg::{
    action_msgs::{CANCEL_GOAL, GoalStatusArray},
    laser_profiler_msgs::scan::{FeedbackMessage, GET_RESULT, SEND_GOAL},
    schema::Message,
};

use super::{network::Network, peer::Peer, process::node};

const ACTION: &str = "/laser_profiler/scan";
const CALIBRATED: [&str; 4] = [
    "-p",
    "calibration_file:=launch_configs/cell.calibration.yaml",
    "-p",
    "extraction.min_segment_area:=100",
];
const IMAGES: [&str; 7] = ["--stripe", "--width", "320", "--height", "240", "--fps", "50"];

/// A client with a goal.
fn client(network: &Network, goal: &[&str]) -> Peer {
    let connect = format!("tcp/127.0.0.1:{}", network.port);
    let kinds = [
        ("send_goal", SEND_GOAL.name, SEND_GOAL.hash),
        ("cancel_goal", CANCEL_GOAL.name, CANCEL_GOAL.hash),
        ("get_result", GET_RESULT.name, GET_RESULT.hash),
        ("feedback", FeedbackMessage::TYPE.name, FeedbackMessage::TYPE.hash),
        ("status", GoalStatusArray::TYPE.name, GoalStatusArray::TYPE.hash),
    ];
    let kinds = kinds.map(|(part, name, hash)| format!("{part}={name}={hash}"));
    let kinds = kinds.iter().flat_map(|kind| ["--kind", kind]);
    let own = ["action", "--connect", &connect, "--domain", &network.domain, "--topic", ACTION];
    let arguments: Vec<_> = own.into_iter().chain(kinds).chain(goal.iter().copied()).collect();
    Peer::start(network.python, "zenoh_action.py", &arguments)
}

#[test]
fn a_goal_of_a_python_client_is_carried_out() {
    let Some((network, _router)) = Network::start() else { return };
    let node = node(&network, &CALIBRATED);
    let client = client(&network, &["--frames", "40"]);
    assert_eq!(client.event("goal")["accepted"], true);
    let camera = network.peer("send", &[&IMAGES[..], &["--count", "100"]].concat());
    let result = client.event("result");
    assert_eq!((&result["status"], &result["accepted"]), (&4.into(), &40.into()), "{result}");
    assert_eq!(result["states"].as_array().unwrap().last(), Some(&4.into()), "{result}");
    assert_eq!(result["feedback"].as_array().unwrap().last(), Some(&40.into()), "{result}");
    assert_eq!(result["progress"].as_array().unwrap().last(), Some(&1.0.into()), "{result}");
    camera.event("sent");
    drop(node);
}

#[test]
fn a_goal_of_a_python_client_is_cancelled_while_its_result_is_awaited() {
    let Some((network, _router)) = Network::start() else { return };
    let place = tempfile::tempdir().unwrap();
    let directory = format!("recording.directory:={}", place.path().display());
    let record = ["-p", &directory, "-p", "recording.min_free_bytes:=0"];
    let _node = node(&network, &[&CALIBRATED[..], &record].concat());
    let mut cancelled = client(&network, &["--frames", "4000", "--record"]);
    assert_eq!(cancelled.event("goal")["accepted"], true);
    let refused = client(&network, &["--frames", "10"]);
    assert_eq!(refused.event("goal")["accepted"], false, "one at a time");
    assert_eq!(refused.event("result")["status"], 0, "unknown");
    let _camera = network.peer("send", &[&IMAGES[..], &["--seconds", "60"]].concat());
    let listed = || std::fs::read_dir(place.path()).unwrap().count();
    super::peer::wait_until("a recording", || listed() == 1);
    cancelled.send_line("cancel");
    assert_eq!(cancelled.event("canceling")["goals"], 1);
    let result = cancelled.event("result");
    assert_eq!(result["status"], 5, "{result}");
    assert_eq!(result["recordings"].as_array().unwrap().len(), 1, "{result}");
    assert_eq!(result["hashes"][0].as_str().unwrap().len(), 64, "{result}");
}
