use std::fs;

use super::*;
use crate::{
    ros::{arguments, node_params::NodeParams},
    scanner::params::ExtractionParams,
};

/// Loads the values of a command line, after writing `files` to a temporary directory.
fn load(files: &[(&str, &str)], line: &str) -> Result<Parameters, String> {
    let directory = tempfile::tempdir().unwrap();
    for (name, text) in files {
        fs::write(directory.path().join(name), text).unwrap();
    }
    let mut line: Vec<_> = line.split_whitespace().map(str::to_owned).collect();
    line.insert(0, "--ros-args".to_owned());
    let (mut arguments, _) = arguments::split(&line).map_err(|error| error.to_string())?;
    arguments.parameter_files = files.iter().map(|(name, _)| directory.path().join(name)).collect();
    let node = NodeNames::new("laser_profiler", &arguments.remaps).unwrap();
    Parameters::load(&node, &arguments).map_err(|error| error.to_string())
}

fn threshold(files: &[&str], line: &str) -> f64 {
    let names = ["a.yaml", "b.yaml"];
    let files: Vec<_> = names.into_iter().zip(files.iter().copied()).collect();
    let values = load(&files, line).unwrap();
    NodeParams::new(&values).unwrap().cameras[0].scanner.extraction.segment_threshold
}

#[test]
fn the_extraction_has_the_defaults_of_the_scanner() {
    let values = load(&[], "").unwrap();
    let extraction = NodeParams::new(&values).unwrap().cameras[0].scanner.extraction;
    assert_eq!(extraction, ExtractionParams::default());
}

fn section(node: &str, value: &str) -> String {
    format!("{node}: {{ros__parameters: {{extraction: {{segment_threshold: {value}}}}}}}")
}

#[test]
fn later_files_override_earlier_and_p_overrides_all() {
    let (any, exact) = (section("/**", "10.0"), section("/laser_profiler", "20.0"));
    let later = section("/**", "30.0");
    assert!((threshold(&[], "") - 35.0).abs() < 1e-12);
    assert!((threshold(&[&any, &later], "") - 30.0).abs() < 1e-12);
    assert!(
        (threshold(&[&exact, &later], "") - 20.0).abs() < 1e-12,
        "an exact name beats a wildcard"
    );
    assert!((threshold(&[&exact], "-p extraction.segment_threshold:=5.0") - 5.0).abs() < 1e-12);
    let both =
        "-p laser_profiler:extraction.segment_threshold:=6.0 -p extraction.segment_threshold:=5.0";
    assert!((threshold(&[], both) - 6.0).abs() < 1e-12);
    assert!((threshold(&[], "-p other:extraction.segment_threshold:=6.0") - 35.0).abs() < 1e-12);
    assert!(
        (threshold(&[&exact], "-r __ns:=/cell") - 35.0).abs() < 1e-12,
        "another node's section"
    );
}

#[test]
fn an_error_names_key_value_range_and_file() {
    let cases = [
        ("extraction.segment_threshold: 35", ["extraction.segment_threshold", "35", "write 35.0"]),
        (
            "extraction.segment_threshold: 300.0",
            ["extraction.segment_threshold", "300.0", "0.0 to 255.0"],
        ),
        (
            "extraction.segment_threshold: .nan",
            ["extraction.segment_threshold", ".nan", "0.0 to 255.0"],
        ),
        (
            "extraction.segment_threshold: .inf",
            ["extraction.segment_threshold", ".inf", "0.0 to 255.0"],
        ),
        (
            "extraction.method: best",
            ["extraction.method", "\"best\"", "gray_gravity, gaussian_fit, improved_gravity"],
        ),
        ("extraction.blur_radius: 2.5", ["extraction.blur_radius", "2.5", "0 to 15"]),
        ("extraction.blur_radius: -1", ["extraction.blur_radius", "-1", "0 to 15"]),
        ("slice.profiles: '5'", ["slice.profiles", "\"5\"", "not a text"]),
        ("stripe_direction: true", ["stripe_direction", "true", "not a boolean"]),
        (
            "extraction.segment: 35.0",
            ["extraction.segment", "no parameter", "extraction.segment_threshold"],
        ),
    ];
    for (text, words) in cases {
        let text = format!("/**: {{ros__parameters: {{{text}}}}}");
        let error = load(&[("strange.yaml", &text)], "").unwrap_err();
        for word in words.into_iter().chain(["strange.yaml"]) {
            assert!(error.contains(word), "{text}: {error} lacks {word}");
        }
    }
    assert!(load(&[], "-p slice.profiles:=0").unwrap_err().starts_with("-p: slice.profiles is 0"));
}

#[test]
fn a_path_starts_at_the_file_that_sets_it() {
    let text = "/**: {ros__parameters: {calibration_file: rig/calibration.yaml}}";
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("p.yaml");
    fs::write(&file, text).unwrap();
    let node = NodeNames::new("laser_profiler", &[]).unwrap();
    let mut arguments = RosArguments { parameter_files: vec![file], ..Default::default() };
    let values = Parameters::load(&node, &arguments).unwrap();
    let path = &NodeParams::new(&values).unwrap().cameras[0].calibration_file;
    assert_eq!(*path, Some(directory.path().join("rig/calibration.yaml")));
    assert!(!values.to_yaml().contains(directory.path().to_str().unwrap()));

    arguments.assignments.push(arguments::Assignment {
        node: None,
        name: "calibration_file".into(),
        value: Value::Text("other.yaml".into()),
    });
    let values = Parameters::load(&node, &arguments).unwrap();
    let path = &NodeParams::new(&values).unwrap().cameras[0].calibration_file;
    assert_eq!(*path, Some("other.yaml".into()));
}

fn values(parameters: &Parameters) -> Vec<(&str, &Value)> {
    parameters.iter().map(|declared| (declared.name(), declared.value())).collect()
}

#[test]
fn the_canonical_text_reads_back() {
    let mut written = Parameters::default();
    written.set("cameras", names(&["left", "right"]), "a test").unwrap();
    let settings = [
        ("left.extraction.shot_gain", Value::Float(1e-6)),
        ("right.motion.step", Value::Float(0.1)),
        ("recording.enabled", Value::Bool(true)),
        ("qos_overrides./left/image_raw.subscription.depth", Value::Integer(1)),
        ("qos_overrides./a.publisher.reliability", Value::Text("best_effort".into())),
    ];
    for (name, value) in settings {
        written.set(name, value, "a test").unwrap();
    }
    let text = written.to_yaml();
    let again = load(&[("p.yaml", &text)], "").unwrap();
    assert_eq!(values(&written), values(&again), "{text}");
    assert!(text.contains("\n    recording.directory: \".\"\n"), "{text}");
}

#[test]
fn the_hash_depends_only_on_what_determines_a_cameras_results() {
    let hash = |line: &str, camera: &str| load(&[], line).unwrap().camera_sha256(camera);
    let of_defaults = hash("", "");
    assert_eq!(of_defaults.len(), 64);
    let beside = "-p recording.enabled:=true -p qos_overrides./a.publisher.depth:=1";
    assert_eq!(hash(beside, ""), of_defaults);
    assert_eq!(hash("-p cameras:=[left,right]", "right"), of_defaults, "the name does not matter");
    assert_ne!(hash("-p motion.step:=0.1", ""), of_defaults);
    let left = "-p cameras:=[left,right] -p left.motion.step:=0.1";
    assert_eq!(hash(left, "left"), hash("-p motion.step:=0.1", ""));
    assert_eq!(hash(left, "right"), of_defaults);
}

fn names(cameras: &[&str]) -> Value {
    Value::TextList(cameras.iter().map(|&name| name.to_owned()).collect())
}

#[test]
fn each_of_several_cameras_has_its_own_parameters() {
    let file = "/**: {ros__parameters: {left: {slice: {profiles: 7}}, cameras: [left, right]}}";
    let line = "-p right.image_transport:=compressed -p recording.split_seconds:=60";
    let values = load(&[("two.yaml", file)], line).unwrap();
    assert_eq!(values.cameras(), ["left", "right"]);
    let params = NodeParams::new(&values).unwrap();
    assert_eq!(params.recording.split_seconds, Some(60));
    let [left, right] = params.cameras.as_slice() else { panic!("{params:?}") };
    assert_eq!(
        (&*left.name, left.scanner.slice_profiles, left.chosen_transport()),
        ("left", 7, None)
    );
    assert_eq!((&*right.name, right.scanner.slice_profiles), ("right", 100));
    assert!(right.chosen_transport().is_some());

    let unnamed = load(&[], "-p cameras:=[]").unwrap();
    assert_eq!(unnamed.cameras(), [""]);
    assert!(unnamed.get("slice.profiles").is_some());
}

#[test]
fn a_remaining_camera_keeps_its_values() {
    let mut values = load(&[], "-p cameras:=[left,right] -p right.slice.profiles:=7").unwrap();
    values.set("cameras", names(&["top", "right"]), "a test").unwrap();
    let get = |name| values.get(name).map(Declared::value);
    assert_eq!(get("right.slice.profiles"), Some(&Value::Integer(7)));
    assert_eq!(get("top.slice.profiles"), Some(&Value::Integer(100)));
    assert_eq!(get("left.slice.profiles"), None);
}

#[test]
fn parameters_of_no_camera_are_rejected_with_a_hint() {
    let cases = [
        ("-p cameras:=[left,right] -p slice.profiles:=7", "such as left.slice.profiles"),
        (
            "-p cameras:=[left,right] -p top.slice.profiles:=7",
            "no camera \"top\", only [left, right]",
        ),
        ("-p left.slice.profiles:=7", "write slice.profiles"),
        ("-p cameras:=[left,left]", "unique names"),
        ("-p cameras:=[9]", "texts"),
        ("-p cameras:=['9']", "a digit"),
        ("-p cameras:=['']", "empty for one camera"),
        ("-p cameras:=[recording]", "a parameter of the node"),
        ("-p cameras:=[qos_overrides]", "a parameter of the node"),
        ("-p cameras:=left", "a list of at most 16 texts, not a text"),
        ("-p qos_overrides./a.publisher.reliability:=always", "one of reliable, best_effort"),
        ("-p qos_overrides./a.publisher.depth:=0", "from 1 to"),
        ("-p qos_overrides./a.publisher.color:=0", "a policy of reliability, durability"),
    ];
    for (line, words) in cases {
        let error = load(&[], line).unwrap_err();
        assert!(error.contains(words), "{line}: {error}");
    }
    let many: Vec<_> = (0..17).map(|number| format!("c{number}")).collect();
    let line = format!("-p cameras:=[{}]", many.join(","));
    assert!(load(&[], &line).unwrap_err().contains("at most 16"));
}

#[test]
fn the_tables_are_consistent() {
    let all = Parameters::default();
    for (index, parameter) in all.iter().map(Declared::row).enumerate() {
        assert!(parameter.check(&parameter.default_value()).is_ok(), "{}", parameter.name);
        let mut earlier = all.iter().take(index);
        assert!(earlier.all(|earlier| earlier.name() != parameter.name), "{}", parameter.name);
        assert!(parameter.text.ends_with('.'), "{}", parameter.name);
    }
    assert!(NodeParams::new(&all).is_ok());
}
