//! Results of a fixed threshold on real scenes in ambient light: the figures in the README's limits.

use std::path::Path;

use laser_profiler::{
    bag::{BagReader, Filter, ReadOptions},
    msg::{cdr, laser_profiler_msgs::Centerline, sensor_msgs::Image},
};

use crate::{program::replay, recordings::real};

/// Minimum contrast of the line to its surroundings, grey levels.
const CONTRAST: f32 = 40.0;
/// Extent of the surroundings on either side, pixels.
const REACH: usize = 30;
/// Largest distance of a point on the line from it, pixels.
const NEAR_PX: f32 = 3.0;

/// Returns the column of the largest contrast in a row, if it is sufficient. Independent of the extractor under test.
fn line_in(row: &[u8]) -> Option<usize> {
    let sums: Vec<u32> = std::iter::once(0)
        .chain(row.iter().scan(0, |sum, &level| {
            *sum += u32::from(level);
            Some(*sum)
        }))
        .collect();
    let mean = |from: usize, to: usize| (sums[to] - sums[from]) as f32 / (to - from) as f32;
    let contrast = |at: usize| mean(at - 1, at + 2) - mean(at - REACH, at + REACH + 1);
    let columns = REACH..row.len() - REACH - 1;
    let best = columns.max_by(|&a, &b| contrast(a).total_cmp(&contrast(b)))?;
    (contrast(best) > CONTRAST).then_some(best)
}

fn messages(bag: &Path, topic: &str) -> Vec<Vec<u8>> {
    let reader = BagReader::open(bag, &ReadOptions::default()).unwrap();
    reader.messages(&Filter::topics([topic])).map(|message| message.unwrap().data).collect()
}

/// Returns the share of points on the line, the share of rows with a line that have a point on it, and the number of
/// warnings that the threshold is too low.
fn shares(recording: &Path, parameters: &[&str]) -> (f64, f64, usize) {
    let directory = tempfile::tempdir().unwrap();
    let output = directory.path().join("results");
    let mut arguments = vec!["--ros-args", "-p", "stripe_direction:=vertical"];
    arguments.extend(parameters.iter().flat_map(|parameter| ["-p", parameter]));
    let (_, log) = replay(recording, &output, 0, &arguments);
    let (mut num_rows, mut num_points, mut num_on_line) = (0, 0, 0);
    let images = messages(recording, "/camera/image_raw");
    let centerlines = messages(&output, "/laser_profiler/centerline");
    assert_eq!(images.len(), centerlines.len());
    for (image, centerline) in images.iter().zip(&centerlines) {
        let image: Image<'_> = cdr::decode(image).unwrap();
        let centerline: Centerline<'_> = cdr::decode(centerline).unwrap();
        let rows = image.data.chunks(image.step as usize);
        let lines: Vec<_> = rows.map(|row| line_in(&row[..image.width as usize])).collect();
        let is_on_line = |(u, v): (&f32, &f32)| {
            lines[*v as usize].is_some_and(|line| (u - line as f32).abs() < NEAR_PX)
        };
        num_rows += lines.iter().flatten().count();
        num_points += centerline.u.len();
        let points = centerline.u.iter().zip(centerline.v.iter());
        num_on_line += points.filter(|&point| is_on_line(point)).count();
    }
    let share = |whole: usize| num_on_line as f64 / whole as f64;
    let (of_points, of_rows) = (share(num_points), share(num_rows));
    eprintln!(
        "{} {parameters:?}: {:.1} % of the points on the line, {:.1} % of its rows found",
        recording.file_name().unwrap().display(),
        100.0 * of_points,
        100.0 * of_rows
    );
    (of_points, of_rows, log.matches(TOO_LOW).count())
}

const TOO_LOW: &str = "above extraction.segment_threshold";

const RAISED: [&str; 3] = [
    "extraction.segment_threshold:=180.0",
    "extraction.width_threshold:=190.0",
    "extraction.min_segment_area:=60",
];

#[test]
fn the_papers_threshold_takes_the_background_for_the_stripe() {
    let Some(recording) = real("turntable_empty") else { return };
    let (of_points, _, warnings) = shares(&recording, &[]);
    assert!(of_points < 0.1, "{of_points}: better than the README states");
    assert_eq!(warnings, 1, "one warning");
    let (of_points, of_rows, warnings) = shares(&recording, &RAISED);
    assert_eq!(warnings, 0);
    assert!(of_points > 0.95 && of_rows > 0.5, "{of_points}, {of_rows}");
}

#[test]
fn a_brighter_object_needs_a_higher_threshold_too() {
    let Some(recording) = real("turntable_object") else { return };
    let (of_points, ..) = shares(&recording, &[]);
    assert!(of_points < 0.75, "{of_points}: better than the README states");
    let (of_points, of_rows, _) = shares(&recording, &RAISED);
    assert!(of_points > 0.95 && of_rows > 0.85, "{of_points}, {of_rows}");
}

#[test]
fn an_adaptive_threshold_causes_no_warning() {
    let Some(recording) = real("turntable_empty") else { return };
    let directory = tempfile::tempdir().unwrap();
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/launch_configs/bright_ambient.yaml");
    let (_, log) = replay(&recording, &directory.path().join("out"), 0, &["--params-file", file]);
    assert!(!log.contains(TOO_LOW), "{log}");
}
