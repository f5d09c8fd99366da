//! Folders of pictures, files and patterns replay like a recording of the same frames.

mod bad;
mod import;
mod render;
mod video;

use std::fs;

use laser_profiler::msg::{schema::Message, sensor_msgs::JointState};

use crate::{
    program::{end, laser_profiler, replay},
    recordings::{record, record_images, topic},
};
use render::{Kind, NUM, PERIOD_NS, Scene, lines, message, position_message, stamp_ns, write};

/// The rate of the pictures as an option.
const RATE: [&str; 2] = ["--frame-rate", "50"];

#[test]
fn every_kind_of_file_gives_the_lines_of_the_same_frames_in_a_bag() {
    for kind in Kind::ALL {
        for scene in Scene::ALL.into_iter().filter(|scene| kind.holds(*scene)) {
            let place = tempfile::tempdir().unwrap();
            let path = |name: &str| place.path().join(name);
            fs::create_dir(path("pictures")).unwrap();
            let messages: Vec<_> = (0..NUM)
                .map(|number| {
                    let file = path("pictures").join(kind.name(number));
                    write(&file, kind, &scene.picture(number));
                    // The pixels as another decoder reads them back: JPEG loses some.
                    message(&image::open(&file).unwrap(), number)
                })
                .collect();
            record_images(&path("bag"), &messages);
            let (from_bag, _) = replay(&path("bag"), &path("of_bag"), 0, &["--force"]);
            let (from_files, _) = replay(&path("pictures"), &path("of_files"), 0, &RATE);
            let counts = |summary: &serde_json::Value| {
                (summary["frames"]["processed"].clone(), summary["points"].clone())
            };
            assert_eq!(counts(&from_bag), counts(&from_files), "{kind:?} {scene:?}");
            let (expected, found) = (lines(&path("of_bag")), lines(&path("of_files")));
            assert_eq!(expected.len(), NUM, "{kind:?} {scene:?}");
            for (number, (expected, found)) in expected.iter().zip(&found).enumerate() {
                assert_eq!(expected.points, found.points, "{kind:?} {scene:?} {number}");
                assert_eq!(found.stamp_ns, stamp_ns(number), "n / 50 s, counted from 1");
                let error_px = found.error_px(scene, number);
                let limit_px = if kind == Kind::Jpeg { 0.4 } else { 0.1 };
                assert!(error_px < limit_px, "{kind:?} {scene:?} {number}: {error_px} px");
            }
        }
    }
}

#[test]
fn files_folders_and_patterns_are_read_in_natural_order() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    fs::create_dir(path("scan")).unwrap();
    // Lexically, img10 comes before img2.
    let names: Vec<_> = (0..NUM).map(|number| format!("scan/img{}.png", number + 1)).collect();
    for (number, name) in names.iter().enumerate() {
        write(&path(name), Kind::Png, &Scene::Grey.picture(number));
    }
    let mut lexical = names.clone();
    lexical.sort();
    assert_ne!(lexical, names, "the test needs names that sort differently");
    let pattern = "scan/img*.png".to_owned();
    for (case, inputs) in
        [("folder", vec!["scan".to_owned()]), ("files", lexical), ("pattern", vec![pattern])]
    {
        let mut command = laser_profiler(&["replay", "-o"]);
        let results = path(case);
        command.arg(&results).args(inputs.iter().map(|name| path(name))).args(RATE);
        let ended = end(&mut command);
        assert_eq!(ended.code, Some(0), "{case}: {ended:?}");
        let lines = lines(&results);
        assert_eq!(lines.len(), NUM, "{case}");
        for (number, line) in lines.iter().enumerate() {
            assert!(line.error_px(Scene::Grey, number) < 0.1, "{case} {number}");
            assert_eq!(line.stamp_ns, stamp_ns(number), "{case}");
        }
    }
    let info = end(&mut laser_profiler(&["info", &path("files").display().to_string()]));
    assert!(info.stdout.contains("input: img1.png to img12.png"), "{}", info.stdout);
    let info = end(&mut laser_profiler(&["info", &path("folder").display().to_string()]));
    assert!(info.stdout.contains("input: scan\n"), "{}", info.stdout);
}

/// A calibration: 0.1 mm a row.
const CALIBRATION: &str = "type: vertical_incidence\nframe_id: laser\nimage_distance_m: 0.05\nobject_distance_m: 0.5\n\
                           beta_rad: 0.6\npixel_pitch_m: 5.0e-6\nbase_row_px: 24.0\ncenter_column_px: 80.0\nheight_sign: -1\n";

#[test]
fn a_table_of_stamps_and_positions_gives_the_scan_of_a_bag_with_joint_states() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    fs::create_dir(path("scan")).unwrap();
    fs::write(path("rig.yaml"), CALIBRATION).unwrap();
    let calibration = format!("calibration_file:={}", path("rig.yaml").display());
    let mut images = Vec::new();
    let mut joints = Vec::new();
    // Unequal steps in time and place; the names tell another order.
    let time_ns = |number: usize| stamp_ns(number) + (number * number) as i64 * PERIOD_NS / 10;
    let position_m = |number: usize| 0.001 * number as f64 + 0.0003 * (number % 3) as f64;
    let mut table = String::from("file,operator,stamp_s,position\n");
    for number in 0..NUM {
        let name = format!("{:03}.png", (7 * number) % NUM);
        let file = path("scan").join(&name);
        write(&file, Kind::Png, &Scene::Grey.picture(number));
        let (seconds, rest) = (time_ns(number) / 1_000_000_000, time_ns(number) % 1_000_000_000);
        table.insert_str(
            table.find('\n').unwrap() + 1,
            &format!("{name},me,{seconds}.{rest:09},{}\n", position_m(number)),
        );
        images.push(render::message_at(&image::open(&file).unwrap(), time_ns(number)));
        joints.push(position_message(time_ns(number), position_m(number)));
    }
    fs::write(path("positions.csv"), table).unwrap();
    let names = [
        topic("/image_raw", laser_profiler::msg::sensor_msgs::Image::TYPE),
        topic("/joint_states", JointState::TYPE),
    ];
    render::record_both(&path("bag"), &names, &images, &joints, time_ns);
    let stated = path("positions.csv").display().to_string();
    let common = ["--ros-args", "-p", &calibration];
    let from_files = [&["--positions", &stated][..], &common].concat();
    let from_bag = [&common[..], &["-p", "motion.source:=joint_state"]].concat();
    let (of_files, _) = replay(&path("scan"), &path("of_files"), 0, &from_files);
    let (of_bag, _) = replay(&path("bag"), &path("of_bag"), 0, &from_bag);
    assert_eq!(of_files["positions"]["known"], NUM, "{of_files}");
    assert_eq!(of_files["positions"], of_bag["positions"]);
    let clouds = [path("of_files"), path("of_bag")].map(|results| render::clouds(&results));
    assert!(!clouds[0].is_empty() && clouds[0] == clouds[1], "the points of the scan");
}

#[test]
fn a_velocity_needs_stamps_and_a_step_does_not() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    fs::create_dir(path("scan")).unwrap();
    fs::write(path("rig.yaml"), CALIBRATION).unwrap();
    for number in 0..NUM {
        write(&path("scan").join(format!("{number}.pgm")), Kind::Pgm, &Scene::Grey.picture(number));
    }
    let calibration = format!("calibration_file:={}", path("rig.yaml").display());
    let run = |name: &str, motion: &str, more: &[&str]| {
        let mut command = laser_profiler(&["replay", "-o"]);
        command.arg(path(name)).arg(path("scan")).args(more);
        let ros = ["--ros-args", "-p", &calibration, "-p", "motion.source:=constant", "-p", motion];
        end(command.args(ros))
    };
    let refused = run("refused", "motion.velocity:=0.01", &[]);
    assert_eq!(refused.code, Some(2), "{refused:?}");
    assert!(refused.stderr.contains("give --frame-rate HZ"), "{refused:?}");
    assert!(!path("refused").exists());
    let at_a_rate = run("at_a_rate", "motion.velocity:=0.01", &["--frame-rate", "50"]);
    let by_index = run("by_index", "motion.step:=0.0002", &[]);
    assert_eq!((at_a_rate.code, by_index.code), (Some(0), Some(0)), "{at_a_rate:?} {by_index:?}");
    // 0.01 m/s at 50 Hz are 0.2 mm a frame.
    let heights = |name: &str| render::profile_positions(&path(name));
    let (found, expected) = (heights("at_a_rate"), heights("by_index"));
    assert_eq!(found.len(), NUM);
    for (number, (found, expected)) in found.iter().zip(&expected).enumerate() {
        assert!((found - 0.0002 * number as f64).abs() < 1e-9, "{number}: {found}");
        assert!((expected - 0.0002 * number as f64).abs() < 1e-9, "{number}: {expected}");
    }
}

#[test]
fn options_of_pictures_are_refused_for_recordings() {
    let place = tempfile::tempdir().unwrap();
    let bag = place.path().join("bag");
    record(
        &bag,
        &[topic("/image_raw", laser_profiler::msg::sensor_msgs::Image::TYPE)],
        &[crate::recordings::image(0, |_| {})],
    );
    let mut command = laser_profiler(&["replay", "--frame-rate", "20", "-o"]);
    let ended = end(command.arg(place.path().join("out")).arg(&bag));
    assert_eq!(ended.code, Some(2), "{ended:?}");
    assert!(ended.stderr.contains("which have stamps of their own"), "{ended:?}");
}

#[test]
fn pictures_without_stamps_have_no_rate_in_their_description() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name).display().to_string();
    fs::create_dir(path("scan")).unwrap();
    let mut bytes = 0;
    for number in 0..NUM {
        let file = place.path().join("scan").join(Kind::Png.name(number));
        write(&file, Kind::Png, &Scene::Grey.picture(number));
        bytes += fs::metadata(&file).unwrap().len();
    }
    let imported = end(&mut laser_profiler(&["import", &path("scan"), "-o", &path("bag")]));
    assert_eq!(imported.code, Some(0), "{imported:?}");
    for name in ["scan", "bag"] {
        let info = end(&mut laser_profiler(&["info", "--json", &path(name)]));
        let info: serde_json::Value = serde_json::from_str(&info.stdout).unwrap();
        assert_eq!(info["stamps_assumed"], true, "{name}: {info}");
        let topic = &info["topics"][0];
        for value in [&topic["rate_hz"], &topic["largest_gap_s"], &topic["image"]["stamp_rate_hz"]]
        {
            assert!(value.is_null(), "{name}: {info}");
        }
        assert_eq!(topic["messages"], NUM);
        if name == "scan" {
            assert_eq!(info["bytes"], bytes);
        }
        let text = end(&mut laser_profiler(&["info", &path(name)])).stdout;
        assert!(text.contains("an assumed rate of 10 Hz"), "{name}: {text}");
        assert!(!text.contains("10.000"), "{name}: {text}");
    }
    let options = ["import", "--frame-rate", "50", "-o"];
    let mut command = laser_profiler(&options);
    assert_eq!(end(command.args([path("at_a_rate"), path("scan")])).code, Some(0));
    let info = end(&mut laser_profiler(&["info", "--json", &path("at_a_rate")]));
    let info: serde_json::Value = serde_json::from_str(&info.stdout).unwrap();
    assert_eq!(info["stamps_assumed"], false, "{info}");
    let rate_hz = info["topics"][0]["rate_hz"].as_f64().unwrap();
    assert!((rate_hz - 50.0).abs() < 1e-6, "{info}");
}

/// A camera that looks straight down, and light inclined by 30 degrees.
const INCLINED: &str = "type: camera_and_plane
camera_name: camera
image_width: 160
image_height: 48
camera_matrix: {rows: 3, cols: 3, data: [300.0, 0.0, 80.0, 0.0, 300.0, 24.0, 0.0, 0.0, 1.0]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.0, 0.0, 0.0, 0.0, 0.0]}
frame_id: laser_plane
laser_plane: {normal: [0.0, 0.8660254037844386, 0.5], distance_m: 0.15}
";

#[test]
fn a_camera_and_a_plane_without_an_axis_are_told() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    fs::create_dir(path("scan")).unwrap();
    for number in 0..NUM {
        write(&path("scan").join(Kind::Png.name(number)), Kind::Png, &Scene::Grey.picture(number));
    }
    let axis = "axis: {kind: prismatic, direction: [0.0, 1.0, 0.0], scale: 1.0}\n";
    let moved = ["motion.source:=constant", "motion.step:=0.001"];
    for (case, rig, motion, is_told) in [
        ("no axis", INCLINED.to_owned(), &moved[..], true),
        ("no motion", INCLINED.to_owned(), &[], false),
        ("an axis", format!("{INCLINED}{axis}"), &moved, false),
    ] {
        fs::write(path("rig.yaml"), rig).unwrap();
        let calibration = format!("calibration_file:={}", path("rig.yaml").display());
        let mut arguments = vec!["--force", "--ros-args", "-p", &calibration];
        arguments.extend(motion.iter().flat_map(|value| ["-p", value]));
        let (_, stderr) = replay(&path("scan"), &path("results"), 0, &arguments);
        assert_eq!(stderr.contains("the calibration has no axis"), is_told, "{case}: {stderr}");
    }
}
