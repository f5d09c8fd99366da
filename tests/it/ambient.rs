//! A recording without laser becomes the picture that is subtracted.

use std::fs;

use laser_profiler::{
    bag::{BagReader, Filter, ReadOptions},
    msg::{cdr, laser_profiler_msgs::Centerline},
};

use crate::{
    program::{end, laser_profiler, replay},
    recordings::{HEIGHT, WIDTH, image_of, record_images},
};

/// A lamp above the threshold in the right half, brighter than the stripe.
fn room() -> Vec<u8> {
    let level =
        |at: u32| if at % WIDTH >= WIDTH / 2 && at / WIDTH >= HEIGHT / 2 { 150 } else { 10 };
    (0..WIDTH * HEIGHT).map(level).collect()
}

/// The same with a stripe of 100 grey levels in row 8.
fn lit() -> Vec<u8> {
    let stripe = |at: u32| match (at / WIDTH).abs_diff(8) {
        0 => 100,
        1 => 60,
        _ => 0,
    };
    (0..).zip(room()).map(|(at, level)| level + stripe(at)).collect()
}

#[test]
fn the_ambient_image_is_subtracted() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name);
    let frames = |picture: &[u8]| (0..3).map(|n| image_of(picture, n, |_| {})).collect::<Vec<_>>();
    record_images(&path("off"), &frames(&room()));
    record_images(&path("on"), &frames(&lit()));
    let ambient = || {
        let mut command = laser_profiler(&["ambient", "-o"]);
        end(command.arg(path("ambient.png")).arg(path("off")))
    };
    let made = ambient();
    assert_eq!(made.code, Some(0), "{made:?}");
    assert!(made.stdout.contains("mean of 3 frames, 160 x 32 pixels, 8 bits"), "{made:?}");
    let again = ambient();
    assert!(again.code == Some(1) && again.stderr.contains("--force"), "{again:?}");

    let file = format!("extraction.background_file:={}", path("ambient.png").display());
    let arguments = [
        "--ros-args",
        "-p",
        "extraction.background:=reference",
        "-p",
        &file,
        "-p",
        "extraction.min_segment_area:=100",
    ];
    replay(&path("on"), &path("results"), 0, &arguments);
    let reader = BagReader::open(&path("results"), &ReadOptions::default()).unwrap();
    let mut count = 0;
    for message in reader.messages(&Filter::topics(["/laser_profiler/centerline"])) {
        let data = message.unwrap().data;
        let line: Centerline<'_> = cdr::decode(&data).unwrap();
        assert_eq!(line.u.len(), WIDTH as usize);
        assert!(line.v.iter().all(|v| (v - 8.0).abs() < 1e-3), "{:?}", line.v);
        count += 1;
    }
    assert_eq!(count, 3);
}

#[test]
fn a_picture_of_another_size_is_refused_by_name() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name);
    record_images(&path("on"), &[image_of(&lit(), 0, |_| {})]);
    let small = image_of(&room()[..(WIDTH * 8) as usize], 0, |image| image.height = 8);
    record_images(&path("off"), &[small]);
    assert_eq!(
        end(laser_profiler(&["ambient", "-o"]).arg(path("a.png")).arg(path("off"))).code,
        Some(0)
    );
    let with = |file: &str| {
        let file = format!("extraction.background_file:={}", path(file).display());
        let arguments = ["--ros-args", "-p", "extraction.background:=reference", "-p", &file];
        let mut command = laser_profiler(&["replay", "-o"]);
        end(command.arg(path("results")).arg(path("on")).args(arguments))
    };
    let other = with("a.png");
    assert!(
        other.code == Some(3)
            && other.stderr.contains("160 x 32")
            && other.stderr.contains("160 x 8"),
        "{other:?}"
    );
    let missing = with("missing.png");
    assert!(missing.code == Some(1) && missing.stderr.contains("missing.png"), "{missing:?}");
    fs::write(path("bad.png"), b"no picture").unwrap();
    let bad = with("bad.png");
    assert!(bad.code != Some(0) && bad.stderr.contains("bad.png"), "{bad:?}");
}
