use std::fs;

use super::*;
use crate::ros::{arguments, node_params::NodeParams};

/// The values that a command line gives; files are written to a directory of their own first.
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
    load(&files, line).unwrap().float("extraction.segment_threshold").unwrap()
}

fn section(node: &str, value: &str) -> String {
    format!("{node}: {{ros__parameters: {{extraction: {{segment_threshold: {value}}}}}}}")
}

#[test]
fn later_files_win_and_p_wins_over_all() {
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
fn a_refusal_names_key_value_range_and_file() {
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
fn a_path_starts_from_the_file_that_sets_it() {
    let text = "/**: {ros__parameters: {calibration_file: rig/calibration.yaml}}";
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("p.yaml");
    fs::write(&file, text).unwrap();
    let node = NodeNames::new("laser_profiler", &[]).unwrap();
    let mut arguments = RosArguments { parameter_files: vec![file], ..Default::default() };
    let values = Parameters::load(&node, &arguments).unwrap();
    let path = NodeParams::new(&values).unwrap().calibration_file;
    assert_eq!(path, Some(directory.path().join("rig/calibration.yaml")));
    assert!(!values.to_yaml().contains(directory.path().to_str().unwrap()));

    arguments.assignments.push(arguments::Assignment {
        node: None,
        name: "calibration_file".into(),
        value: Value::Text("other.yaml".into()),
    });
    let values = Parameters::load(&node, &arguments).unwrap();
    assert_eq!(NodeParams::new(&values).unwrap().calibration_file, Some("other.yaml".into()));
}

#[test]
fn the_canonical_text_reads_back_and_its_hash_follows_every_value() {
    let mut values = Parameters::default();
    values.set("extraction.shot_gain", Value::Float(1e-6), "a test").unwrap();
    values.set("motion.step", Value::Float(0.1), "a test").unwrap();
    let text = values.to_yaml();
    let again = load(&[("p.yaml", &text)], "").unwrap();
    assert!(
        values.iter().map(|(_, value)| value).eq(again.iter().map(|(_, value)| value)),
        "{text}"
    );
    assert_eq!(values.sha256(), again.sha256());
    assert_ne!(values.sha256(), Parameters::default().sha256());
    assert_eq!(values.sha256().len(), 64);
}

#[test]
fn the_table_is_sound() {
    for (index, parameter) in TABLE.iter().enumerate() {
        assert!(parameter.check(&parameter.default_value()).is_ok(), "{}", parameter.name);
        assert!(
            TABLE[..index].iter().all(|earlier| earlier.name != parameter.name),
            "{}",
            parameter.name
        );
        assert!(parameter.text.ends_with('.'), "{}", parameter.name);
    }
    assert!(NodeParams::new(&Parameters::default()).is_ok());
}
