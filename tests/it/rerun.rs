//! Rerun, a viewer that is not ours, draws a results bag by the recipe `launch_configs/viewers/to_rerun.py`.
//!
//! The picture stays in `target/browser`.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

use serde_json::Value as Json;

use crate::{
    browser::picture,
    interop::python,
    program::{Ended, end, replay, skip},
    recordings::bundled,
};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// True if a Vulkan driver (hardware or software) is available; reports the skip otherwise.
fn has_vulkan() -> bool {
    let is_there = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d"]
        .iter()
        .any(|place| fs::read_dir(place).is_ok_and(|mut drivers| drivers.next().is_some()));
    if !is_there {
        let reason = "no driver of Vulkan; Debian's mesa-vulkan-drivers has one in software";
        skip("rerun", reason);
        assert!(env::var_os("CI").is_none(), "CI skips nothing: {reason}");
    }
    is_there
}

/// Runs the recipe.
fn recipe(python: &Path, arguments: &[&Path]) -> Ended {
    let script = Path::new(ROOT).join("launch_configs/viewers/to_rerun.py");
    end(Command::new(python).arg(script).args(arguments))
}

fn results(directory: &Path, name: &str, arguments: &[&str]) -> PathBuf {
    let output = directory.join(name);
    let parameters = ["--params-file", "bags/film_defects.params.yaml"];
    // Exit code 3: the recording lacks frames on purpose.
    replay(&bundled("film_defects"), &output, 3, &[&parameters, arguments].concat());
    output
}

#[test]
fn rerun_shows_a_results_bag() {
    let Some(python) = python() else { return };
    if !has_vulkan() {
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    let bag = results(directory.path(), "results", &["--with-images"]);
    let film = directory.path().join("film.rrd");
    let heights = ["--heights", "5.2", "7"].map(Path::new);
    let ended = recipe(python, &[&[&*bag, Path::new("-o"), &film] as &[_], &heights].concat());
    assert_eq!(ended.code, Some(0), "{ended:?}");
    for expected_text in
        ["147 image", "147 centerline", "147 profile", "3 points_dense", "1 height_map"]
    {
        assert!(ended.stdout.contains(expected_text), "{expected_text}: {ended:?}");
    }

    let mut command = Command::new(python);
    command.arg(Path::new(ROOT).join("tests/browser/rerun_picture.py")).arg(&film);
    let place = picture("rerun.png");
    let ended = end(command.args(["--seconds", "4.6", "--picture"]).arg(&place));
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let seen: Json = serde_json::from_str(&ended.stdout).unwrap();
    let views = seen["views"].as_object().unwrap();
    for (name, view) in views {
        assert_eq!(view["reports"], Json::Array(Vec::new()), "{name}: {seen}");
    }
    // Centreline green, profile blue; film, bubbles, rim and table each of their colour.
    let expected: [(&str, &[u32]); 9] = [
        ("Stripe and centreline", &[120]),
        ("Profile: x right, z up [mm]", &[210]),
        ("Points by height [mm]", &[0, 30]),
        ("Points by height [mm]", &[90]),
        ("Points by height [mm]", &[120]),
        ("Points by height [mm]", &[240]),
        ("Height map", &[0, 30]),
        ("Height map", &[60, 90]),
        ("Median sigma of z [µm]", &[270]),
    ];
    for (name, hues) in expected {
        let count = |hue: &u32| views[name]["hues"][hue.to_string()].as_u64().unwrap_or(0);
        assert!(hues.iter().map(count).sum::<u64>() > 200, "{name} {hues:?}: {seen}");
    }
}

/// Images and results in two bags, as the live node records them, give the same recording. A bag without results is reported.
#[test]
fn the_script_uses_available_topics_and_names_missing_ones() {
    let Some(python) = python() else { return };
    let directory = tempfile::tempdir().unwrap();
    let (bag, images) = (results(directory.path(), "results", &[]), bundled("film_defects"));
    let film = directory.path().join("film.rrd");
    let ended = recipe(python, &[&bag, &images, Path::new("-o"), &film]);
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert!(
        ended.stdout.contains("147 image") && ended.stdout.contains("147 profile"),
        "{ended:?}"
    );

    let ended = recipe(python, &[&images, Path::new("-o"), &film]);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(ended.stderr.contains("no results of the node /laser_profiler"), "{ended:?}");
    let ended = recipe(python, &[&directory.path().join("absent"), Path::new("-o"), &film]);
    assert!(ended.code == Some(1) && ended.stderr.contains("absent: no recording"), "{ended:?}");
}
