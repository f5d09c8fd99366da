//! Other people's viewer in a real browser: Foxglove 1.48, the last open version, in Chromium. See `tests/browser`.
//!
//! The pictures that it takes stay in `target/browser`.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
};

use serde_json::Value as Json;

use crate::{
    program::{Ended, end, replay, skip},
    recordings::bundled,
};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
const LAYOUT: &str = "launch_configs/viewers/foxglove_layout.json";

/// What the checks run with.
#[derive(Debug)]
pub(crate) struct Tools {
    /// Directory of the JavaScript packages.
    modules: PathBuf,
    chromium: PathBuf,
}

/// Chromium and the pinned packages, installed once and kept for the next run; `None` after saying what is missing.
pub(crate) fn tools() -> Option<&'static Tools> {
    static TOOLS: OnceLock<Result<Tools, String>> = OnceLock::new();
    match TOOLS.get_or_init(install) {
        Ok(tools) => Some(tools),
        Err(reason) => {
            skip("browser", reason);
            assert!(env::var_os("CI").is_none(), "CI skips nothing: {reason}");
            None
        }
    }
}

/// A program by the first of its names that is in `PATH`.
pub(crate) fn program(names: &[&str]) -> Result<PathBuf, String> {
    let path = env::var_os("PATH").unwrap_or_default();
    let directories: Vec<_> = env::split_paths(&path).collect();
    let mut places = names.iter().flat_map(|name| directories.iter().map(move |at| at.join(name)));
    places.find(|place| place.is_file()).ok_or_else(|| format!("{} is missing", names[0]))
}

fn install() -> Result<Tools, String> {
    let chromium = program(&["chromium", "chromium-browser", "google-chrome"])?;
    let (node, npm) = (program(&["node"])?, program(&["npm"])?);
    let place = Path::new(env!("CARGO_TARGET_TMPDIR")).join("browser");
    let tools = Tools { modules: place.join("node_modules"), chromium };
    let read =
        |path: PathBuf| fs::read(&path).map_err(|error| format!("{}: {error}", path.display()));
    let source = Path::new(ROOT).join("tests/browser");
    let lock = read(source.join("package-lock.json"))?;
    let stamp = place.join("installed.json");
    if fs::read(&stamp).is_ok_and(|installed| installed == lock) {
        return Ok(tools);
    }
    let write = |name: &str, bytes: &[u8]| {
        fs::write(place.join(name), bytes).map_err(|error| error.to_string())
    };
    fs::create_dir_all(&place).map_err(|error| error.to_string())?;
    write("package.json", &read(source.join("package.json"))?)?;
    write("package-lock.json", &lock)?;
    let mut command = Command::new(npm);
    command.args(["ci", "--ignore-scripts", "--no-audit", "--no-fund"]).current_dir(&place);
    let ended = end(&mut command);
    if ended.code != Some(0) {
        return Err(format!("{} {command:?}: {}", node.display(), ended.stderr));
    }
    write("installed.json", &lock)?;
    Ok(tools)
}

/// Where pictures stay.
pub(crate) fn picture(name: &str) -> PathBuf {
    let directory = Path::new(ROOT).join("target/browser");
    fs::create_dir_all(&directory).unwrap();
    directory.join(name)
}

/// Runs a check of `tests/browser`; arguments are pairs of a name and a value.
pub(crate) fn check(tools: &Tools, script: &str, arguments: &[(&str, &Path)]) -> Ended {
    let mut command = Command::new("node");
    command.arg(Path::new(ROOT).join("tests/browser").join(script));
    let common = [("modules", tools.modules.as_path()), ("chromium", tools.chromium.as_path())];
    for (name, value) in common.iter().chain(arguments) {
        command.arg(format!("--{name}")).arg(value);
    }
    end(&mut command)
}

/// Plays a recording in Foxglove for some seconds of its time and tells what is seen.
fn foxglove(tools: &Tools, source: &Path, seconds: &str, picture: &Path) -> Json {
    let layout = Path::new(ROOT).join(LAYOUT);
    let arguments = [
        ("source", source),
        ("layout", &layout),
        ("seconds", Path::new(seconds)),
        ("picture", picture),
    ];
    let ended = check(tools, "foxglove.mjs", &arguments);
    assert_eq!(ended.code, Some(0), "{}\n{}", ended.stdout, ended.stderr);
    serde_json::from_str(&ended.stdout).unwrap()
}

/// Pixels of a panel in the colours within 15 degrees of some hues.
fn pixels(seen: &Json, panel: &str, hues: &[u32]) -> u64 {
    let hues = hues.iter().map(|hue| &seen["panels"][panel]["hues"][hue.to_string()]);
    hues.map(|count| count.as_u64().unwrap_or(0)).sum()
}

/// The command of the documentation's picture: the height map is there before the recording ends.
fn results(output: &Path, arguments: &[&str]) -> PathBuf {
    let parameters = ["--params-file", "bags/film_defects.params.yaml"];
    // Exit code 3: the recording lacks frames on purpose.
    replay(&bundled("film_defects"), output, 3, &[&parameters, arguments].concat());
    output.join("results_0.mcap")
}

#[test]
fn foxglove_shows_a_results_bag() {
    let Some(tools) = tools() else { return };
    let directory = tempfile::tempdir().unwrap();
    let arguments =
        ["--with-images", "--ros-args", "-p", "slice.profiles:=10", "-p", "scan.max_profiles:=110"];
    let bag = results(&directory.path().join("results"), &arguments);
    let seen = foxglove(tools, &bag, "5.2", &picture("foxglove.png"));

    assert_eq!(seen["problems"], 0, "{seen}");
    assert_eq!(seen["errors"], Json::Array(Vec::new()), "{seen}");
    let topics = seen["topics"].as_object().unwrap();
    for (topic, kind) in [
        ("/camera/image_raw", "sensor_msgs/msg/Image"),
        ("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray"),
        ("/laser_profiler/annotations", "foxglove_msgs/msg/ImageAnnotations"),
        ("/laser_profiler/height_map", "sensor_msgs/msg/Image"),
        ("/laser_profiler/points_dense", "sensor_msgs/msg/PointCloud2"),
        ("/laser_profiler/profile", "laser_profiler_msgs/msg/Profile"),
        ("/laser_profiler/stream_status", "laser_profiler_msgs/msg/StreamStatus"),
    ] {
        assert_eq!(topics[topic], kind, "{seen}");
    }
    // The centreline is green, over a grey image some 600 pixels wide.
    assert!(pixels(&seen, "ImageViewPanel!overlay", &[120]) > 500, "{seen}");
    assert!(pixels(&seen, "Plot!profile", &[210]) > 500, "{seen}");
    // Film, bubbles and rim of the cell are of different colours; bare, the panel has the few pixels of its axes.
    let colors: [&[u32]; 4] = [&[0, 30], &[60], &[90], &[120]];
    for hues in colors {
        assert!(pixels(&seen, "3D!cloud", hues) > 500, "{hues:?}: {seen}");
        assert!(pixels(&seen, "3D!from_above", hues) > 500, "{hues:?}: {seen}");
    }
    let health = seen["panels"]["DiagnosticSummary!health"]["text"].as_str().unwrap();
    assert!(health.contains("frames were lost"), "{health}");
}

/// The check sees what is missing, and so does a user: the panel names the topic.
#[test]
fn without_images_foxglove_says_so_and_shows_the_rest() {
    let Some(tools) = tools() else { return };
    let directory = tempfile::tempdir().unwrap();
    let bag = results(&directory.path().join("results"), &[]);
    let seen = foxglove(tools, &bag, "2.6", &picture("foxglove_without_images.png"));
    assert!(seen["topics"].get("/camera/image_raw").is_none(), "{seen}");
    let overlay = seen["panels"]["ImageViewPanel!overlay"]["text"].as_str().unwrap();
    assert!(overlay.contains("/camera/image_raw"), "{overlay}");
    assert!(pixels(&seen, "ImageViewPanel!overlay", &[120]) < 20, "{seen}");
    assert!(pixels(&seen, "3D!cloud", &[60, 90]) > 500, "{seen}");
}
