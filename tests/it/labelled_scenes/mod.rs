//! Scenes like those of real cameras, rendered by the project itself: the share of the labelled lines that is found.
//!
//! The pictures lie in `tests/data/scenes`, each beside its labels and its parameter file. To write them anew:
//! `LABELLED_SCENES=write cargo test --no-default-features --test it labelled_scenes::pictures`.

mod render;
mod scenes;
mod score;

use std::{fs, path::PathBuf};

use laser_profiler::scanner::{
    coverage::LARGEST_SHARE,
    params::{ExtractionParams, Method, PeakSelection},
};

use render::csv;
use score::{Labelled, Score};

fn path(name: &str, ending: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data/scenes")
        .join(format!("{name}.{ending}"))
}

#[test]
fn pictures_and_labels_match_the_rendered_scenes() {
    let writes = std::env::var("LABELLED_SCENES").is_ok_and(|value| value == "write");
    for scene in scenes::all() {
        let rendered = scene.render();
        let (picture, labels) = (path(scene.name, "png"), path(scene.name, "csv"));
        if writes {
            rendered.picture.save(&picture).unwrap();
            fs::write(&labels, csv(&rendered.labels)).unwrap();
        }
        let name = scene.name;
        assert!(image::open(&picture).unwrap() == rendered.picture, "{name}.png differs");
        assert!(
            fs::read_to_string(&labels).unwrap() == csv(&rendered.labels),
            "{name}.csv differs"
        );
    }
    let files = fs::read_dir(path("", "").parent().unwrap()).unwrap();
    let bytes: u64 = files.map(|file| file.unwrap().metadata().unwrap().len()).sum();
    assert!(bytes < 2_000_000, "{bytes} bytes are too many");
}

/// Current results with each scene's own parameters: shares of the labelled lines found within 1 px and within 3 px, and of
/// the points that lie on no label.
const LIMITS: [(&str, [f64; 3]); 9] = [
    ("bright_ambient", [0.98, 0.98, 0.02]),
    ("noisy_floor", [0.99, 0.99, 0.02]),
    ("halo_and_wall", [0.99, 0.99, 0.01]),
    ("checkerboard", [0.94, 0.97, 0.02]),
    ("speckle", [0.99, 0.99, 0.01]),
    ("gaps", [0.99, 0.99, 0.04]),
    ("steep", [0.99, 0.99, 0.01]),
    ("reflection", [0.90, 0.90, 0.01]),
    ("red_on_colours", [0.99, 0.99, 0.01]),
];

#[test]
fn labelled_lines_are_found_with_the_parameters_beside_them() {
    assert!(scenes::all().iter().map(|scene| scene.name).eq(LIMITS.map(|(name, _)| name)));
    let mut complaints = Vec::new();
    for (name, [near, within, outliers]) in LIMITS {
        let score = Labelled::open(name).score(|params| params);
        eprintln!("{name:15} {score}");
        let is_good =
            score.found_1px >= near && score.found_3px >= within && score.outliers <= outliers;
        if !is_good {
            complaints.push(format!("{name}: {score}; limits {near} {within} {outliers}"));
        }
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

/// Segmentation does not depend on the estimator: every method finds about the same lines.
#[test]
fn every_method_finds_the_lines_of_every_scene() {
    let mut complaints = Vec::new();
    for (name, [_, within, outliers]) in LIMITS {
        let scene = Labelled::open(name);
        for method in Method::NAMES {
            let score = scene.score(|params| ExtractionParams {
                method: Method::from_name(method).unwrap(),
                ..params
            });
            eprintln!("{name:15} {method:16} {score}");
            if score.found_3px < within - 0.03 || score.outliers > outliers + 0.03 {
                complaints.push(format!("{name}: {method}: {score}"));
            }
        }
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

/// The selection in a scene's parameters is as good as any other.
#[test]
fn no_other_selection_finds_more() {
    let mut complaints = Vec::new();
    for (name, _) in LIMITS {
        let scene = Labelled::open(name);
        let own = scene.score(|params| params);
        for selection in PeakSelection::NAMES {
            let score = scene.score(|params| ExtractionParams {
                peak_selection: PeakSelection::from_name(selection).unwrap(),
                ..params
            });
            eprintln!("{name:15} {selection:16} {score}");
            if score.found_3px > own.found_3px + 0.02 {
                complaints.push(format!("{name}: {selection} finds more: {score}"));
            }
        }
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

/// A room above the threshold is distinguished from a line above it.
#[test]
fn too_low_a_threshold_shows_in_the_share_of_pixels_above_it() {
    let bright =
        ["bright_ambient", "noisy_floor", "halo_and_wall", "checkerboard", "red_on_colours"];
    for (name, _) in LIMITS {
        let scene = Labelled::open(name);
        let papers = scene.share_above_threshold(|_| ExtractionParams::default()).unwrap();
        let own = scene.share_above_threshold(|params| params);
        eprintln!("{name:15} {:5.1} % above the paper's threshold", 100.0 * papers);
        assert_eq!(papers > LARGEST_SHARE, bright.contains(&name), "{name}: {papers}");
        assert!(own.is_none_or(|share| share <= LARGEST_SHARE), "{name}: {own:?}");
    }
}

/// The score itself: a line that is right, one that is 2 px off and one that is not there.
#[test]
fn scores_count_correctly() {
    let labels = [(0, 10.0), (1, 10.0), (2, 10.0), (2, 30.0), (3, f64::NAN)];
    let score = Score::of(&labels, &[(0, 10.4), (1, 12.0), (2, 29.5), (3, 10.0)]);
    assert_eq!((score.found_1px, score.found_3px, score.outliers), (2.0 / 3.0, 1.0, 0.25));
}
