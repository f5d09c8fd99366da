//! One scene in every encoding: each gives the centreline of the formula, and that of mono8 where the levels are equal.

use std::path::Path;

use laser_profiler::{
    bag::{BagReader, Filter, ReadOptions},
    msg::{cdr, laser_profiler_msgs::Centerline, sensor_msgs::Image},
};

use crate::{
    program::{end, laser_profiler, replay},
    recordings::{image_of, record_images},
};

/// Odd, so that the last pixel of YUV 4:2:2 has no partner.
const WIDTH: usize = 161;
const HEIGHT: usize = 96;
const SIGMA_PX: f64 = 2.0;
const BLACK: f64 = 12.0;
const SATURATED: u8 = 1;

/// Row of the stripe's centre in a column.
fn truth(u: usize) -> f64 {
    48.0 + 12.3 * (u as f64 / 30.0).sin()
}

/// Grey levels of the scene, clipped at 255, where white light of `peak` falls into the stripe.
fn scene(peak: f64) -> Vec<f64> {
    let level = |row: usize, column: usize| {
        let across = (row as f64 - truth(column)) / SIGMA_PX;
        let noise = (((row * 7919 + column * 104_729) % 101) as f64 / 50.0 - 1.0) * 2.0;
        (BLACK + noise + peak * (-across * across / 2.0).exp()).clamp(0.0, 255.0)
    };
    (0..HEIGHT).flat_map(|row| (0..WIDTH).map(move |column| level(row, column))).collect()
}

fn rounded(levels: &[f64]) -> Vec<u8> {
    levels.iter().map(|level| level.round() as u8).collect()
}

/// Luma of limited range, ITU-R BT.601: black is 16, white is 235.
fn limited(levels: &[f64]) -> Vec<u8> {
    levels.iter().map(|level| (16.0 + 219.0 / 255.0 * level).round() as u8).collect()
}

/// Some chroma, brighter than the stripe in places.
fn chroma(at: usize) -> u8 {
    (at * 37 % 256) as u8
}

/// Rows of grey samples as rows of that encoding, with padding of full scale behind each row and the step.
fn encoded(encoding: &str, grey: &[u8], padding: usize) -> (Vec<u8>, usize) {
    let deep = |level: u8| (u16::from(level) * 257).to_le_bytes();
    let pixel = |at: usize, level: u8| match encoding {
        "mono8" | "8UC1" | "nv12" | "nv21" | "nv24" => vec![level],
        "yuyv" | "yuv422_yuy2" => vec![level, chroma(at)],
        "uyvy" | "yuv422" => vec![chroma(at), level],
        "rgb8" | "bgr8" | "8UC3" => vec![level; 3],
        "rgba8" | "bgra8" | "8UC4" => vec![level, level, level, 255],
        "mono16" | "16UC1" => deep(level).to_vec(),
        "rgb16" | "bgr16" | "16UC3" => [deep(level); 3].concat(),
        "rgba16" | "bgra16" | "16UC4" => [deep(level), deep(level), deep(level), [255; 2]].concat(),
        _ => panic!("{encoding}"),
    };
    let mut data = Vec::new();
    for row in grey.chunks(WIDTH) {
        data.extend(row.iter().enumerate().flat_map(|(at, &level)| pixel(at, level)));
        data.extend(vec![255; padding]);
    }
    let step = data.len() / HEIGHT;
    let chroma_rows = match encoding {
        "nv12" | "nv21" => HEIGHT / 2,
        "nv24" => 2 * HEIGHT,
        _ => 0,
    };
    data.extend((0..chroma_rows * step).map(chroma));
    (data, step)
}

struct Line {
    v: Vec<f32>,
    flags: Vec<u8>,
}

/// Replays two frames of these levels and returns the second one's centreline.
fn line(encoding: &str, grey: &[u8], padding: usize, arguments: &[&str]) -> Line {
    let directory = tempfile::tempdir().unwrap();
    let [input, output] = ["in", "out"].map(|name| directory.path().join(name));
    record(&input, encoding, grey, padding);
    let (summary, stderr) = replay(&input, &output, 0, arguments);
    assert_eq!(summary["frames"]["processed"], 2, "{encoding}: {stderr}");
    last_line(&output)
}

fn record(directory: &Path, encoding: &str, grey: &[u8], padding: usize) {
    let (data, step) = encoded(encoding, grey, padding);
    let edit = |image: &mut Image<'_>| {
        (image.width, image.height, image.step) = (WIDTH as u32, HEIGHT as u32, step as u32);
        image.encoding = encoding.to_owned().into();
    };
    record_images(directory, &[image_of(&data, 0, edit), image_of(&data, 1, edit)]);
}

fn last_line(results: &Path) -> Line {
    let reader = BagReader::open(results, &ReadOptions::default()).unwrap();
    let message = reader.messages(&Filter::topics(["/laser_profiler/centerline"])).last();
    let message = message.unwrap().unwrap();
    let line: Centerline<'_> = cdr::decode(&message.data).unwrap();
    assert_eq!(line.u.len(), WIDTH, "a point in every column");
    Line { v: line.v.to_vec(), flags: line.flags.to_vec() }
}

/// Largest distance of a line from the formula, pixels, away from the borders, where the blur lacks neighbours.
fn error_px(line: &Line) -> f64 {
    let inner = line.v.iter().enumerate().skip(8).take(WIDTH - 16);
    inner.map(|(u, &v)| (f64::from(v) - truth(u)).abs()).fold(0.0, f64::max)
}

/// Largest distance of two lines, pixels.
fn difference_px(a: &Line, b: &Line) -> f32 {
    a.v.iter().zip(&b.v).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

const YUV: [&str; 7] = ["yuyv", "yuv422_yuy2", "uyvy", "yuv422", "nv12", "nv21", "nv24"];
const EIGHT_BITS: [&str; 7] = ["8UC1", "rgb8", "bgr8", "8UC3", "rgba8", "bgra8", "8UC4"];
const SIXTEEN_BITS: [&str; 8] =
    ["mono16", "16UC1", "rgb16", "bgr16", "16UC3", "rgba16", "bgra16", "16UC4"];

#[test]
fn the_same_levels_give_the_same_line_in_every_encoding() {
    let grey = rounded(&scene(180.0));
    let full_range = ["--ros-args", "-p", "full_scale:=255"];
    let mono = line("mono8", &grey, 0, &full_range);
    assert!(error_px(&mono) < 0.1, "{}", error_px(&mono));
    for encoding in YUV.iter().chain(&EIGHT_BITS) {
        for padding in [0, 1, 6] {
            let other = line(encoding, &grey, padding, &full_range);
            assert_eq!(other.v, mono.v, "{encoding}, padding {padding}");
            assert_eq!(other.flags, mono.flags, "{encoding}, padding {padding}");
        }
    }
    for encoding in SIXTEEN_BITS {
        let other = line(encoding, &grey, 6, &[]);
        // 257 times the levels: only the rounding noise of 1/12 in the sigma differs.
        let difference = difference_px(&other, &mono);
        assert!(difference < 1e-3, "{encoding}: {difference}");
        assert_eq!(other.flags, mono.flags, "{encoding}");
    }
}

/// By default white is 235: thresholds are 8 % lower, and the line is still that of the formula.
#[test]
fn luma_of_either_range_gives_the_line_of_the_formula() {
    for peak in [90.0, 140.0, 200.0] {
        let levels = scene(peak);
        for encoding in YUV {
            for (range, grey) in [("full", rounded(&levels)), ("limited", limited(&levels))] {
                let found = line(encoding, &grey, 0, &[]);
                let error = error_px(&found);
                assert!(error < 0.15, "{encoding}, {range} range, peak {peak}: {error}");
                assert!(found.flags.iter().all(|flags| flags & SATURATED == 0), "{encoding}");
            }
        }
    }
}

/// Where a mono camera clips at 255, luma of limited range clips at 235.
#[test]
fn a_stripe_that_is_clipped_at_235_is_saturated() {
    for peak in [400.0, 800.0, 2000.0] {
        let levels = scene(peak);
        let is_saturated = |line: &Line| line.flags.iter().all(|flags| flags & SATURATED != 0);
        assert!(is_saturated(&line("mono8", &rounded(&levels), 0, &[])), "mono8, {peak}");
        for encoding in YUV {
            let found = line(encoding, &limited(&levels), 0, &[]);
            assert!(is_saturated(&found), "{encoding}, {peak}");
            assert!(error_px(&found) < 0.15, "{encoding}, {peak}: {}", error_px(&found));
            let found = line(encoding, &rounded(&levels), 0, &[]);
            assert!(is_saturated(&found), "{encoding}, full range, {peak}");
        }
    }
    // A camera of full range says so.
    let bright = rounded(&scene(232.0));
    let full_range = line("yuyv", &bright, 0, &["--ros-args", "-p", "full_scale:=255"]);
    assert!(full_range.flags.iter().all(|flags| flags & SATURATED == 0));
}

#[test]
fn a_colour_that_the_images_do_not_have_is_named_with_its_parameter() {
    let grey = rounded(&scene(180.0));
    for (encoding, why) in
        [("yuv422_yuy2", "only the luma is read"), ("nv12", "only the luma is read")]
    {
        for channel in ["red", "blue", "green_excess"] {
            let directory = tempfile::tempdir().unwrap();
            let [input, output] = ["in", "out"].map(|name| directory.path().join(name));
            record(&input, encoding, &grey, 0);
            let parameter = format!("channel:={channel}");
            let (summary, stderr) = replay(&input, &output, 3, &["--ros-args", "-p", &parameter]);
            assert_eq!(summary["frames"]["rejected"], 2, "{encoding}");
            let names_it = stderr.contains(&format!("channel is {channel}, but"));
            assert!(names_it && stderr.contains(why), "{encoding}: {stderr}");
        }
    }
}

/// Names that ROS does not have, which drivers send all the same.
#[test]
fn unknown_encodings_are_told_what_would_be_right() {
    for (encoding, remedy) in [
        ("mono12p", "set full_scale to 1023, 4095 or 16383"),
        ("mono10", "let the driver publish mono16"),
        ("h264", "video has to be decoded first"),
        ("32FC1", "unsigned integers of 8 or 16 bits"),
    ] {
        let directory = tempfile::tempdir().unwrap();
        let [input, output] = ["in", "out"].map(|name| directory.path().join(name));
        let edit = |image: &mut Image<'_>| image.encoding = encoding.into();
        record_images(&input, &[image_of(&[0; 9], 0, edit)]);
        let mut command = laser_profiler(&["replay", "-o"]);
        let ended = end(command.arg(&output).arg(&input));
        assert_eq!(ended.code, Some(3), "{ended:?}");
        assert!(ended.stderr.contains(remedy) && ended.stderr.contains(encoding), "{ended:?}");
    }
}
