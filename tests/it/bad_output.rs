//! Outputs that already exist, are not writable, or do not fit on the disk.

use std::{fs, os::unix::fs::symlink, path::Path};

use crate::{
    program::{content, end, laser_profiler, limited},
    recordings::{bundled, good_images, record_images},
};

/// Recorded into `directory`.
fn input(directory: &Path) -> String {
    let input = directory.join("in");
    record_images(&input, &good_images(3));
    input.display().to_string()
}

#[test]
fn an_output_that_is_there_is_kept() {
    let directory = tempfile::tempdir().unwrap();
    let input = input(directory.path());
    let output = directory.path().join("out");
    let replay = |arguments: &[&str]| {
        let mut command = laser_profiler(&["replay", &input, "-o"]);
        end(command.arg(&output).args(arguments))
    };
    assert_eq!(replay(&[]).code, Some(0));
    let first = content(&output);

    let again = replay(&["--ros-args", "-p", "extraction.blur_radius:=0"]);
    assert_eq!(again.code, Some(1), "{again:?}");
    assert!(again.stderr.contains(&output.display().to_string()), "{again:?}");
    assert!(again.stderr.contains("--force"), "{again:?}");
    assert_eq!(content(&output), first, "untouched");

    fs::write(output.join("notes.txt"), "not ours").unwrap();
    assert_eq!(replay(&["--force"]).code, Some(0));
    assert_eq!(fs::read_to_string(output.join("notes.txt")).unwrap(), "not ours");
    fs::remove_file(output.join("notes.txt")).unwrap();
    assert_eq!(content(&output), first, "replaced by the same");
}

#[test]
fn force_replaces_only_bags() {
    let directory = tempfile::tempdir().unwrap();
    let input = input(directory.path());
    let thesis = directory.path().join("thesis");
    fs::create_dir(&thesis).unwrap();
    fs::write(thesis.join("chapter1.tex"), "years").unwrap();
    let file = directory.path().join("file");
    fs::write(&file, "text").unwrap();
    for output in [&thesis, &file] {
        let ended = end(laser_profiler(&["replay", &input, "--force", "-o"]).arg(output));
        assert_eq!(ended.code, Some(1), "{ended:?}");
        assert!(ended.stderr.contains("not a bag"), "{ended:?}");
    }
    assert_eq!(content(&thesis), [("chapter1.tex".to_owned(), b"years".to_vec())]);
    assert_eq!(fs::read_to_string(&file).unwrap(), "text");
}

#[test]
fn force_follows_no_links() {
    let directory = tempfile::tempdir().unwrap();
    let input = input(directory.path());
    let elsewhere = directory.path().join("elsewhere");
    fs::create_dir(&elsewhere).unwrap();
    let thesis = elsewhere.join("thesis.mcap");
    fs::write(&thesis, "years").unwrap();
    let output = directory.path().join("out");
    let replay = || end(laser_profiler(&["replay", &input, "--force", "-o"]).arg(&output));
    assert_eq!(replay().code, Some(0));
    symlink(&elsewhere, output.join("folder")).unwrap();
    symlink(&thesis, output.join("out_7.mcap")).unwrap();
    symlink(&thesis, output.join("metadata.yaml.unfinished")).unwrap();
    let metadata = fs::read_to_string(output.join("metadata.yaml")).unwrap();
    let listed =
        metadata.replace("- out_0.mcap", "- out_0.mcap\n  - folder/thesis.mcap\n  - out_7.mcap");
    assert_ne!(listed, metadata, "more files are listed");
    fs::write(output.join("metadata.yaml"), listed).unwrap();
    let ended = replay();
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert_eq!(fs::read_to_string(&thesis).unwrap(), "years");
    assert!(output.join("folder").is_symlink() && output.join("out_7.mcap").is_symlink());
}

#[test]
fn force_keeps_recordings_of_other_programs() {
    let directory = tempfile::tempdir().unwrap();
    let input = input(directory.path());
    let camera = directory.path().join("camera");
    record_images(&camera, &good_images(3));
    let file = camera.join("camera_0.mcap");
    let bytes = fs::read(&file).unwrap();
    let own = b"laser_profiler ";
    let at = bytes.windows(own.len()).position(|part| part == own).unwrap();
    let foreign = [&bytes[..at], b"rosbag2_storage", &bytes[at + own.len()..]].concat();
    fs::write(&file, &foreign).unwrap();
    let ended = end(laser_profiler(&["replay", &input, "--force", "-o"]).arg(&camera));
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(ended.stderr.contains("not a bag of this program"), "{ended:?}");
    assert!(fs::read(&file).unwrap() == foreign, "untouched");
}

#[test]
fn the_input_is_never_the_output() {
    let directory = tempfile::tempdir().unwrap();
    let input = input(directory.path());
    let before = content(Path::new(&input));
    for output in [input.clone(), format!("{input}/../in")] {
        let ended = end(&mut laser_profiler(&["replay", &input, "--force", "-o", &output]));
        assert!(matches!(ended.code, Some(1 | 2)), "{ended:?}");
        assert!(ended.stderr.contains("recording itself"), "{ended:?}");
    }
    assert_eq!(content(Path::new(&input)), before);
}

#[test]
fn an_output_that_cannot_be_made_is_named() {
    let directory = tempfile::tempdir().unwrap();
    let input = input(directory.path());
    // Not even root can create directories in these.
    for output in ["/proc/results", "/dev/null/results"] {
        let ended = end(&mut laser_profiler(&["replay", &input, "-o", output]));
        assert_eq!(ended.code, Some(1), "{ended:?}");
        assert!(ended.stderr.contains(output), "{ended:?}");
    }
}

/// A limit on the size of a file fails a write in its middle as a full disk does, and needs no root.
#[test]
fn a_full_disk_is_an_error_and_leaves_a_readable_bag() {
    let directory = tempfile::tempdir().unwrap();
    let output = directory.path().join("out");
    let input = bundled("film_defects").display().to_string();
    let limits = "trap '' XFSZ; ulimit -f 300"; // [KiB]
    let ended = end(limited(limits, &["replay", &input, "-o"]).arg(&output));
    assert_eq!(ended.code, Some(1), "{ended:?}");
    let file = output.join("out_0.mcap");
    assert!(ended.stderr.contains(&file.display().to_string()), "{ended:?}");
    assert!(ended.stderr.contains("File too large"), "{ended:?}");
    assert!(!ended.stderr.contains("panicked"), "{ended:?}");

    let saved = directory.path().join("saved");
    let ended = end(laser_profiler(&["recover", "-o"]).arg(&saved).arg(&file));
    assert_eq!(ended.code, Some(3), "{ended:?}");
    let ended = end(laser_profiler(&["info", "--json"]).arg(&saved));
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert!(ended.stdout.contains("/laser_profiler/centerline"), "{ended:?}");
}
