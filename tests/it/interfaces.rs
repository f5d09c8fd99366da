//! The types of a live node, compared with those of ROS 2 by third-party software: see `tests/interop`.

use std::fs;

use laser_profiler::msg::{
    laser_profiler_msgs::START_SCAN,
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

fn messages() -> [&'static MessageType; 6] {
    [
        <Log<'_>>::TYPE,
        <TFMessage<'_>>::TYPE,
        <TransitionDescription<'_>>::TYPE,
        <TransitionEvent<'_>>::TYPE,
        Clock::TYPE,
        <CameraInfo<'_>>::TYPE,
    ]
}

const SERVICES: [ServiceType; 7] = [
    TRIGGER,
    SET_BOOL,
    START_SCAN,
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
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("interfaces.json");
    fs::write(&path, json!({"messages": messages, "services": services}).to_string()).unwrap();
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
