//! A recording made of pictures gives the results of the pictures; videos give those of their frames.

use std::{fmt::Write as _, fs, path::Path, process::Command};

use laser_profiler::bag::{BagReader, Filter, RawMessage, ReadOptions};

use crate::program::{end, laser_profiler, replay, skip};

use super::{
    CALIBRATION, RATE,
    render::{Kind, NUM, Scene, lines, write},
};

fn all(results: &Path) -> Vec<RawMessage> {
    let reader = BagReader::open(results, &ReadOptions::default()).unwrap();
    reader.messages(&Filter::all()).map(Result::unwrap).collect()
}

#[test]
fn a_replay_of_the_recording_gives_the_bytes_of_a_replay_of_the_pictures() {
    for kind in Kind::ALL {
        for (case, with_positions) in [("rate", false), ("positions", true)] {
            let place = tempfile::tempdir().unwrap();
            let path = |name: &str| place.path().join(name);
            fs::create_dir(path("scan")).unwrap();
            fs::write(path("rig.yaml"), CALIBRATION).unwrap();
            let mut table = "file,stamp_s,position\n".to_owned();
            for number in 0..NUM {
                write(&path("scan").join(kind.name(number)), kind, &Scene::Grey.picture(number));
                let seconds = 0.02 * (number + 1) as f64;
                let position_m = 0.0005 * number as f64;
                writeln!(table, "{},{seconds},{position_m}", kind.name(number)).unwrap();
            }
            fs::write(path("t.csv"), table).unwrap();
            let stated = path("t.csv").display().to_string();
            let options = if with_positions { ["--positions", &stated] } else { RATE };
            let calibration = format!("calibration_file:={}", path("rig.yaml").display());
            let ros = ["--ros-args", "-p", &calibration];
            replay(&path("scan"), &path("of_pictures"), 0, &[&options[..], &ros].concat());
            let mut command = laser_profiler(&["import", "--json", "-o"]);
            let ended = end(command.arg(path("bag")).arg(path("scan")).args(options));
            assert_eq!(ended.code, Some(0), "{kind:?} {case}: {ended:?}");
            let told: serde_json::Value = serde_json::from_str(&ended.stdout).unwrap();
            assert_eq!((&told["pictures"], &told["left_out"]), (&NUM.into(), &0.into()), "{told}");
            replay(&path("bag"), &path("of_bag"), 0, &ros);
            let [expected, found] = ["of_pictures", "of_bag"].map(|name| all(&path(name)));
            assert!(expected.len() > 3 * NUM, "{kind:?} {case}");
            assert!(expected == found, "{kind:?} {case}: the results differ");
        }
    }
}

/// The original bytes are in the recording.
#[test]
fn files_are_copied_byte_by_byte() {
    for kind in [Kind::Png, Kind::Jpeg, Kind::Tiff] {
        let place = tempfile::tempdir().unwrap();
        let path = |name: &str| place.path().join(name);
        write(&path(&kind.name(1)), kind, &Scene::Color.picture(1));
        let mut command = laser_profiler(&["import", "-o"]);
        let ended = end(command.arg(path("bag")).arg(path(&kind.name(1))));
        assert_eq!(ended.code, Some(0), "{ended:?}");
        let file = fs::read(path(&kind.name(1))).unwrap();
        assert!(all(&path("bag"))[0].data.ends_with(&file), "{kind:?}");
    }
}

#[test]
fn pictures_that_cannot_be_used_are_left_out_by_name() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    fs::create_dir(path("scan")).unwrap();
    for number in 0..NUM {
        write(&path("scan").join(Kind::Png.name(number)), Kind::Png, &Scene::Grey.picture(number));
    }
    fs::write(path("scan/frame_3.png"), "text").unwrap();
    write(&path("scan/frame_7.png"), Kind::Png, &image::DynamicImage::new_luma8(9, 9));
    let mut command = laser_profiler(&["import", "-o"]);
    let ended = end(command.arg(path("bag")).arg(path("scan")));
    assert_eq!(ended.code, Some(3), "{ended:?}");
    for told in
        ["frame_3.png: is no picture", "frame_7.png: has 9 x 9 pixels", "10 pictures", "2 left out"]
    {
        assert!(ended.stdout.contains(told), "{told}: {ended:?}");
    }
    // The motion by velocity is refused for the recording as for the pictures: their times are not known.
    let mut command = laser_profiler(&["replay", "-o"]);
    let motion = ["--ros-args", "-p", "motion.source:=constant", "-p", "motion.velocity:=0.1"];
    let ended = end(command.arg(path("results")).arg(path("bag")).args(motion));
    assert_eq!(ended.code, Some(2), "{ended:?}");
    for (input, reason, code) in
        [("bag", "recordings need no import", 1), ("nothing", "No such file", 1)]
    {
        let mut command = laser_profiler(&["import", "-o"]);
        let ended = end(command.arg(path("again")).arg(path(input)));
        assert_eq!(ended.code, Some(code), "{ended:?}");
        assert!(ended.stderr.contains(reason), "{ended:?}");
    }
}

/// Makes a video with an encoder that loses nothing.
fn video(folder: &Path, arguments: &[&str], name: &str) -> std::path::PathBuf {
    let path = folder.with_file_name(name);
    let mut command = Command::new("ffmpeg");
    command.args(["-v", "error", "-framerate", "50", "-start_number", "0", "-i"]);
    command.arg(folder.join("frame_%d.png")).args(arguments).arg(&path);
    let ended = end(&mut command);
    assert_eq!(ended.code, Some(0), "{ended:?}");
    path
}

#[test]
fn a_video_gives_the_lines_of_its_frames() {
    if Command::new("ffmpeg").arg("-version").output().is_err() {
        return skip("videos", "ffmpeg is not installed");
    }
    for (scene, arguments, name) in [
        (Scene::Grey, &["-c:v", "ffv1", "-pix_fmt", "gray"][..], "grey.mkv"),
        (Scene::Deep, &["-c:v", "ffv1", "-pix_fmt", "gray16le"], "deep.mkv"),
        (Scene::Color, &["-c:v", "png"], "color.mov"),
        (Scene::Grey, &["-c:v", "rawvideo", "-pix_fmt", "gray"], "raw.avi"),
    ] {
        let place = tempfile::tempdir().unwrap();
        let path = |name: &str| place.path().join(name);
        fs::create_dir(path("scan")).unwrap();
        for number in 0..NUM {
            write(&path("scan").join(Kind::Png.name(number)), Kind::Png, &scene.picture(number));
        }
        let video = video(&path("scan"), arguments, name);
        replay(&path("scan"), &path("of_pictures"), 0, &RATE);
        replay(&video, &path("of_video"), 0, &[]);
        let [expected, found] = ["of_pictures", "of_video"].map(|name| lines(&path(name)));
        assert_eq!((expected.len(), found.len()), (NUM, NUM), "{name}");
        for (number, (expected, found)) in expected.iter().zip(&found).enumerate() {
            assert_eq!(expected.points, found.points, "{name} {number}");
            assert!((expected.stamp_ns - found.stamp_ns).abs() < 1_000_001, "{name}: {found:?}");
        }
        // A rate replaces the times of the file.
        replay(&video, &path("faster"), 0, &["--frame-rate", "1000"]);
        let stamps: Vec<_> = lines(&path("faster")).iter().map(|line| line.stamp_ns).collect();
        assert_eq!(stamps, (1..=NUM as i64).map(|number| number * 1_000_000).collect::<Vec<_>>());
        cut_off(&video, &path("cut"), name);
    }
}

/// A video that ends early gives its complete frames, and says what is missing.
fn cut_off(video: &Path, results: &Path, name: &str) {
    let whole = fs::read(video).unwrap();
    fs::write(video, &whole[..whole.len() * 2 / 3]).unwrap();
    let mut command = laser_profiler(&["replay", "-o"]);
    let ended = end(command.arg(results).arg(video));
    // Without its index at the end, a .mov file has no frames.
    let is_mov = video.extension().is_some_and(|extension| extension == "mov");
    let codes = if is_mov { [1, 1] } else { [0, 3] };
    assert!(codes.contains(&ended.code.unwrap()), "{name}: {ended:?}");
    if ended.code != Some(1) {
        let num = lines(results).len();
        assert!((NUM / 3..NUM).contains(&num), "{name}: {num} frames, {ended:?}");
    }
}

#[test]
fn without_ffmpeg_the_command_that_installs_it_is_told() {
    let place = tempfile::tempdir().unwrap();
    for name in ["a.mp4", "b.AVI", "c.mkv"] {
        let video = place.path().join(name);
        fs::write(&video, "no video").unwrap();
        let mut command = laser_profiler(&["replay", "-o"]);
        let ended =
            end(command.arg(place.path().join("out")).arg(&video).env("PATH", place.path()));
        assert_eq!(ended.code, Some(1), "{ended:?}");
        assert!(ended.stderr.contains("sudo apt install ffmpeg"), "{ended:?}");
        let missing = video.with_extension("none.mp4");
        let mut command = laser_profiler(&["replay", "-o"]);
        let ended = end(command.arg(place.path().join("out")).arg(&missing));
        assert!(ended.stderr.contains("No such file"), "{ended:?}");
    }
}
