//! A third-party viewer in a real browser: Foxglove 1.48, the last open version, in Chromium. See `tests/browser`.
//!
//! The pictures that it takes stay in `target/browser`.

use std::{
    collections::HashSet,
    env, fs,
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
};

use serde_json::{Value as Json, json};

use crate::{
    program::{Ended, end, laser_profiler, replay, skip},
    recordings::bundled,
};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Tools that the checks need.
#[derive(Debug)]
pub(crate) struct Tools {
    /// Directory of the JavaScript packages.
    modules: PathBuf,
    chromium: PathBuf,
}

/// Chromium and the pinned packages, installed once and kept for the next run; `None` after reporting the missing ones.
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

/// Returns the first of the named programs that is in `PATH`.
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

/// Returns the path of a picture; creates its directory.
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

/// The shipped file for the viewers.
fn viewers() -> PathBuf {
    Path::new(ROOT).join("launch_configs/viewers")
}

/// Plays some seconds of a recording in Foxglove and returns the findings.
pub(crate) fn foxglove(tools: &Tools, source: &Path, seconds: &str, name: &str) -> Json {
    let is_live = source.starts_with("ws:");
    let layout = if is_live { "foxglove_live_layout.json" } else { "foxglove_layout.json" };
    let (layout, picture) = (viewers().join(layout), picture(name));
    let arguments = [
        ("source", source),
        ("layout", &layout),
        ("seconds", Path::new(seconds)),
        ("picture", &picture),
    ];
    let ended = check(tools, "foxglove.mjs", &arguments);
    assert_eq!(ended.code, Some(0), "{}\n{}", ended.stdout, ended.stderr);
    serde_json::from_str(&ended.stdout).unwrap()
}

/// Pixels of a panel in the colours within 15 degrees of some hues.
pub(crate) fn pixels(seen: &Json, panel: &str, hues: &[u32]) -> u64 {
    let hues = hues.iter().map(|hue| &seen["panels"][panel]["hues"][hue.to_string()]);
    hues.map(|count| count.as_u64().unwrap_or(0)).sum()
}

/// The results of the bundled film, as a file.
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
    let seen = foxglove(tools, &bag, "5.2", "foxglove.png");

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

/// The check detects a missing topic, and so does a user: the panel names it.
#[test]
fn foxglove_reports_missing_images_and_shows_the_rest() {
    let Some(tools) = tools() else { return };
    let directory = tempfile::tempdir().unwrap();
    let bag = results(&directory.path().join("results"), &[]);
    let seen = foxglove(tools, &bag, "2.6", "foxglove_without_images.png");
    assert!(seen["topics"].get("/camera/image_raw").is_none(), "{seen}");
    let overlay = seen["panels"]["ImageViewPanel!overlay"]["text"].as_str().unwrap();
    assert!(overlay.contains("/camera/image_raw"), "{overlay}");
    assert!(pixels(&seen, "ImageViewPanel!overlay", &[120]) < 20, "{seen}");
    assert!(pixels(&seen, "3D!cloud", &[60, 90]) > 500, "{seen}");
}

/// The page of `report` has no errors, sends no network requests, and its sections follow the pointer.
#[test]
fn the_report_follows_the_pointer() {
    let Some(tools) = tools() else { return };
    let directory = tempfile::tempdir().unwrap();
    let bag = results(&directory.path().join("results"), &["--with-images"]);
    let page = directory.path().join("report.html");
    let mut command = laser_profiler(&["report", "-o"]);
    let ended = end(command.arg(&page).arg(&bag));
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let ended = check(tools, "report.mjs", &[("page", &page), ("picture", &picture("report.png"))]);
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let seen: Json = serde_json::from_str(&ended.stdout).unwrap();

    assert_eq!(seen["errors"], Json::Array(Vec::new()), "{seen}");
    assert_eq!((&seen["drawn"], &seen["requests"]), (&"yes".into(), &1.into()), "{seen}");
    let points = seen["points"].as_array().unwrap();
    let reported = |key: &str| {
        let all: HashSet<_> = points.iter().map(|point| point[key].to_string()).collect();
        all.len()
    };
    assert!(reported("readout") > points.len() / 2, "{seen}");
    assert!(reported("sections") > points.len() / 2, "{seen}");
    // The highest place is the bubble of 0.8 mm that the scenario puts at (-6, 17) mm; pointed at every 2 to 3 mm.
    let heights = points.iter().map(|point| millimetres(point["readout"].as_str().unwrap()));
    let [x, y, z] = heights.max_by(|a, b| a[2].total_cmp(&b[2])).unwrap();
    assert!((x + 6.0).abs() < 3.0 && (y - 17.0).abs() < 3.0, "{x} {y} {z}");
    assert!((6.5..7.1).contains(&z), "{z}");
}

/// Three lengths out of `x 1.2 mm · y 3.4 mm · z 5.6 mm · …`.
fn millimetres(readout: &str) -> [f64; 3] {
    let words: Vec<_> = readout.split(' ').collect();
    let length = |axis: &str| {
        let at = words.iter().position(|word| *word == axis).unwrap();
        assert_eq!(words[at + 2], "mm", "{readout}");
        words[at + 1].parse().unwrap()
    };
    ["x", "y", "z"].map(length)
}

/// The common parts of the two layouts stay equal.
#[test]
fn the_live_layout_differs_in_the_image_and_the_open_tab() {
    let layout = |name: &str| -> Json {
        let text = fs::read_to_string(viewers().join(name));
        serde_json::from_str(&text.unwrap()).unwrap()
    };
    let mut expected = layout("foxglove_layout.json");
    expected["configById"]["Image!overlay"]["imageMode"] = json!({
        "imageTopic": "/laser_profiler/preview",
        "annotations": { "/laser_profiler/preview_annotations": { "visible": true } },
    });
    expected["configById"]["Tab!state"]["activeTabIdx"] = 2.into();
    assert_eq!(layout("foxglove_live_layout.json"), expected);
}
