//! The types of a live node, compared with those of ROS 2 by third-party software: see `tests/interop`.

use std::fs;

use laser_profiler::msg::{
    action_msgs::{CANCEL_GOAL, GoalStatusArray},
    laser_profiler_msgs::{
        START_SCAN,
        scan::{FeedbackMessage, GET_RESULT, SEND_GOAL, ScanFeedback, ScanGoal, ScanResult},
    },
    lifecycle_msgs::{
        CHANGE_STATE, GET_AVAILABLE_STATES, GET_AVAILABLE_TRANSITIONS, GET_STATE,
        TransitionDescription, TransitionEvent,
    },
    rosgraph_msgs::Clock,
    rosout::Log,
    schema::{Message, MessageType, ServiceType},
    sensor_msgs::CameraInfo,
    std_srvs::{SET_BOOL, TRIGGER},
    tf2_msgs::TFMessage,
};
use serde_json::json;

use crate::{
    interop::{interop, python},
    program::{Ended, end},
};

fn messages() -> [&'static MessageType; 7] {
    [
        GoalStatusArray::TYPE,
        <Log<'_>>::TYPE,
        <TFMessage<'_>>::TYPE,
        <TransitionDescription<'_>>::TYPE,
        <TransitionEvent<'_>>::TYPE,
        Clock::TYPE,
        <CameraInfo<'_>>::TYPE,
    ]
}

/// The parts of the action that are messages.
fn parts_of_action() -> [&'static MessageType; 4] {
    [<ScanGoal<'_>>::TYPE, <ScanResult<'_>>::TYPE, ScanFeedback::TYPE, FeedbackMessage::TYPE]
}

const SERVICES: [ServiceType; 10] = [
    TRIGGER,
    SET_BOOL,
    START_SCAN,
    SEND_GOAL,
    GET_RESULT,
    CANCEL_GOAL,
    CHANGE_STATE,
    GET_STATE,
    GET_AVAILABLE_STATES,
    GET_AVAILABLE_TRANSITIONS,
];

/// Runs the check over all types; the hash of the first service as given. `None` after reporting why it cannot run.
fn check(first_hash: &str) -> Option<Ended> {
    let python = python()?;
    let entry =
        |name: &str, text: &str, hash: &str| json!({"name": name, "text": text, "hash": hash});
    let messages: Vec<_> =
        messages().iter().map(|kind| entry(kind.name, &kind.schema(), kind.hash)).collect();
    let mut services: Vec<_> =
        SERVICES.iter().map(|kind| entry(kind.name, kind.text, kind.hash)).collect();
    services[0]["hash"] = first_hash.into();
    let parts: Vec<_> =
        parts_of_action().iter().map(|kind| entry(kind.name, &kind.schema(), kind.hash)).collect();
    let text = include_str!("../../msgs/laser_profiler_msgs/action/Scan.action");
    let name = "laser_profiler_msgs/action/Scan";
    let actions = json!([{"name": name, "text": text, "messages": parts}]);
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("interfaces.json");
    let document = json!({"messages": messages, "services": services, "actions": actions});
    fs::write(&path, document.to_string()).unwrap();
    let mut command = std::process::Command::new(python);
    Some(end(command.arg(interop("check_interfaces.py")).arg(path)))
}

#[test]
fn types_of_the_live_node() {
    let Some(ended) = check(TRIGGER.hash) else { return };
    assert_eq!(ended.code, Some(0), "{ended:?}");
}

#[test]
fn a_wrong_hash_is_found() {
    let Some(ended) = check(SET_BOOL.hash) else { return };
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(ended.stdout.contains("std_srvs/srv/Trigger: RIHS01_"), "{ended:?}");
}
