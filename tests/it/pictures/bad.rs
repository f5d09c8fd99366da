//! Bad pictures among good ones: counted and named, and the rest is measured.

use std::{fs, os::unix::fs::symlink, path::Path};

use crate::program::{end, laser_profiler, replay};

use super::render::{Kind, NUM, Scene, lines, write};

/// Writes a good series.
fn series(folder: &Path, kind: Kind) {
    fs::create_dir(folder).unwrap();
    for number in 0..NUM {
        write(&folder.join(kind.name(number)), kind, &Scene::Grey.picture(number));
    }
}

/// Replays a series in which picture 5 is bad: it is rejected, named with the reason, and the others are measured.
fn rejected(kind: Kind, case: &str, spoil: impl Fn(&Path), reason: &str) {
    let place = tempfile::tempdir().unwrap();
    let (folder, results) = (place.path().join("scan"), place.path().join("results"));
    series(&folder, kind);
    spoil(&folder.join(kind.name(5)));
    let (summary, stderr) = replay(&folder, &results, 3, &["--frame-rate", "50"]);
    assert_eq!(summary["frames"]["rejected"], 1, "{case}: {summary}");
    assert_eq!(summary["frames"]["lost"], 0, "{case}: {summary}");
    assert!(stderr.contains(reason), "{case}, expected {reason:?}: {stderr}");
    let name = kind.name(5);
    assert!(stderr.contains(&name), "{case}: {name} is named: {stderr}");
    let lines = lines(&results);
    assert_eq!(lines.len(), NUM - 1, "{case}");
    let good = (0..NUM).filter(|number| *number != 5);
    for (number, line) in good.zip(&lines) {
        assert!(line.error_px(Scene::Grey, number) < 0.1, "{case} {number}");
        assert_eq!(line.stamp_ns, super::render::stamp_ns(number), "{case}: places are kept");
    }
}

#[test]
fn files_that_are_no_pictures_are_named() {
    for kind in [Kind::Png, Kind::Tiff, Kind::Pgm] {
        rejected(kind, "text", |path| fs::write(path, "not a picture").unwrap(), "is no picture");
        rejected(kind, "empty", |path| fs::write(path, "").unwrap(), "is empty");
        rejected(
            kind,
            "a dangling link",
            |path| {
                fs::remove_file(path).unwrap();
                symlink("/nowhere/at/all", path).unwrap();
            },
            "No such file",
        );
    }
}

#[test]
fn pictures_that_are_cut_off_are_named_and_not_imported() {
    for kind in [Kind::Png, Kind::Jpeg] {
        let cut = |path: &Path| {
            let file = fs::read(path).unwrap();
            fs::write(path, &file[..file.len() - 20]).unwrap();
        };
        rejected(kind, "cut", cut, "is cut off");
        let place = tempfile::tempdir().unwrap();
        series(&place.path().join("scan"), kind);
        cut(&place.path().join("scan").join(kind.name(5)));
        let mut command = laser_profiler(&["import", "-o"]);
        let ended = end(command.arg(place.path().join("bag")).arg(place.path().join("scan")));
        assert_eq!(ended.code, Some(3), "{ended:?}");
        let reason = format!("{}: is cut off", kind.name(5));
        assert!(ended.stdout.contains(&reason), "{reason}: {ended:?}");
    }
}

#[test]
fn pictures_of_another_size_are_named() {
    for (kind, width, height) in [(Kind::Png, 160, 47), (Kind::Jpeg, 320, 96), (Kind::Bmp, 48, 160)]
    {
        let other = image::DynamicImage::new_luma8(width, height);
        let reason = format!(
            "has {width} x {height} pixels, but the first picture of the series has 160 x 48"
        );
        rejected(kind, "size", |path| write(path, kind, &other), &reason);
    }
}

#[test]
fn links_to_pictures_are_followed() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    series(&path("there"), Kind::Png);
    fs::create_dir(path("here")).unwrap();
    for number in 0..NUM {
        let name = Kind::Png.name(number);
        symlink(path("there").join(&name), path("here").join(&name)).unwrap();
    }
    let (summary, _) = replay(&path("here"), &path("results"), 0, &[]);
    assert_eq!(summary["frames"]["processed"], NUM);
}

#[test]
fn missing_numbers_count_as_lost_and_leave_their_places() {
    for missing in [&[4][..], &[3, 4, 9], &[1, 6, 7, 8]] {
        let place = tempfile::tempdir().unwrap();
        let (folder, results) = (place.path().join("scan"), place.path().join("results"));
        series(&folder, Kind::Png);
        for number in missing {
            fs::remove_file(folder.join(Kind::Png.name(*number))).unwrap();
        }
        let (summary, stderr) = replay(&folder, &results, 3, &["--frame-rate", "50"]);
        assert_eq!(summary["frames"]["lost"], missing.len(), "{summary}");
        assert_eq!(summary["frames"]["processed"], NUM - missing.len(), "{summary}");
        let told = format!("pictures are missing by their numbers: {} (", missing.len());
        assert!(stderr.contains(&told), "{stderr}");
        let present = (0..NUM).filter(|number| !missing.contains(number));
        let stamps: Vec<_> = present.map(super::render::stamp_ns).collect();
        let found: Vec<_> = lines(&results).iter().map(|line| line.stamp_ns).collect();
        assert_eq!(found, stamps);
    }
}

#[test]
fn endings_do_not_matter_for_numbers_and_odd_names_are_told() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("scan");
    let file = |name: &str| folder.join(name);
    let replayed = |results: &str, code| {
        replay(&folder, &place.path().join(results), code, &["--frame-rate", "50"])
    };
    series(&folder, Kind::Png);
    fs::rename(file("frame_3.png"), file("frame_3.PNG")).unwrap();
    fs::remove_file(file("frame_7.png")).unwrap();
    let (summary, stderr) = replayed("endings", 3);
    assert_eq!(summary["frames"]["lost"], 1, "{summary}");
    assert!(stderr.contains("missing by their numbers: 1 (7)"), "{stderr}");
    for (name, fault) in [
        ("dark.png", "1 of 12 names are not numbered like the others, the first is {}/dark"),
        (
            "frame_2 (1).png",
            "1 of 12 names are not numbered like the others, the first is {}/frame_2 (1)",
        ),
        ("frame_02.png", "have the same number"),
    ] {
        fs::copy(file("frame_2.png"), file(name)).unwrap();
        let (summary, stderr) = replayed(name, 0);
        assert_eq!(summary["frames"]["processed"], NUM, "{name}: {summary}");
        let fault = fault.replace("{}", &folder.display().to_string());
        let told = format!("{fault}: missing numbers are not looked for");
        assert!(stderr.contains(&told), "{told}: {stderr}");
        fs::remove_file(file(name)).unwrap();
    }
}

/// One picture a folder, and numbers where other names have an ending.
#[test]
fn numbers_may_stand_anywhere_in_a_path() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    for number in (0..NUM).filter(|number| *number != 4) {
        let [folder, file] =
            [format!("run_{number}"), format!("capture.{number:04}")].map(|name| path(&name));
        fs::create_dir(&folder).unwrap();
        write(&folder.join("img.png"), Kind::Png, &Scene::Grey.picture(number));
        fs::copy(folder.join("img.png"), file).unwrap();
    }
    for (pattern, results) in [("run_*/img.png", "of_folders"), ("capture.*", "of_files")] {
        let (summary, stderr) = replay(&path(pattern), &path(results), 3, &["--frame-rate", "50"]);
        assert_eq!(summary["frames"]["lost"], 1, "{pattern}: {summary}");
        assert!(stderr.contains("missing by their numbers: 1 (4)"), "{pattern}: {stderr}");
    }
}

#[test]
fn inputs_without_pictures_are_refused_by_name() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    fs::create_dir(path("empty")).unwrap();
    fs::create_dir_all(path("deeper/left")).unwrap();
    fs::create_dir(path("texts")).unwrap();
    fs::write(path("texts/a.png"), "text").unwrap();
    fs::write(path("texts/b.png"), "text").unwrap();
    for (name, reason) in [
        ("empty", "nor pictures"),
        ("deeper", "1 folder whose content is not read: left"),
        ("texts", "none of the pictures can be read (2)"),
        ("none*.png", "no file has such a name"),
        ("gone.png", "none of the pictures can be read (1)"),
    ] {
        let mut command = laser_profiler(&["replay", "-o"]);
        let ended = end(command.arg(path("out")).arg(path(name)));
        assert_eq!(ended.code, Some(1), "{name}: {ended:?}");
        assert!(ended.stderr.contains(reason) && ended.stderr.contains(name), "{ended:?}");
        assert!(!path("out").exists(), "{name}");
    }
}

#[test]
fn a_table_that_does_not_fit_is_told() {
    let place = tempfile::tempdir().unwrap();
    let (folder, table) = (place.path().join("scan"), place.path().join("t.csv"));
    series(&folder, Kind::Png);
    let rows = |numbers: &[usize]| {
        let row = |number: &usize| {
            format!("{},{}\n", Kind::Png.name(*number), 0.02 * (number + 1) as f64)
        };
        format!("file,stamp_s\n{}", numbers.iter().map(row).collect::<String>())
    };
    let all: Vec<_> = (0..NUM).collect();
    let stated = table.display().to_string();
    for (case, text, num_rejected, reason) in [
        ("a picture without a row", rows(&all[1..]), 1, "frame_0.png: is not named"),
        (
            "a row without a picture",
            rows(&[&all[..], &[77]].concat()),
            1,
            "frame_77.png: No such file",
        ),
        ("both", rows(&[&all[2..], &[77]].concat()), 3, "frame_77.png"),
    ] {
        fs::write(&table, text).unwrap();
        let results = place.path().join(case.replace(' ', "_"));
        let (summary, stderr) = replay(
            &folder,
            &results,
            3,
            &["--positions", &stated, "--ros-args", "--log-level", "debug"],
        );
        assert_eq!(summary["frames"]["rejected"], num_rejected, "{case}: {summary}");
        assert!(stderr.contains(reason), "{case}: {stderr}");
    }
    // The pattern leaves out two pictures that the table names: they are there, but were not asked for.
    fs::write(&table, rows(&all)).unwrap();
    let results = place.path().join("some");
    let given = folder.join("frame_?.png");
    let (summary, stderr) = replay(&given, &results, 3, &["--positions", &stated]);
    assert_eq!(
        (&summary["frames"]["processed"], &summary["frames"]["rejected"]),
        (&10.into(), &2.into()),
        "{summary}"
    );
    for name in ["frame_10.png", "frame_11.png"] {
        let told = format!("{name}: is named in the file of --positions, but is none of");
        assert!(stderr.contains(&told), "{told}: {stderr}");
    }
    for (text, fault) in [
        ("file,stamp_s\nframe_0.png,soon\n", "line 2: stamp_s is \"soon\""),
        ("file,stamp_s\nx.png,1\n", "no row names one of the 12 pictures: one names x.png"),
    ] {
        fs::write(&table, text).unwrap();
        let mut command = laser_profiler(&["replay", "--positions", &stated, "-o"]);
        let ended = end(command.arg(place.path().join("out")).arg(&folder));
        assert_eq!(ended.code, Some(1), "{ended:?}");
        assert!(ended.stderr.contains(fault), "{fault}: {ended:?}");
    }
}

#[test]
fn missing_numbers_are_told_with_a_table_without_stamps_too() {
    let place = tempfile::tempdir().unwrap();
    let (folder, table) = (place.path().join("scan"), place.path().join("t.csv"));
    series(&folder, Kind::Png);
    let there: Vec<_> = (0..NUM).filter(|number| ![4, 5].contains(number)).collect();
    for missing in [4, 5] {
        fs::remove_file(folder.join(Kind::Png.name(missing))).unwrap();
    }
    let row = |number: &usize| format!("{},{number}\n", Kind::Png.name(*number));
    let rows = there.iter().map(row).collect::<String>();
    fs::write(&table, format!("file,position\n{rows}")).unwrap();
    let stated = table.display().to_string();
    let options = ["--frame-rate", "50", "--positions", &stated];
    let (summary, stderr) = replay(&folder, &place.path().join("results"), 3, &options);
    assert_eq!(summary["frames"]["lost"], 2, "{summary}");
    assert!(stderr.contains("pictures are missing by their numbers: 2 (4 to 5)"), "{stderr}");
    let found = lines(&place.path().join("results"));
    let stamps: Vec<_> = found.iter().map(|line| line.stamp_ns).collect();
    assert_eq!(stamps, there.into_iter().map(super::render::stamp_ns).collect::<Vec<_>>());
}

#[test]
fn a_pattern_that_matches_several_inputs_is_refused_where_one_is_read() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    for name in ["scan_a", "scan_b"] {
        series(&path(name), Kind::Png);
    }
    let output = path("out.png").display().to_string();
    for arguments in [&["info"][..], &["suggest"], &["ambient", "-o", &output]] {
        let mut command = laser_profiler(arguments);
        let ended = end(command.arg(path("scan_?")));
        assert_eq!(ended.code, Some(1), "{ended:?}");
        let told = format!(
            "scan_?: matches 2 inputs: {}, {}; name one of them",
            path("scan_a").display(),
            path("scan_b").display()
        );
        assert!(ended.stderr.contains(&told), "{told}: {ended:?}");
    }
    let mut command = laser_profiler(&["info"]);
    assert_eq!(end(command.arg(path("*_b"))).code, Some(0), "one match is that input");
}

#[test]
fn the_limit_in_an_error_is_the_parameter() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    series(&path("scan"), Kind::Pgm);
    // The pixels are 1 MiB, and the file is larger by its header; and far more.
    for (name, height) in [("slightly.pgm", 1024), ("far.pgm", 2000)] {
        let large = image::DynamicImage::new_luma8(1024, height);
        write(&path("scan").join(name), Kind::Pgm, &large);
    }
    let limited = ["--ros-args", "-p", "max_frame_bytes:=1048576"];
    let (summary, stderr) = replay(&path("scan"), &path("results"), 3, &limited);
    assert_eq!(summary["frames"]["rejected"], 2, "{summary}");
    for name in ["slightly.pgm", "far.pgm"] {
        let named = stderr.lines().find(|line| line.contains(name)).unwrap();
        assert!(named.contains("more than the limit of 1048576 (max_frame_bytes)"), "{stderr}");
    }
}

#[test]
fn suggestions_pass_over_bad_pictures_and_the_ambient_image_does_not() {
    let place = tempfile::tempdir().unwrap();
    let path = |name: &str| place.path().join(name);
    series(&path("scan"), Kind::Png);
    fs::write(path("scan").join(Kind::Png.name(5)), "text").unwrap();
    let mut command = laser_profiler(&["suggest", "--frames", "12", "--json", "-o"]);
    let ended = end(command.arg(path("scan.yaml")).arg(path("scan")));
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let told: serde_json::Value = serde_json::from_str(&ended.stdout).unwrap();
    assert_eq!((&told["examined"], &told["unusable"]), (&11.into(), &1.into()), "{told}");
    let mut command = laser_profiler(&["ambient", "-o"]);
    let ended = end(command.arg(path("ambient.png")).arg(path("scan")));
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(ended.stderr.contains("frame_5.png: is no picture"), "{ended:?}");
}

#[test]
fn a_row_that_names_two_pictures_belongs_to_neither() {
    let place = tempfile::tempdir().unwrap();
    let (one, two, table) =
        (place.path().join("one"), place.path().join("two"), place.path().join("t.csv"));
    series(&one, Kind::Png);
    series(&two, Kind::Png);
    let path = two.join(Kind::Png.name(3));
    let rows = format!("file,stamp_s\n{},1\n{},2\n", Kind::Png.name(2), path.display());
    fs::write(&table, rows).unwrap();
    let mut command = laser_profiler(&["replay", "--json", "--positions"]);
    let results = place.path().join("results");
    let ended = end(command
        .arg(&table)
        .arg("-o")
        .arg(&results)
        .arg(one.join("frame_2.png"))
        .args([two.join("frame_2.png"), path]));
    assert_eq!(ended.code, Some(3), "{ended:?}");
    assert!(ended.stderr.contains("only by a name that another picture has"), "{ended:?}");
    let summary: serde_json::Value = serde_json::from_str(&ended.stdout).unwrap();
    assert_eq!(
        (&summary["frames"]["processed"], &summary["frames"]["rejected"]),
        (&1.into(), &2.into()),
        "{summary}"
    );
    assert_eq!(lines(&results)[0].stamp_ns, 2_000_000_000);
}
