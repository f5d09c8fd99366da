//! The live view, seen by a viewer that is not Foxglove's: `tests/interop/check_view.py`.

use std::{
    fs,
    io::{BufRead, BufReader, Read},
    net::TcpListener,
    path::Path,
    process::{Child, Command, Stdio},
    thread::{self, JoinHandle},
};

use serde_json::Value as Json;

use crate::{
    browser::{self, foxglove, pixels},
    interop::{interop, python},
    program::{Ended, content, end, laser_profiler, replay},
    recordings::record_images,
};

const FILM: &[&str] =
    &["bags/film_defects", "--params-file", "bags/film_defects.params.yaml", "--view=0"];
/// Frames of the recording.
const FILM_FRAMES: u64 = 147;

/// A process with a view. It is killed when dropped.
pub(crate) struct Viewed {
    process: Child,
    pub(crate) url: String,
    stderr: Option<JoinHandle<String>>,
}

impl Viewed {
    /// Starts a command with `--view=0` and waits until the view listens.
    pub(crate) fn start(command: &mut Command) -> Self {
        let piped = command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut process = piped.spawn().unwrap();
        let mut lines = BufReader::new(process.stderr.take().unwrap());
        let mut output = String::new();
        let url = loop {
            let start = output.len();
            assert!(lines.read_line(&mut output).unwrap() > 0, "it ended without a view: {output}");
            if let Some((_, rest)) = output[start..].split_once("live view at ") {
                break rest.split(": ").next().unwrap().to_owned();
            }
        };
        let rest = move || {
            lines.read_to_string(&mut output).unwrap();
            output
        };
        Self { process, url, stderr: Some(thread::spawn(rest)) }
    }

    pub(crate) fn replay(arguments: &[&str]) -> Self {
        Self::start(laser_profiler(&["replay"]).args(arguments))
    }

    /// Number of the process.
    pub(crate) fn id(&self) -> u32 {
        self.process.id()
    }

    /// Waits for its end; standard error from its first line.
    pub(crate) fn wait(mut self) -> Ended {
        let mut stdout = String::new();
        self.process.stdout.take().unwrap().read_to_string(&mut stdout).unwrap();
        let code = self.process.wait().unwrap().code();
        Ended { code, stdout, stderr: self.stderr.take().unwrap().join().unwrap() }
    }

    /// Ends it as Ctrl-C does.
    pub(crate) fn interrupt(self) -> Ended {
        let process = self.process.id().to_string();
        assert!(Command::new("kill").args(["-INT", &process]).status().unwrap().success());
        self.wait()
    }
}

impl Drop for Viewed {
    fn drop(&mut self) {
        // It has ended where the test has not failed.
        _ = self.process.kill();
        _ = self.process.wait();
    }
}

/// Runs the viewer; returns its findings.
fn look(python: &Path, url: &str, arguments: &[&str]) -> Json {
    let mut command = Command::new(python);
    let ended = end(command.arg(interop("check_view.py")).arg(url).args(arguments));
    assert_eq!(ended.code, Some(0), "{arguments:?}\n{}\n{}", ended.stdout, ended.stderr);
    serde_json::from_str(ended.stdout.lines().last().unwrap()).unwrap()
}

/// Contents of the view of the film's recording.
fn looks_at_the_film(arguments: &[&str]) -> Option<Json> {
    let python = python()?;
    let viewed = Viewed::replay(FILM);
    let found = look(python, &viewed.url, arguments);
    let ended = viewed.interrupt();
    assert_eq!(ended.code, Some(0), "{ended:?}");
    Some(found)
}

/// The results of the film's recording, to compare with.
fn film_results(place: &Path) -> String {
    let results = place.join("results");
    replay(Path::new(FILM[0]), &results, 3, &FILM[1..3]);
    results.join("results_0.mcap").to_str().unwrap().to_owned()
}

#[test]
fn every_topic_is_there_with_its_schema() {
    looks_at_the_film(&["topics"]);
}

#[test]
fn the_centreline_overlays_the_stripe_of_its_image() {
    looks_at_the_film(&["overlay"]);
}

#[test]
fn any_frame_is_shown_as_the_results_have_it() {
    let place = tempfile::tempdir().unwrap();
    let found = looks_at_the_film(&["jumps", &film_results(place.path())]);
    assert!(found.is_none_or(|found| found["frames"] == FILM_FRAMES));
}

#[test]
fn a_recording_is_played_at_a_speed_to_its_end_and_again() {
    let Some(found) = looks_at_the_film(&["plays"]) else { return };
    assert_eq!(found["frames"], FILM_FRAMES);
    let (seconds, recorded) =
        (found["seconds"].as_f64().unwrap(), found["recorded"].as_f64().unwrap());
    assert!(seconds >= 0.09 * recorded, "ten times as fast, not more: {seconds} of {recorded} s");
}

#[test]
fn a_valid_parameter_remeasures_the_paused_frame_and_an_invalid_one_is_rejected() {
    looks_at_the_film(&["tuning"]);
}

#[test]
fn an_old_viewer_is_logged_once_and_others_receive_everything() {
    let Some(python) = python() else { return };
    let viewed = Viewed::replay(FILM);
    look(python, &viewed.url, &["old"]);
    let ended = viewed.interrupt();
    assert_eq!(ended.stderr.matches("handshake failed").count(), 1, "{}", ended.stderr);
}

#[test]
fn a_recording_without_images_is_shown_as_it_is() {
    let Some(python) = python() else { return };
    let place = tempfile::tempdir().unwrap();
    let results = film_results(place.path());
    let viewed = Viewed::replay(&[&results, "--view=0"]);
    let found = look(python, &viewed.url, &["as_recorded", &results]);
    assert_eq!(found["frames"], FILM_FRAMES);
    assert_eq!(viewed.interrupt().code, Some(0));
}

#[test]
fn stalled_viewers_do_not_change_the_results() {
    let Some(python) = python() else { return };
    let place = tempfile::tempdir().unwrap();
    let alone = film_results(place.path());
    let seen = place.path().join("seen").join("results");
    fs::create_dir(seen.parent().unwrap()).unwrap();
    let more = ["--view-exit", "--view-image=full", "--json", "-o", seen.to_str().unwrap()];
    let viewed = Viewed::replay(&[FILM, &more].concat());
    let mut slow = Command::new(python);
    let slow = slow.arg(interop("check_view.py")).args([&viewed.url, "slow", "60"]);
    let mut slow = slow.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let ended = viewed.wait();
    slow.kill().unwrap();
    slow.wait().unwrap();
    assert_eq!(ended.code, Some(3), "{ended:?}");
    let summary: Json = serde_json::from_str(&ended.stdout).unwrap();
    assert_eq!(summary["frames"]["processed"], FILM_FRAMES);
    assert_eq!(summary["frames"]["dropped"], 0);
    let alone = content(Path::new(&alone).parent().unwrap());
    assert!(alone == content(&seen), "the same bytes");
}

#[test]
fn nothing_is_encoded_without_viewers() {
    let ended = Viewed::replay(&[FILM, &["--view-exit", "--rate", "100"]].concat()).wait();
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert!(ended.stderr.contains("sent 0 messages to viewers"), "{}", ended.stderr);
}

#[test]
fn a_port_that_is_taken_is_named() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port();
    let arguments = [FILM[0], &format!("--view={port}")];
    let ended = end(laser_profiler(&["replay"]).args(arguments));
    assert_eq!(ended.code, Some(1), "{ended:?}");
    let words = format!("port {port} of 127.0.0.1 is already in use");
    assert!(ended.stderr.contains(&words) && ended.stderr.contains("--view="), "{ended:?}");
}

#[test]
fn only_this_machine_may_look() {
    for (address, words) in [("0.0.0.0:8765", "ssh -L"), ("here", "HOST:PORT")] {
        let view = format!("--view={address}");
        let ended = end(laser_profiler(&["replay", FILM[0]]).arg(&view));
        assert_eq!(ended.code, Some(2), "{ended:?}");
        assert!(ended.stderr.contains(words), "{ended:?}");
    }
    let ended = end(laser_profiler(&["replay", FILM[0], FILM[0]]).arg("--view=0"));
    assert_eq!(ended.code, Some(2), "{ended:?}");
    assert!(ended.stderr.contains("shows one recording"), "{ended:?}");
}

#[test]
fn a_recording_without_a_frame_is_a_failure() {
    let place = tempfile::tempdir().unwrap();
    let bag = place.path().join("bag");
    record_images(&bag, &[b"no image".to_vec()]);
    let ended = end(laser_profiler(&["replay", "--view=0", "--view-exit"]).arg(&bag));
    assert_eq!(ended.code, Some(0), "what is there is shown: {ended:?}");
    let empty = place.path().join("empty");
    record_images(&empty, &[]);
    let ended = end(laser_profiler(&["replay", "--view=0"]).arg(&empty));
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(ended.stderr.contains("holds no messages"), "{ended:?}");
}

/// The live socket in a real browser. Foxglove 1.48 knows the protocol by an earlier name: `tests/browser/subprotocol.mjs`.
#[test]
fn foxglove_shows_a_live_view() {
    let Some(tools) = browser::tools() else { return };
    // Slowly, so that a page drawn without a graphics card is there before the end.
    let slices = ["--rate", "0.2", "--ros-args", "-p", "slice.profiles:=10"];
    let viewed = Viewed::replay(&[FILM, &slices].concat());
    let seen = foxglove(tools, Path::new(&viewed.url), "9", "foxglove_live.png");
    assert_eq!(viewed.interrupt().code, Some(0));
    let topics = &seen["topics"];
    assert_eq!(topics["/laser_profiler/preview"], "sensor_msgs/msg/Image", "{seen}");
    assert_eq!(topics["/laser_profiler/profile"], "laser_profiler_msgs/msg/Profile", "{seen}");
    // The centreline is green, the profile blue; the cell and its film are of several colours.
    assert!(pixels(&seen, "ImageViewPanel!overlay", &[120]) > 500, "{seen}");
    assert!(pixels(&seen, "Plot!profile", &[210]) > 500, "{seen}");
    assert!(pixels(&seen, "3D!cloud", &[30, 60, 90, 120]) > 500, "{seen}");
    let parameters = seen["panels"]["Parameters!parameters"]["text"].as_str().unwrap();
    assert!(parameters.contains("use_sim_time"), "{parameters}");
}
