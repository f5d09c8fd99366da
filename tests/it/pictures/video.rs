//! Videos give the lines of their frames.

use std::{
    ffi::OsStr,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use crate::program::{end, laser_profiler, replay, skip};

use super::{
    RATE,
    render::{Kind, NUM, Scene, lines, stamp_ns, write},
};

/// False, and a message, if videos cannot be made.
fn can_make_videos() -> bool {
    let is_there = Command::new("ffmpeg").arg("-version").output().is_ok();
    if !is_there {
        assert!(std::env::var_os("CI").is_none(), "CI skips nothing: ffmpeg is not installed");
        skip("videos", "ffmpeg is not installed");
    }
    is_there
}

fn ffmpeg(arguments: impl IntoIterator<Item = impl AsRef<OsStr>>) {
    let mut command = Command::new("ffmpeg");
    let ended = end(command.args(["-v", "error"]).args(arguments));
    assert_eq!(ended.code, Some(0), "{ended:?}");
}

/// Makes a video of pictures in a folder, beside it.
fn video(folder: &Path, arguments: &[&str], name: &str) -> PathBuf {
    let path = folder.with_file_name(name);
    let pictures = folder.join("frame_%d.png");
    let input = ["-framerate", "50", "-start_number", "0", "-i"].map(OsStr::new);
    let coded = arguments.iter().map(OsStr::new);
    ffmpeg(input.into_iter().chain([pictures.as_os_str()]).chain(coded).chain([path.as_os_str()]));
    path
}

/// Writes the pictures of a scene.
fn pictures(folder: &Path, scene: Scene) {
    fs::create_dir(folder).unwrap();
    for number in 0..NUM {
        write(&folder.join(Kind::Png.name(number)), Kind::Png, &scene.picture(number));
    }
}

#[test]
fn a_video_gives_the_lines_of_its_frames() {
    if !can_make_videos() {
        return;
    }
    for (scene, arguments, name) in [
        (Scene::Grey, &["-c:v", "ffv1", "-pix_fmt", "gray"][..], "grey.mkv"),
        (Scene::Deep, &["-c:v", "ffv1", "-pix_fmt", "gray16le"], "deep.mkv"),
        (Scene::Color, &["-c:v", "png"], "color.mov"),
        (Scene::Grey, &["-c:v", "rawvideo", "-pix_fmt", "gray"], "raw.avi"),
    ] {
        let place = tempfile::tempdir().unwrap();
        let path = |name: &str| place.path().join(name);
        pictures(&path("scan"), scene);
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
    }
}

#[test]
fn a_video_that_is_cut_off_gives_its_complete_frames_and_tells_the_loss() {
    if !can_make_videos() {
        return;
    }
    let cut = "is damaged or cut off";
    let short = "bytes are missing at its end";
    // The last figure is the fewest frames at two thirds of the file; containers differ in the size of their heads.
    for (scene, arguments, name, told, fewest) in [
        (Scene::Grey, &["-c:v", "ffv1", "-pix_fmt", "gray"][..], "grey.mkv", cut, NUM / 3),
        (Scene::Deep, &["-c:v", "ffv1", "-pix_fmt", "gray16le"], "deep.mkv", cut, NUM / 3),
        (Scene::Grey, &["-c:v", "rawvideo", "-pix_fmt", "gray"], "raw.avi", short, NUM / 3),
        (Scene::Grey, &["-c:v", "mjpeg", "-q:v", "1"], "jpeg.avi", short, 1),
        (Scene::Grey, &["-c:v", "png", "-movflags", "+faststart"], "front.mov", cut, 1),
        (Scene::Color, &["-c:v", "png"], "behind.mov", "moov atom not found", 0),
    ] {
        let place = tempfile::tempdir().unwrap();
        let path = |name: &str| place.path().join(name);
        pictures(&path("scan"), scene);
        let video = video(&path("scan"), arguments, name);
        let whole = fs::read(&video).unwrap();
        for (sixths, fewest) in [(3, 1), (4, fewest), (5, fewest)] {
            fs::write(&video, &whole[..whole.len() * sixths / 6]).unwrap();
            let mut command = laser_profiler(&["replay", "--force", "-o"]);
            let ended = end(command.arg(path("cut")).arg(&video));
            assert!(ended.stderr.contains(told), "{name}, {told:?}: {ended:?}");
            // The index is at the end of the file.
            let has_index = name != "behind.mov";
            assert_eq!(ended.code, Some(if has_index { 3 } else { 1 }), "{name}: {ended:?}");
            if has_index {
                let lines = lines(&path("cut"));
                assert!((fewest..NUM).contains(&lines.len()), "{name}: {}", lines.len());
                for (number, line) in lines.iter().enumerate() {
                    assert!(line.error_px(scene, number) < 0.4, "{name} {number}");
                }
            }
        }
    }
}

#[test]
fn a_trimmed_video_has_the_frames_and_times_that_a_player_shows() {
    if !can_make_videos() {
        return;
    }
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    pictures(&path("scan"), Scene::Grey);
    let coded = ["-c:v", "mpeg4", "-g", "4", "-bf", "2", "-q:v", "1"];
    let whole = video(&path("scan"), &coded, "whole.mp4");
    // The copy keeps the packets from the key frame before on, and a list of edits leaves out their frames.
    let [whole, trimmed] = [whole, path("trimmed.mp4")].map(PathBuf::into_os_string);
    let from = ["-ss", "0.13", "-i"].map(OsStr::new);
    let copied = ["-c", "copy"].map(OsStr::new);
    ffmpeg(from.into_iter().chain([&*whole]).chain(copied).chain([&*trimmed]));
    replay(&path("trimmed.mp4"), &path("results"), 0, &[]);
    let lines = lines(&path("results"));
    assert_eq!(lines.len(), NUM - 7);
    for (index, line) in lines.iter().enumerate() {
        assert!(line.error_px(Scene::Grey, index + 7) < 0.4, "{index}");
        assert_eq!(line.stamp_ns, stamp_ns(index), "{index}");
    }
}

#[test]
fn times_that_do_not_increase_are_replaced_and_that_is_told() {
    if !can_make_videos() {
        return;
    }
    let twice = ["-vf", "setpts=floor(N/2)/50/TB", "-vsync", "passthrough", "-c:v", "ffv1"];
    for (arguments, name) in
        [(&twice[..], "twice.mkv"), (&["-c:v", "mpeg4", "-bf", "2", "-q:v", "1"], "unstated.avi")]
    {
        let place = tempfile::tempdir().unwrap();
        let path = |name: &str| place.path().join(name);
        pictures(&path("scan"), Scene::Grey);
        let video = video(&path("scan"), arguments, name);
        let told = "does not state a time for every frame that is later than the one before";
        let (_, stderr) = replay(&video, &path("results"), 0, &[]);
        assert!(stderr.contains(told) && stderr.contains("Hz, its mean rate"), "{name}: {stderr}");
        let found = lines(&path("results"));
        assert_eq!(found.len(), NUM, "{name}");
        let steps_ns: Vec<_> =
            found.windows(2).map(|pair| pair[1].stamp_ns - pair[0].stamp_ns).collect();
        assert!(steps_ns.iter().all(|step_ns| (step_ns - steps_ns[0]).abs() <= 1), "{steps_ns:?}");
        let (_, stderr) = replay(&video, &path("at_a_rate"), 0, &RATE);
        assert!(!stderr.contains(told), "{name}: {stderr}");
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
