//! The launch files in Python, XML and YAML: their command lines, and that the node accepts them. They are resolved by
//! `tests/interop/resolve_launch.py`, since ROS's own launch is on no package index.

use std::{
    path::{Path, PathBuf},
    process::Command,
};

use laser_profiler::ros::{
    arguments, names::NodeNames, node_params::NodeParams, parameters::Parameters,
};
use serde_json::Value as Json;
use tempfile::TempDir;

use crate::{
    interop::{interop, python},
    packaging::installed,
    program::{Ended, end},
    recordings::bundled,
};

const FORMS: [&str; 3] = ["py", "xml", "yaml"];

/// An install prefix, and a Python to resolve its launch files with.
struct Prefix {
    directory: TempDir,
    python: &'static Path,
}

impl Prefix {
    fn new() -> Option<Self> {
        let prefix = Self { python: python()?, directory: tempfile::tempdir().unwrap() };
        installed(&prefix.path());
        Some(prefix)
    }

    fn path(&self) -> PathBuf {
        self.directory.path().join("prefix")
    }

    fn resolve(&self, launch_file: &str, arguments: &[&str]) -> Ended {
        let mut command = Command::new(self.python);
        command.arg(interop("resolve_launch.py"));
        command.arg(self.path().join("share/laser_profiler/launch").join(launch_file));
        end(command.args(arguments).env("AMENT_PREFIX_PATH", self.path()))
    }

    /// The command line on which all three forms of a launch file agree.
    fn resolved(&self, name: &str, arguments: &[&str]) -> Json {
        let [python, xml, yaml] = FORMS.map(|form| {
            let ended = self.resolve(&format!("{name}.launch.{form}"), arguments);
            assert_eq!(ended.code, Some(0), "{name}.launch.{form}: {}", ended.stderr);
            serde_json::from_str::<Json>(&ended.stdout).unwrap()
        });
        assert_eq!(python, xml, "{name}");
        assert_eq!(python, yaml, "{name}");
        python
    }

    /// The command line that all three forms start.
    fn command(&self, name: &str, arguments: &[&str]) -> Vec<String> {
        let command = &self.resolved(name, arguments)["command"];
        let words = command.as_array().unwrap().iter();
        words.map(|word| word.as_str().unwrap().to_owned()).collect()
    }
}

/// Names and parameters of the node in a command line.
fn node(command: &[String]) -> (NodeNames, NodeParams, Vec<String>) {
    let (ros, own) = arguments::split(&command[1..]).unwrap();
    let names = NodeNames::new("laser_profiler", &ros.remaps).unwrap();
    let parameters = Parameters::load(&names, &ros).unwrap();
    assert_ne!(parameters, Parameters::default(), "the file applies to this node");
    let params = NodeParams::new(&parameters).unwrap();
    (names, params, own)
}

#[test]
fn single_camera_launch_files_agree() {
    let Some(prefix) = Prefix::new() else { return };
    let command = prefix.command("single_camera", &[]);
    let executable = prefix.path().join("lib/laser_profiler/laser_profiler");
    assert_eq!(Path::new(&command[0]), executable);
    let (names, params, own) = node(&command);
    assert_eq!(own, ["run", "--transport", "dds"]);
    assert_eq!(names.fully_qualified(), "/laser_profiler");
    assert_eq!(names.resolve("image_raw").unwrap(), "/camera/image_raw");
    assert_eq!(names.resolve("camera_info").unwrap(), "/camera/camera_info");
    assert!(params.cameras[0].calibration_file.as_ref().unwrap().is_file());

    let command = prefix.command(
        "single_camera",
        &["namespace:=cell", "transport:=zenoh", "image_topic:=/top/image", "executable:=/my/own"],
    );
    assert_eq!(command[0], "/my/own");
    let (names, _, own) = node(&command);
    assert_eq!(own, ["run", "--transport", "zenoh"]);
    assert_eq!(names.fully_qualified(), "/cell/laser_profiler");
    assert_eq!(names.resolve("image_raw").unwrap(), "/top/image");
}

#[test]
fn two_cameras() {
    let Some(prefix) = Prefix::new() else { return };
    let arguments = ["namespace:=cell", "left_image_topic:=/gantry/image_raw"];
    let (names, params, own) = node(&prefix.command("two_cameras", &arguments));
    assert_eq!(own, ["run", "--transport", "dds"]);
    assert_eq!(names.fully_qualified(), "/cell/laser_profiler");
    let images = params.cameras.iter().map(|camera| {
        assert!(camera.calibration_file.as_ref().unwrap().is_file(), "{}", camera.name);
        ["image_raw", "camera_info"]
            .map(|topic| names.resolve(&format!("{}/{topic}", camera.name)).unwrap())
    });
    assert_eq!(
        images.collect::<Vec<_>>(),
        [["/gantry/image_raw", "/left/camera_info"], ["/right/image_raw", "/right/camera_info"]]
    );
}

#[test]
fn the_resolver_rejects_invalid_launch_files() {
    let Some(prefix) = Prefix::new() else { return };
    for (argument, reason) in [
        ("transport:=tcp", "none of"),
        ("bogus:=1", "takes no argument"),
        ("params_file:=missing.yaml", "no parameter file"),
    ] {
        for form in FORMS {
            let ended = prefix.resolve(&format!("single_camera.launch.{form}"), &[argument]);
            assert_eq!(ended.code, Some(1), "{ended:?}");
            assert!(ended.stderr.contains(reason), "{ended:?}");
        }
    }
}

/// From the launch file through the prefix to the results: the command line, with `replay` for `run`.
#[test]
fn the_launched_node_measures() {
    let Some(prefix) = Prefix::new() else { return };
    let turntable = prefix.path().join("share/laser_profiler/config/turntable.yaml");
    let turntable = format!("params_file:={}", turntable.display());
    let command = prefix.command("single_camera", &[&turntable, "namespace:=cell"]);
    let ros = command.iter().position(|word| word == "--ros-args").unwrap();
    let results = prefix.directory.path().join("results");
    let mut replay = Command::new(&command[0]);
    replay.args(["replay", "--json", "-o"]).arg(&results).arg(bundled("saturated_vertical"));
    let ended = end(replay.args(&command[ros..]));
    // Exit code 3: the recording lacks frames on purpose.
    assert_eq!(ended.code, Some(3), "{ended:?}");
    let summary: Json = serde_json::from_str(&ended.stdout).unwrap();
    assert_eq!(summary["frames"]["processed"], 35, "{summary}");
    let metadata = std::fs::read_to_string(results.join("metadata.yaml")).unwrap();
    assert!(metadata.contains("/cell/laser_profiler/centerline"), "{metadata}");
}
