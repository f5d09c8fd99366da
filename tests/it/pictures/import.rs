//! A recording made of pictures gives the results of the pictures.

use std::{fmt::Write as _, fs, path::Path};

use laser_profiler::bag::{BagReader, Filter, RawMessage, ReadOptions};

use crate::program::{end, laser_profiler, replay};

use super::{
    CALIBRATION, RATE,
    render::{Kind, NUM, Scene, write},
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
