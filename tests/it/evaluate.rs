//! `evaluate`: figures that are known beforehand, requests that cannot be followed, and the page that it writes.

use std::{fs, path::Path};

use laser_profiler::{
    bag::{BagReader, Filter, ReadOptions},
    evaluate::experiment::Experiment,
    msg::{cdr, laser_profiler_msgs::Centerline, schema::Message},
    scanner::params::Method,
};
use serde_json::Value as Json;

use crate::{
    program::{Ended, end, laser_profiler},
    recordings::{bundled, good_images, record, record_images, topic},
};

fn evaluate(arguments: &[&str]) -> Ended {
    let mut command = laser_profiler(&["evaluate"]);
    end(command.args(arguments))
}

fn json(arguments: &[&str], code: i32) -> Json {
    let ended = evaluate(&[arguments, &["--json"]].concat());
    assert_eq!(ended.code, Some(code), "{arguments:?}: {ended:?}");
    serde_json::from_str(&ended.stdout).unwrap()
}

/// A figure of each method in a list, in order.
fn column(methods: &Json, key: &str) -> Vec<f64> {
    methods.as_array().unwrap().iter().map(|method| method[key].as_f64().unwrap()).collect()
}

#[test]
fn table_3_is_reproduced_with_its_errata() {
    let answer = json(&["paper"], 0);
    let rounded = |key, digits: usize| {
        let values = column(&answer["methods"], key).into_iter();
        values.map(|value| format!("{value:.digits$}")).collect::<Vec<_>>()
    };
    assert_eq!(answer["points"], 21);
    assert_eq!(rounded("mean_absolute_px", 3), ["0.060", "0.050", "0.026"]);
    assert_eq!(rounded("standard_error_px", 3), ["0.078", "0.063", "0.034"]);
    assert_eq!(rounded("without_root", 4), ["0.0273", "0.0175", "0.0051"]);
    let text = evaluate(&["paper"]).stdout;
    for text_expected in ["0.078", "0.0273", "square root", "10.3390/app13179831"] {
        assert!(text.contains(text_expected), "{text_expected} in {text}");
    }
}

#[test]
fn the_protocol_on_a_symmetrical_stripe_finds_no_deviation_until_noise_is_added() {
    let directory = tempfile::tempdir().unwrap();
    let bag = directory.path().join("bag");
    record_images(&bag, &good_images(3));
    let path = bag.display().to_string();
    let answer = json(&["paper", &path, "--frames", "2", "--columns", "20..139"], 0);
    assert_eq!((&answer["frames"], &answer["points"]), (&2.into(), &240.into()));
    assert_eq!(answer["columns"], serde_json::json!([20, 139]));
    assert!(column(&answer["methods"], "standard_error_px").iter().all(|&px| px < 1e-4));
    let noise = answer["noise"].as_array().unwrap();
    let gammas: Vec<_> = noise.iter().map(|step| step["gamma"].as_f64().unwrap()).collect();
    assert_eq!(gammas, [10.0, 20.0, 30.0, 40.0, 50.0]);
    for method in 0..3 {
        let of = |step: &Json| step["methods"][method]["from_own_rms_px"].as_f64().unwrap();
        assert!(of(&noise[0]) > 0.005, "{answer}");
        assert!(of(&noise[4]) > 2.0 * of(&noise[0]), "five times the noise");
    }
    let again = json(&["paper", &path, "--frames", "2", "--columns", "20..139"], 0);
    assert_eq!(answer, again);
    let other = json(&["paper", &path, "--frames", "2", "--seed", "2"], 0);
    assert_ne!(answer["noise"], other["noise"]);
}

#[test]
fn a_frame_that_cannot_be_read_is_counted_and_the_rest_measured() {
    let directory = tempfile::tempdir().unwrap();
    let bag = directory.path().join("bag");
    let mut images = good_images(3);
    images[1].truncate(40);
    record_images(&bag, &images);
    let answer = json(&["paper", &bag.display().to_string()], 3);
    assert_eq!((&answer["frames"], &answer["rejected"]), (&2.into(), &1.into()));
}

/// The recording's own truth, counted here.
fn num_true_centers(name: &str) -> u64 {
    let bag = BagReader::open(&bundled(name), &ReadOptions::default()).unwrap();
    let messages = bag.messages(&Filter::topics(["/truth/centerline"]));
    let points = messages.map(|message| {
        let message = message.unwrap();
        cdr::decode::<Centerline<'_>>(&message.data).unwrap().u.len() as u64
    });
    points.sum()
}

#[test]
fn recordings_that_carry_their_truth_are_measured_against_it() {
    // Limits of bags/README.md, which other code than this measures.
    for (name, median_px, p95_px) in
        [("film_defects", 0.008, 0.035), ("saturated_vertical", 0.02, 0.1)]
    {
        let parameters = format!("bags/{name}.params.yaml");
        let bag = format!("bags/{name}");
        let methods = "improved_gravity,gray_gravity";
        let arguments = ["truth", &bag, "--params-file", &parameters, "--methods", methods];
        let answer = json(&arguments, 0);
        assert_eq!((&answer["unpaired"], &answer["rejected"]), (&0.into(), &0.into()));
        let methods = answer["methods"].as_array().unwrap();
        assert_eq!(methods[0]["method"], "improved_gravity");
        assert_eq!(methods[0]["columns"], num_true_centers(name), "{name}");
        assert!(column(&answer["methods"], "median_px")[0] < median_px, "{answer}");
        assert!(column(&answer["methods"], "p95_px")[0] < p95_px, "{answer}");
        assert!(methods[0]["rms_px"].as_f64() < methods[1]["rms_px"].as_f64(), "{answer}");
    }
}

#[test]
fn parameters_are_those_of_the_node() {
    let half = |more: &[&str]| {
        let base = ["truth", "--experiments", "locking", "--methods", "improved_gravity"];
        let answer = json(&[&base, more].concat(), 0);
        answer["locking"][1]["methods"][0]["half_amplitude_px"].as_f64().unwrap()
    };
    let fractional = half(&[]);
    let rounded = half(&["--ros-args", "-p", "extraction.window:=rounded", "--"]);
    assert!(fractional < 0.012 && rounded > 0.05, "{fractional} {rounded}");
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let run = |seed| {
        let base =
            ["truth", "--experiments", "edge,locking", "--methods", "gaussian_fit", "--json"];
        let ended = evaluate(&[&base[..], &["--seed", seed]].concat());
        assert_eq!(ended.code, Some(0), "{ended:?}");
        ended.stdout
    };
    assert_eq!(run("5"), run("5"));
    assert_ne!(run("5"), run("6"));
}

#[test]
fn plots_exist_where_markdown_links_them() {
    let directory = tempfile::tempdir().unwrap();
    let plots = directory.path().join("new/plots");
    let place = plots.display().to_string();
    let arguments =
        ["truth", "--experiments", "edge", "--frames", "1", "--markdown", "--plots", &place];
    let ended = evaluate(&arguments);
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let shown: Vec<_> =
        ended.stdout.split("](").skip(1).map(|rest| rest.split(')').next().unwrap()).collect();
    assert_eq!(shown.len(), 3, "{}", ended.stdout);
    for file in shown {
        let svg = fs::read_to_string(file).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("improved_gravity"), "{file}");
    }
}

#[test]
fn wrong_paper_arguments_are_errors() {
    let directory = tempfile::tempdir().unwrap();
    let [images, truths] = ["images", "truths"].map(|name| directory.path().join(name));
    record_images(&images, &good_images(2));
    record(&truths, &[topic("/truth/centerline", Centerline::TYPE)], &[]);
    let [images, truths] = [images, truths].map(|path| path.display().to_string());
    for (arguments, code, reported) in [
        (&["truth", "--methods", "magic"] as &[&str], 2, &["magic", "improved_gravity"] as &[&str]),
        (&["truth", "--methods", "gaussian_fit,gaussian_fit"], 2, &["twice"]),
        (&["truth", "--experiments", "luck"], 2, &["luck", "reference", "edge"]),
        (&["truth", "--frames", "0"], 2, &["--frames"]),
        (&["truth", "--ros-args", "-p", "extraction.blur_radius:=99"], 2, &["blur_radius", "99"]),
        (&["truth", "--json", "--markdown"], 2, &["--json"]),
        (&["truth", &images], 1, &["/truth/centerline", "simulate"]),
        (&["truth", "/nowhere/bag"], 1, &["/nowhere/bag"]),
        (&["truth", &truths], 1, &["no images"]),
        (&["paper", &truths], 1, &["no images"]),
        (&["paper", &images, "--columns", "9..5"], 2, &["500..900"]),
        (&["paper", &images, "--columns", "100..200"], 2, &["100..200", "160 x 32"]),
        (&["paper", &images, "--frames", "0"], 2, &["--frames"]),
        (&["paper", &images, "--ros-args", "-r", "image_raw:=/left"], 2, &["/left"]),
        (&[], 2, &["Usage"]),
    ] {
        let ended = evaluate(arguments);
        assert_eq!(ended.code, Some(code), "{arguments:?}: {ended:?}");
        for text in reported {
            assert!(ended.stderr.contains(text), "{text}: {ended:?}");
        }
        assert_eq!(ended.stdout, "", "{arguments:?}");
    }
}

/// `cargo xtask accuracy` generates the page; this detects one that is out of date.
#[test]
fn the_page_in_the_documents_has_all_methods_and_experiments() {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    let page = fs::read_to_string(docs.join("accuracy.md")).unwrap();
    let again = "run `cargo xtask accuracy`";
    for method in Method::NAMES {
        assert!(page.contains(&format!("\n| {method} | ")), "{method}: {again}");
    }
    let varied = Experiment::NAMES.iter().filter_map(|name| Experiment::from_name(name));
    for axis in varied.map(Experiment::axis).filter(|axis| !axis.is_empty()) {
        assert!(page.contains(axis), "{axis}: {again}");
    }
    let shown: Vec<_> =
        page.split("](").skip(1).map(|rest| rest.split(')').next().unwrap()).collect();
    assert!(shown.len() >= 9, "{shown:?}");
    for file in shown {
        assert!(docs.join(file).is_file(), "{file}: {again}");
    }
}
