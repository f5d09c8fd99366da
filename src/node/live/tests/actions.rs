//! The action `~/scan`.

use std::{fs, path::Path, thread};

use sha2::{Digest, Sha256};

use super::{
    driver::{TestCamera, encoded},
    listener::Listener,
    rig::{Rig, Setup},
    stream::counts,
};
use crate::{
    msg::{
        action_msgs::{
            CancelGoalRequest, CancelGoalResponse, GoalInfo, GoalStatusArray, cancel, status,
        },
        builtin_interfaces::{Duration, Time},
        cdr,
        laser_profiler_msgs::{
            SliceInfo,
            scan::{
                FeedbackMessage, GetResultRequest, GetResultResponse, ScanFeedback, ScanGoal,
                ScanResult, SendGoalRequest, SendGoalResponse,
            },
        },
        schema::Message,
        unique_identifier_msgs::Uuid,
    },
    ros::{loopback::Loopback, transport::Subscription, value::Value},
};

const ACTION: &str = "/laser_profiler/scan/_action";

fn id(number: u8) -> Uuid {
    Uuid { uuid: [number; 16] }
}

fn call(network: &Loopback, part: &str, request: &impl Message) -> Vec<u8> {
    network.call(&format!("{ACTION}/{part}"), &encoded(request)).unwrap()
}

fn send_to(network: &Loopback, number: u8, goal: ScanGoal<'_>) -> bool {
    let response = call(network, "send_goal", &SendGoalRequest { goal_id: id(number), goal });
    cdr::decode::<SendGoalResponse>(&response).unwrap().accepted
}

fn send(rig: &Rig, number: u8, goal: ScanGoal<'_>) -> bool {
    send_to(&rig.network, number, goal)
}

fn cancel_goal(rig: &Rig, goal_id: Uuid) -> (i8, usize) {
    let goal_info = GoalInfo { goal_id, stamp: Time::default() };
    let response = call(&rig.network, "cancel_goal", &CancelGoalRequest { goal_info });
    let response: CancelGoalResponse = cdr::decode(&response).unwrap();
    (response.return_code, response.goals_canceling.len())
}

/// Waits for the response.
fn result_bytes(network: &Loopback, number: u8) -> Vec<u8> {
    call(network, "get_result", &GetResultRequest { goal_id: id(number) })
}

/// Status, result and message.
fn result(rig: &Rig, number: u8) -> (i8, u8, String) {
    let bytes = result_bytes(&rig.network, number);
    let response: GetResultResponse<'_> = cdr::decode(&bytes).unwrap();
    (response.status, response.result.result, response.result.message.into_owned())
}

fn shoot(rig: &Rig, camera: &mut TestCamera, numbers: impl IntoIterator<Item = usize>) {
    for number in numbers {
        camera.shoot();
        rig.results("profile", number);
    }
}

fn statuses(rig: &Rig) -> (Listener, Box<dyn Subscription>) {
    rig.listen(&format!("{ACTION}/status"), GoalStatusArray::TYPE)
}

/// The states of the newest goal, each once.
fn states(listener: &Listener) -> Vec<i8> {
    let received = listener.received(&format!("{ACTION}/status"));
    let newest = |array: GoalStatusArray| array.status_list.last().map(|goal| goal.status);
    let mut states: Vec<_> =
        received.iter().filter_map(|received| newest(received.decode())).collect();
    states.dedup();
    states
}

#[test]
fn a_goal_of_some_frames_ends_with_feedback_and_a_result() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    shoot(&rig, &mut camera, 1..=2);
    let (listener, _statuses) = statuses(&rig);
    let topic = format!("{ACTION}/feedback");
    let (feedback, _feedback) = rig.listen(&topic, FeedbackMessage::TYPE);
    assert!(send(&rig, 1, ScanGoal { part_id: "part 7".into(), frames: 3, ..goal() }));
    shoot(&rig, &mut camera, 3..=8);
    let bytes = result_bytes(&rig.network, 1);
    let GetResultResponse { status, result } = cdr::decode(&bytes).unwrap();
    assert_eq!((status, result.result), (status::SUCCEEDED, ScanResult::SUCCEEDED), "{result:?}");
    assert_eq!((result.frames_accepted, result.frames_expected, result.points), (3, 3, 3 * 64));
    assert!((result.length - 0.002).abs() < 1e-9, "{}", result.length);
    assert_eq!(result_bytes(&rig.network, 1), bytes, "it is kept");
    let infos = rig.results("slice_info", 2);
    let info: SliceInfo<'_> = infos[1].decode();
    assert_eq!((info.scan_id, &*info.part_id), (result.scan_id, "part 7"));
    assert_eq!((info.frames_accepted, info.last_slice), (3, true));
    let last = feedback.received(&topic).last().unwrap().decode::<FeedbackMessage>();
    assert_eq!((last.goal_id, last.feedback.frames_accepted), (id(1), 3));
    let ScanFeedback { progress, position, .. } = last.feedback;
    assert!((progress - 1.0).abs() < 1e-6 && position.is_finite(), "{last:?}");
    assert_eq!(states(&listener), [status::EXECUTING, status::SUCCEEDED]);
    assert_eq!(counts(rig.end()).slices, 2, "later frames give profiles only");
}

/// Limits and other values as ROS initialises them.
fn goal() -> ScanGoal<'static> {
    ScanGoal::default()
}

#[test]
fn lost_frames_are_in_the_result() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    assert!(send(&rig, 1, ScanGoal { length: 0.0055, ..goal() }));
    shoot(&rig, &mut camera, 1..=3);
    camera.sequence += 2;
    shoot(&rig, &mut camera, 4..=6);
    let bytes = result_bytes(&rig.network, 1);
    let GetResultResponse { status, result } = cdr::decode(&bytes).unwrap();
    assert_eq!((status, result.result), (status::SUCCEEDED, ScanResult::SUCCEEDED_WITH_GAPS));
    assert_eq!((result.frames_accepted, result.frames_missing), (5, 2), "{result:?}");
    assert!((result.length - 0.006).abs() < 1e-9, "{}", result.length);
}

#[test]
fn a_cancelled_goal_is_flushed_and_keeps_its_recording() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    let (listener, _statuses) = statuses(&rig);
    assert!(send(&rig, 1, ScanGoal { length: 1.0, record: true, ..goal() }));
    shoot(&rig, &mut camera, 1..=2);
    assert_eq!(cancel_goal(&rig, id(9)), (cancel::UNKNOWN_GOAL_ID, 0));
    assert_eq!(cancel_goal(&rig, id(1)), (cancel::NONE, 1));
    let bytes = result_bytes(&rig.network, 1);
    let GetResultResponse { status, result } = cdr::decode(&bytes).unwrap();
    assert_eq!((status, result.frames_accepted), (status::CANCELED, 2), "{result:?}");
    assert_eq!(result.result, ScanResult::FAILED, "it did not reach its end");
    assert!(rig.results("slice_info", 1)[0].decode::<SliceInfo<'_>>().last_slice);
    assert_eq!(states(&listener), [status::EXECUTING, status::CANCELING, status::CANCELED]);
    assert_eq!(cancel_goal(&rig, id(1)), (cancel::GOAL_TERMINATED, 0));

    assert_eq!((result.recordings.len(), result.recordings_sha256.len()), (1, 1), "{result:?}");
    let path = result.recordings[0].0.strip_prefix("file://").unwrap();
    let digest = Sha256::digest(fs::read(path).unwrap());
    let stated = &*result.recordings_sha256[0].0;
    let byte = |at| u8::from_str_radix(&stated[at..at + 2], 16).unwrap();
    let stated: Vec<u8> = (0..stated.len()).step_by(2).map(byte).collect();
    assert_eq!(stated, digest[..], "closed before it is hashed");
    assert!(Path::new(path).with_file_name("metadata.yaml").exists());
}

#[test]
fn a_recording_that_others_stop_is_in_the_result() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    assert!(send(&rig, 1, ScanGoal { frames: 2, record: true, ..goal() }));
    shoot(&rig, &mut camera, 1..=1);
    assert!(rig.stop_recording().0);
    let (success, another) = rig.start_recording();
    assert!(success, "{another}");
    shoot(&rig, &mut camera, 2..=2);
    let bytes = result_bytes(&rig.network, 1);
    let GetResultResponse { status, result } = cdr::decode(&bytes).unwrap();
    assert_eq!((status, result.recordings.len()), (status::SUCCEEDED, 1), "{result:?}");
    assert!(!result.recordings[0].0.contains(&another), "{result:?}");
    assert_eq!(rig.stop_recording(), (true, another), "the goal did not stop it");
}

#[test]
fn goals_that_cannot_be_carried_out_are_rejected() {
    let rig = Rig::start();
    let one = Duration { sec: 1, nanosec: 0 };
    for (number, bad) in (1..).zip([
        goal(),
        ScanGoal { length: -0.1, ..goal() },
        ScanGoal { length: f64::NAN, ..goal() },
        ScanGoal { length: 0.1, start_position: 0.5, ..goal() },
        ScanGoal { frames: 5001, ..goal() },
        ScanGoal { max_duration: Duration { sec: -1, nanosec: 0 }, ..goal() },
    ]) {
        assert!(!send(&rig, number, bad), "{number}");
        assert_eq!(result(&rig, number).0, status::UNKNOWN);
    }
    assert!(send(&rig, 7, ScanGoal { length: 1.0, start_position: f64::NAN, ..goal() }));
    assert!(!send(&rig, 8, ScanGoal { max_duration: one, ..goal() }), "one at a time");
    assert!(!send(&rig, 7, ScanGoal { frames: 1, ..goal() }), "its identity is taken");
    assert_eq!(cancel_goal(&rig, Uuid::default()), (cancel::NONE, 1), "all");
    assert_eq!(result(&rig, 7).0, status::CANCELED);
    assert!(rig.change_state("deactivate"));
    assert!(!send(&rig, 9, ScanGoal { frames: 1, ..goal() }), "not active");
    assert!(rig.change_state("activate"));
    assert!(send(&rig, 9, ScanGoal { frames: 1, ..goal() }), "a rejected one leaves nothing");
}

#[test]
fn a_goal_ends_with_its_time_and_with_other_requests() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    let moment = Duration { sec: 0, nanosec: 20_000_000 };
    assert!(send(&rig, 1, ScanGoal { max_duration: moment, ..goal() }));
    let (state, outcome, why) = result(&rig, 1);
    assert_eq!((state, outcome), (status::ABORTED, ScanResult::FAILED));
    assert!(why.contains("no frame was measured"), "{why}");

    assert!(send(&rig, 2, ScanGoal { length: 1.0, ..goal() }));
    shoot(&rig, &mut camera, 1..=1);
    assert!(rig.trigger("stop_scan").0);
    let (state, outcome, why) = result(&rig, 2);
    assert_eq!((state, outcome), (status::ABORTED, ScanResult::FAILED), "{why}");
    assert!(why.contains("~/stop_scan"), "{why}");

    assert!(send(&rig, 3, ScanGoal { length: 1.0, ..goal() }));
    assert!(rig.scan("", 0.0).0);
    let (state, _, why) = result(&rig, 3);
    assert_eq!((state, &*why), (status::ABORTED, "another scan was started"));
    shoot(&rig, &mut camera, 2..=2);
    assert_eq!(rig.trigger("stop_scan"), (true, "scan ended".into()), "the other scan runs");

    rig.set("scan.max_profiles", &Value::Integer(4)).unwrap();
    assert!(send(&rig, 4, ScanGoal { length: 1.0, ..goal() }));
    shoot(&rig, &mut camera, 3..=6);
    let (state, _, why) = result(&rig, 4);
    assert_eq!(state, status::ABORTED);
    assert!(why.contains("scan.max_profiles"), "{why}");
}

#[test]
fn a_node_that_is_deactivated_or_ends_aborts_its_goal() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    let mut ask = |number: u8, end: &dyn Fn(&Rig)| {
        assert!(send(&rig, number, ScanGoal { length: 1.0, ..goal() }));
        shoot(&rig, &mut camera, usize::from(number)..=usize::from(number));
        let network = rig.network.clone();
        let waiting = thread::spawn(move || result_bytes(&network, number));
        end(&rig);
        let bytes = waiting.join().unwrap();
        let response: GetResultResponse<'_> = cdr::decode(&bytes).unwrap();
        (response.status, response.result.message.into_owned())
    };
    let (state, why) = ask(1, &|rig| {
        assert!(rig.change_state("deactivate"));
    });
    assert_eq!(state, status::ABORTED);
    assert!(why.contains("deactivated"), "{why}");
    assert!(rig.change_state("activate"));
    assert!(send(&rig, 9, ScanGoal { length: 1.0, ..goal() }));
    assert!(rig.change_state("deactivate"));
    assert_eq!(result(&rig, 9).0, status::ABORTED, "before its first frame");
    assert!(rig.change_state("activate"));
    let (state, why) = ask(2, &|rig| assert!(rig.change_state("shutdown")));
    assert_eq!(state, status::ABORTED);
    assert!(why.contains("interrupted") || why.contains("shut down"), "{why}");
}

#[test]
fn every_camera_has_an_action_of_its_own() {
    let cameras = Value::TextList(vec!["left".into(), "right".into()]);
    let mut setup = Setup::new().with("cameras", cameras);
    setup.set_camera("left");
    setup.set_camera("right");
    let rig = setup.start().unwrap();
    let names = rig.network.services();
    for camera in ["left", "right"] {
        for part in ["send_goal", "cancel_goal", "get_result"] {
            let name = format!("/laser_profiler/{camera}/scan/_action/{part}");
            assert!(names.contains(&name), "{name}");
        }
    }
    assert!(!names.contains(&format!("{ACTION}/send_goal")));
    drop(rig.end());
}
