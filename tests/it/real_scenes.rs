//! Real recordings with their parameter files in `launch_configs/`, and with those that `suggest` writes, against the line
//! as contrast alone shows it.

use std::path::Path;

use laser_profiler::{
    bag::{BagReader, Filter, ReadOptions},
    msg::{
        cdr,
        convert::compressed,
        laser_profiler_msgs::Centerline,
        sensor_msgs::{CompressedImage, Image},
    },
    scanner::params::StripeDirection,
};

use crate::{
    program::{end, laser_profiler, replay},
    recordings::real,
};

/// Largest distance of a point on the line from it, pixels.
const NEAR_PX: f64 = 3.0;
/// `suggest` may find this share of the lines less than the file made by hand, and as much more wrong points.
const LESS_RIGHT: f64 = 0.01;
const MORE_WRONG: f64 = 0.005;

/// Grey levels, or how much redder than grey; `rows` across the stripe, `lines` along it.
struct Picture {
    lines: usize,
    rows: usize,
    /// Row by row.
    levels: Vec<f32>,
}

impl Picture {
    fn at(&self, line: usize, row: usize) -> f32 {
        self.levels[row * self.lines + line]
    }

    /// A grey image of a stripe from top to bottom, turned.
    fn grey(message: &[u8]) -> Self {
        let image: Image<'_> = cdr::decode(message).unwrap();
        let (width, height, step) =
            (image.width as usize, image.height as usize, image.step as usize);
        let turned =
            (0..width * height).map(|at| image.data[at % height * step + at / height].into());
        Self { lines: height, rows: width, levels: turned.collect() }
    }

    /// Red minus the mean of green and blue.
    fn red(message: &[u8]) -> Self {
        Self::coloured(message, |red, green, blue| red - f32::midpoint(green, blue))
    }

    /// Green minus the mean of red and blue, of a stripe from top to bottom, turned.
    fn green(message: &[u8]) -> Self {
        let picture = Self::coloured(message, |red, green, blue| green - f32::midpoint(red, blue));
        picture.turned()
    }

    fn coloured(message: &[u8], level: impl Fn(f32, f32, f32) -> f32) -> Self {
        let message: CompressedImage<'_> = cdr::decode(message).unwrap();
        let mut pixels = Vec::new();
        let image = compressed::image(&message, 1 << 24, &mut pixels).unwrap();
        let level = |p: &[u8]| level(p[0].into(), p[1].into(), p[2].into());
        let (lines, rows) = (image.width() as usize, image.height() as usize);
        Self { lines, rows, levels: image.data().chunks_exact(3).map(level).collect() }
    }

    /// A grey file; `turned` for a stripe from top to bottom.
    fn file(path: &Path) -> Self {
        let image = image::open(path).unwrap().to_luma8();
        let (lines, rows) = (image.width() as usize, image.height() as usize);
        Self { lines, rows, levels: image.as_raw().iter().map(|&level| level.into()).collect() }
    }

    fn turned(self) -> Self {
        let Self { lines, rows, levels } = self;
        let turned = (0..levels.len()).map(|at| levels[at % rows * lines + at / rows]).collect();
        Self { lines: rows, rows: lines, levels: turned }
    }

    /// Mean over three lines and `reach` rows to either side.
    fn mean(&self, line: usize, row: usize, reach: usize) -> f32 {
        let lines = line.saturating_sub(1)..(line + 2).min(self.lines);
        let count = lines.len() * (2 * reach + 1);
        let rows = row - reach..=row + reach;
        let sum: f32 = rows
            .flat_map(|row| lines.clone().map(move |line| (line, row)))
            .map(|(l, r)| self.at(l, r))
            .sum();
        sum / count as f32
    }

    /// Returns the row with the highest contrast of three rows to the brighter side, 6 to 16 rows away, if it exceeds `least`
    /// and the line continues on both sides. Independent of the extractor.
    fn line(&self, least: f32) -> Vec<Option<f64>> {
        let places: Vec<Option<f64>> = (0..self.lines)
            .map(|line| {
                let side: Vec<f32> =
                    (5..self.rows - 5).map(|row| self.mean(line, row, 5)).collect();
                let contrast =
                    |row: usize| self.mean(line, row, 1) - side[row - 16].max(side[row + 6]);
                let best =
                    (17..self.rows - 17).max_by(|&a, &b| contrast(a).total_cmp(&contrast(b)))?;
                (contrast(best) >= least).then_some(best as f64)
            })
            .collect();
        let goes_on = |at: usize, place: f64| {
            let near = &places[at.saturating_sub(5)..(at + 6).min(places.len())];
            near.iter().flatten().filter(|&other| (other - place).abs() <= 2.0 * NEAR_PX).count()
                >= 6
        };
        (0..).zip(&places).map(|(at, place)| place.filter(|&place| goes_on(at, place))).collect()
    }
}

/// The median of every pixel over all frames: everything that does not move.
fn still(pictures: &[Picture]) -> Picture {
    let level = |at: usize| {
        let mut levels: Vec<f32> = pictures.iter().map(|picture| picture.levels[at]).collect();
        let middle = levels.len() / 2;
        *levels.select_nth_unstable_by(middle, f32::total_cmp).1
    };
    let Picture { lines, rows, ref levels } = pictures[0];
    Picture { lines, rows, levels: (0..levels.len()).map(level).collect() }
}

fn messages(bag: &Path, topic: &str) -> Vec<Vec<u8>> {
    let reader = BagReader::open(bag, &ReadOptions::default()).unwrap();
    reader.messages(&Filter::topics([topic])).map(|message| message.unwrap().data).collect()
}

/// Returns the position of the stripe in every line of every frame of the results.
fn found(results: &Path, direction: StripeDirection, lines: usize) -> Vec<Vec<Option<f64>>> {
    let places = |message: Vec<u8>| {
        let centerline: Centerline<'_> = cdr::decode(&message).unwrap();
        let (along, across) = match direction {
            StripeDirection::Vertical => (&centerline.v, &centerline.u),
            StripeDirection::Horizontal => (&centerline.u, &centerline.v),
        };
        let mut places = vec![None; lines];
        for (&line, &place) in along.iter().zip(across.iter()) {
            places[line as usize] = Some(f64::from(place));
        }
        places
    };
    messages(results, "/laser_profiler/centerline").into_iter().map(places).collect()
}

/// Quality of a recording's centrelines.
#[derive(Debug)]
struct Figures {
    /// Share of the lines with contrast in which the point is right, and in which it is wrong.
    right: f64,
    wrong: f64,
    /// 1.4826 times the median absolute second difference along the stripe, pixels.
    roughness_px: f64,
    /// From one line to the next by more than 3 px, a frame.
    jumps: f64,
}

fn figures(found: &[Vec<Option<f64>>], truth: &[Vec<Option<f64>>]) -> Figures {
    assert_eq!(found.len(), truth.len());
    let (mut lines, mut right, mut wrong, mut jumps) = (0_usize, 0, 0, 0);
    let mut bends = Vec::new();
    for (found, truth) in found.iter().zip(truth) {
        for (found, truth) in found.iter().zip(truth) {
            let Some(truth) = truth else { continue };
            lines += 1;
            let Some(found) = found else { continue };
            let is_right = (found - truth).abs() <= NEAR_PX;
            right += usize::from(is_right);
            wrong += usize::from(!is_right);
        }
        jumps += found
            .windows(2)
            .filter(|pair| matches!(pair, [Some(a), Some(b)] if (a - b).abs() > NEAR_PX))
            .count();
        bends.extend(found.windows(3).filter_map(|three| match three {
            [Some(a), Some(b), Some(c)] => Some((a - 2.0 * b + c).abs()),
            _ => None,
        }));
    }
    let middle = bends.len() / 2;
    let median = *bends.select_nth_unstable_by(middle, f64::total_cmp).1;
    let share = |count: usize| count as f64 / lines as f64;
    Figures {
        right: share(right),
        wrong: share(wrong),
        roughness_px: 1.4826 * median,
        jumps: jumps as f64 / found.len() as f64,
    }
}

/// Replays with these arguments and compares.
fn measure(recording: &Path, arguments: &[&str], truth: &[Vec<Option<f64>>]) -> Figures {
    let directory = tempfile::tempdir().unwrap();
    let output = directory.path().join("results");
    replay(recording, &output, 0, arguments);
    let name = recording.to_string_lossy();
    let is_horizontal = name.contains("floor") || name.contains("wood");
    let direction =
        if is_horizontal { StripeDirection::Horizontal } else { StripeDirection::Vertical };
    let figures = figures(&found(&output, direction, truth[0].len()), truth);
    eprintln!("{} {arguments:?}: {figures:?}", recording.file_name().unwrap().display());
    figures
}

/// Compares the parameters that `suggest` writes with those made by hand.
fn suggested(recording: &Path, by_hand: &Figures, truth: &[Vec<Option<f64>>]) {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("suggested.yaml");
    let ended = end(laser_profiler(&["suggest", "-o"]).arg(&file).arg(recording));
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let found = measure(recording, &["--params-file", file.to_str().unwrap()], truth);
    assert!(found.right >= by_hand.right - LESS_RIGHT, "{found:?}, by hand {by_hand:?}");
    assert!(found.wrong <= by_hand.wrong + MORE_WRONG, "{found:?}, by hand {by_hand:?}");
}

fn parameter_file(name: &str) -> String {
    format!("{}/launch_configs/{name}", env!("CARGO_MANIFEST_DIR"))
}

#[test]
fn a_thin_line_in_a_bright_room() {
    let Some(recording) = real("turntable_empty") else { return };
    let images = messages(&recording, "/camera/image_raw");
    let pictures: Vec<_> = images.iter().map(|message| Picture::grey(message)).collect();
    // The disk turns, the line on it does not.
    let truth = vec![still(&pictures).line(12.0); pictures.len()];
    let found =
        measure(&recording, &["--params-file", &parameter_file("bright_ambient.yaml")], &truth);
    assert!(found.right > 0.965 && found.wrong < 0.015, "{found:?}");
    assert!(found.roughness_px < 0.12 && found.jumps < 3.0, "{found:?}");
    suggested(&recording, &found, &truth);
    let plain = measure(&recording, &["--ros-args", "-p", "stripe_direction:=vertical"], &truth);
    assert!(plain.right < 0.1, "the measure distinguishes good from bad: {plain:?}");
}

#[test]
fn a_halo_and_a_wall_behind() {
    let Some(recording) = real("turntable_object") else { return };
    let images = messages(&recording, "/camera/image_raw");
    let truth: Vec<_> = images.iter().map(|message| Picture::grey(message).line(25.0)).collect();
    let found =
        measure(&recording, &["--params-file", &parameter_file("halo_and_wall.yaml")], &truth);
    assert!(found.right > 0.975 && found.wrong < 0.015, "{found:?}");
    assert!(found.roughness_px < 0.12 && found.jumps < 4.0, "{found:?}");
    suggested(&recording, &found, &truth);
}

#[test]
fn strong_noise_and_blocks_that_hide_the_line() {
    let Some(recording) = real("robot_floor") else { return };
    let images = messages(&recording, "/camera/image_raw/compressed");
    let truth: Vec<_> = images.iter().map(|message| Picture::red(message).line(25.0)).collect();
    let found =
        measure(&recording, &["--params-file", &parameter_file("noisy_floor.yaml")], &truth);
    assert!(found.right > 0.99 && found.wrong < 0.003, "{found:?}");
    assert!(found.roughness_px < 0.1 && found.jumps < 2.0, "{found:?}");
    suggested(&recording, &found, &truth);
}

/// No file was made by hand for these: that of the nearest scene stands for it. The board is half in the dark, and its line
/// leaves the picture.
#[test]
fn suggested_parameters_of_other_scenes() {
    let bright = parameter_file("bright_ambient.yaml");
    if let Some(recording) = real("turntable_checkerboard_laser") {
        let images = messages(&recording, "/camera/image_raw/compressed");
        let truth: Vec<_> =
            images.iter().map(|message| Picture::green(message).line(25.0)).collect();
        let by_hand = measure(&recording, &["--params-file", &bright], &truth);
        suggested(&recording, &by_hand, &truth);
    }
    let Some(stripes) = real("stripes") else { return };
    let groups = [
        ("turntable_obj", "halo_and_wall.yaml"),
        ("board", "bright_ambient.yaml"),
        ("wood", "noisy_floor.yaml"),
    ];
    for (name, file) in groups {
        let mut files: Vec<_> =
            std::fs::read_dir(&stripes).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.retain(|path| path.to_string_lossy().contains(name));
        files.sort();
        let truth: Vec<_> = files
            .iter()
            .map(|path| {
                let picture = Picture::file(path);
                let picture = if name == "wood" { picture } else { picture.turned() };
                picture.line(25.0)
            })
            .collect();
        let pattern = stripes.join(format!("*{name}*.png"));
        let by_hand = measure(&pattern, &["--params-file", &parameter_file(file)], &truth);
        suggested(&pattern, &by_hand, &truth);
    }
}
