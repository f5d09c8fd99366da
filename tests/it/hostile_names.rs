//! Names and texts that would control a terminal or forge lines, in recordings and parameters.

use std::path::Path;

use laser_profiler::{
    bag::Topic,
    msg::{schema::Message, sensor_msgs::Image},
};

use crate::{
    program::{Ended, end, laser_profiler},
    recordings::{good_images, record, topic},
};

/// Sets the title, clears the screen, forges a line, turns the direction of writing.
const HOSTILE: &str = "/x\u{1b}]0;owned\u{7}\u{1b}[2J\u{9b}2J\r\nFORGED\u{202e}\u{7f}";

/// A recording with a hostile topic beside the images, of which one is no image.
fn recording(place: &Path) -> String {
    let bag = place.join("bag");
    let images = topic("/image_raw", Image::TYPE);
    let hostile = Topic { name: HOSTILE.into(), type_name: HOSTILE.into(), ..images.clone() };
    let mut messages = good_images(3);
    messages.push(HOSTILE.as_bytes().to_vec());
    record(&bag, &[images, hostile], &messages);
    bag.to_str().unwrap().to_owned()
}

fn require_harmless(what: &str, ended: &Ended) {
    for text in [&ended.stdout, &ended.stderr] {
        let is_control = |it: char| it.is_control() && it != '\n' && it != '\t' || it == '\u{202e}';
        assert!(!text.contains(is_control), "{what}: {text:?}");
        assert!(!text.lines().any(|line| line.starts_with("FORGED")), "{what}: {text:?}");
    }
}

#[test]
fn names_in_a_recording_are_no_commands_to_the_terminal() {
    let place = tempfile::tempdir().unwrap();
    let bag = recording(place.path());
    let output = place.path().join("out").to_str().unwrap().to_owned();
    let mut num_shown = 0;
    for arguments in [
        &["info", &bag][..],
        &["info", "--verify", &bag],
        &["info", "--json", &bag],
        &["recover", &bag, "-o", &output],
        &["recover", "--json", "--force", &bag, "-o", &output],
        // Names the topics that there are.
        &["replay", &bag, "-o", &output, "--force", "--ros-args", "-r", "image_raw:=/other"],
        &["replay", &bag, "-o", &output, "--force", "--ros-args", "-r", "image_raw:=/image_raw"],
        &["export", &bag, "-o", &output, "--force"],
        &["measure", &bag],
    ] {
        let ended = end(&mut laser_profiler(arguments));
        require_harmless(&arguments.join(" "), &ended);
        num_shown += usize::from((ended.stdout + &ended.stderr).contains("\\u001b]0;owned"));
    }
    assert!(num_shown >= 5, "the name is shown, with escapes: {num_shown}");
}

#[test]
fn json_keeps_hostile_names_as_they_are() {
    let place = tempfile::tempdir().unwrap();
    let bag = recording(place.path());
    let ended = end(&mut laser_profiler(&["info", "--json", &bag]));
    let info: serde_json::Value = serde_json::from_str(&ended.stdout).unwrap();
    let topics = info["topics"].as_array().unwrap();
    assert!(topics.iter().any(|topic| topic["name"] == HOSTILE), "{info}");
}

#[test]
fn a_parameter_forges_no_line() {
    let place = tempfile::tempdir().unwrap();
    let bag = recording(place.path());
    let output = place.path().join("out").to_str().unwrap().to_owned();
    for parameter in ["extraction.method", "calibration_file", "bogus\nFORGED", "cameras"] {
        let assignment = format!("{parameter}:='{}'", HOSTILE.replace('\'', ""));
        let arguments = ["replay", &bag, "-o", &output, "--ros-args", "-p", &assignment];
        let ended = end(&mut laser_profiler(&arguments));
        assert_ne!(ended.code, Some(0), "{ended:?}");
        require_harmless(parameter, &ended);
    }
}
