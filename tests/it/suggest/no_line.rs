//! Pictures without a laser line: `suggest` says so and writes nothing. Faint, short and interrupted lines are lines.

use std::{fs, path::Path};

use image::{GrayImage, Luma};

use super::{Ended, noise, suggest};
use crate::recordings::real;

const WIDTH: u32 = 320;
const HEIGHT: u32 = 240;
const NUM: u32 = 4;

/// Level of a pixel in a picture of that number.
type Level = fn(u32, u32, u32) -> f64;

fn suggested(level: Level) -> (Ended, bool) {
    let place = tempfile::tempdir().unwrap();
    let (folder, file) = (place.path().join("pictures"), place.path().join("rig.yaml"));
    fs::create_dir(&folder).unwrap();
    for number in 0..NUM {
        let picture = GrayImage::from_fn(WIDTH, HEIGHT, |x, y| {
            Luma([(level(x, y, number) + 3.0 * noise(x + 37 * number, y)).round() as u8])
        });
        picture.save(folder.join(format!("{number}.png"))).unwrap();
    }
    let ended = suggest(&folder, &file, &[]);
    (ended, file.exists() || file.with_extension("png").exists())
}

/// A turned checkerboard.
fn board(x: u32, y: u32, side_px: f64, number: u32) -> f64 {
    let (sin, cos) = (0.15 + 0.05 * f64::from(number)).sin_cos();
    let (x, y) = (f64::from(x), f64::from(y));
    let field = ((x * cos + y * sin) / side_px).floor() + ((y * cos - x * sin) / side_px).floor();
    if field.rem_euclid(2.0) < 0.5 { 40.0 } else { 200.0 }
}

/// A line of that level above the background of 10, sloping.
fn line(x: u32, y: u32, level: f64) -> f64 {
    let away = f64::from(y) - 100.0 - 0.1 * f64::from(x);
    10.0 + level * (-away * away / 8.0).exp()
}

#[test]
fn pictures_without_a_line_give_no_file() {
    let cases: [(&str, Level); 6] = [
        ("grey", |_, _, _| 128.0),
        ("noise", |x, y, number| 128.0 + 60.0 * noise(y * 3 + number, x)),
        ("an edge", |_, y, number| if y < 100 + number { 40.0 } else { 180.0 }),
        ("bricks", |x, y, _| {
            let row = y / 25;
            if y % 25 < 3 || (x + row % 2 * 25) % 50 < 3 { 200.0 } else { 110.0 }
        }),
        ("a board", |x, y, number| board(x, y, 23.0, number)),
        ("a coarse board", |x, y, number| board(x, y, 31.0, number)),
    ];
    for (name, level) in cases {
        let (ended, is_written) = suggested(level);
        assert_eq!(ended.code, Some(1), "{name}: {ended:?}");
        assert!(ended.stderr.contains("no line in 4 frames. Likely reason: "), "{name}: {ended:?}");
        assert!(!is_written, "{name}");
    }
}

#[test]
fn faint_and_interrupted_lines_are_lines() {
    let cases: [(&str, Level); 4] = [
        ("faint", |x, y, _| line(x, y, 12.0)),
        ("short", |x, y, number| line(x, y, if x / 30 == 2 + number { 150.0 } else { 0.0 })),
        ("interrupted", |x, y, _| line(x, y, if x / 20 % 3 == 0 { 150.0 } else { 0.0 })),
        ("in steps", |x, y, _| line(x, y + x / 30 * 37 % 90, 150.0)),
    ];
    for (name, level) in cases {
        let (ended, is_written) = suggested(level);
        assert!(ended.code == Some(0) && is_written, "{name}: {ended:?}");
    }
}

#[test]
fn a_real_board_without_laser_has_no_line() {
    let place = tempfile::tempdir().unwrap();
    let file = place.path().join("rig.yaml");
    let suggested = |recording: &Path| suggest(recording, &file, &[]);
    let Some(board) = real("turntable_checkerboard") else { return };
    let ended = suggested(&board);
    assert!(ended.code == Some(1) && !file.exists(), "{ended:?}");
    let Some(board_with_laser) = real("turntable_checkerboard_laser") else { return };
    let ended = suggested(&board_with_laser);
    assert!(ended.code == Some(0) && file.exists(), "{ended:?}");
}
