//! `suggest`: the file that it writes finds the line, in rendered pictures and in the bundled recordings, and wrong usage is
//! refused.

mod no_line;

use std::{
    collections::HashMap,
    fs,
    path::{Path, PathBuf},
};

use image::{DynamicImage, GrayImage, ImageBuffer, Luma, Rgb, RgbImage};
use laser_profiler::{
    bag::{BagReader, Filter, ReadOptions},
    msg::{cdr, laser_profiler_msgs::Centerline},
    scanner::{params::StripeDirection, stripe::flag},
};
use serde_json::{Value as Json, json};
use tempfile::TempDir;

use crate::{
    program::{Ended, end, laser_profiler, replay},
    recordings::bundled,
};

/// Cross-sections of the pictures, and their length.
const ALONG: u32 = 320;
const ACROSS: u32 = 240;
const NUM: u32 = 6;
const LIMIT_PX: f64 = 0.2;

/// Pictures with a known line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scene {
    /// From top to bottom.
    Vertical,
    /// 12 bits in samples of 16.
    Deep,
    /// Clipped to white, with a red halo on one side.
    Saturated,
    /// Wide, with a glow on one side that pulls the centre.
    Glowing,
    Dark,
}

/// True centre across the line.
fn center_px(along: f64, number: u32) -> f64 {
    90.0 + 0.05 * along + 2.3 * f64::from(number)
}

/// Values from -1 to 1.
fn noise(x: u32, y: u32) -> f64 {
    f64::from((y * 7919 + x * 104_729) % 101) / 50.0 - 1.0
}

impl Scene {
    fn direction(self) -> StripeDirection {
        match self {
            Self::Vertical => StripeDirection::Vertical,
            Self::Deep | Self::Saturated | Self::Glowing | Self::Dark => {
                StripeDirection::Horizontal
            }
        }
    }

    /// Distance from the line, pixels.
    fn away(self, x: u32, y: u32, number: u32) -> f64 {
        let (along, across) = match self.direction() {
            StripeDirection::Horizontal => (x, y),
            StripeDirection::Vertical => (y, x),
        };
        f64::from(across) - center_px(along.into(), number)
    }

    fn picture(self, number: u32) -> DynamicImage {
        let core = |x, y| {
            let away = self.away(x, y, number);
            (-away * away / 8.0).exp()
        };
        match self {
            Self::Vertical => GrayImage::from_fn(ACROSS, ALONG, |x, y| {
                Luma([(8.0 + 3.0 * noise(x, y) + 180.0 * core(x, y)).round() as u8])
            })
            .into(),
            Self::Deep => ImageBuffer::from_fn(ALONG, ACROSS, |x, y| {
                Luma([(120.0 + 40.0 * noise(x, y) + 2900.0 * core(x, y)).round() as u16])
            })
            .into(),
            Self::Saturated => RgbImage::from_fn(ALONG, ACROSS, |x, y| {
                let away = self.away(x, y, number);
                let halo =
                    if away > 0.0 { 0.5 * (-away / 8.0).exp() } else { 0.25 * (away / 4.0).exp() };
                let light = [(900.0, 200.0), (220.0, 10.0), (230.0, 10.0)];
                Rgb(light.map(|(of_core, of_halo)| {
                    let level = of_core * core(x, y) + of_halo * halo + 2.0 + 2.0 * noise(x, y);
                    level.round() as u8
                }))
            })
            .into(),
            Self::Glowing => GrayImage::from_fn(ALONG, ACROSS, |x, y| {
                let away = self.away(x, y, number);
                let glow = if away > 0.0 { 0.6 * (-away / 10.0).exp() } else { 0.0 };
                let level = 150.0 * ((-away * away / 50.0).exp() + glow);
                Luma([(8.0 + 2.0 * noise(x, y) + level).round() as u8])
            })
            .into(),
            Self::Dark => GrayImage::from_fn(ALONG, ACROSS, |x, y| {
                Luma([(3.0 + 2.0 * noise(x, y)).round() as u8])
            })
            .into(),
        }
    }
}

/// A folder of pictures and what is made of them.
struct Pictures {
    place: TempDir,
}

impl Pictures {
    fn of(scene: Scene) -> Self {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("pictures");
        fs::create_dir(&folder).unwrap();
        for number in 0..NUM {
            scene.picture(number).save(folder.join(format!("{number}.png"))).unwrap();
        }
        Self { place }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.place.path().join(name)
    }

    fn suggest(&self, arguments: &[&str]) -> Ended {
        suggest(&self.path("pictures"), &self.path("rig.yaml"), arguments)
    }
}

fn suggest(recording: &Path, file: &Path, arguments: &[&str]) -> Ended {
    end(laser_profiler(&["suggest", "-o"]).arg(file).arg(recording).args(arguments))
}

/// A centreline: its stamp, and columns and rows of its points.
struct Line {
    stamp_ns: i64,
    u_px: Vec<f32>,
    v_px: Vec<f32>,
}

impl Line {
    /// Place along and across the line of each point.
    fn points(&self, direction: StripeDirection) -> impl Iterator<Item = (u32, f64)> {
        let (along, across) = match direction {
            StripeDirection::Horizontal => (&self.u_px, &self.v_px),
            StripeDirection::Vertical => (&self.v_px, &self.u_px),
        };
        along.iter().zip(across).map(|(&along, &across)| (along as u32, across.into()))
    }
}

/// The centrelines that a replay with the parameter file finds.
fn found(recording: &Path, file: &Path, code: i32) -> Vec<Line> {
    let results = file.with_extension("results");
    replay(recording, &results, code, &["--params-file", file.to_str().unwrap()]);
    lines(&results, "/laser_profiler/centerline")
}

fn lines(bag: &Path, topic: &str) -> Vec<Line> {
    let reader = BagReader::open(bag, &ReadOptions::default()).unwrap();
    let line = |data: &[u8]| {
        let line: Centerline<'_> = cdr::decode(data).unwrap();
        let stamp_ns = line.header.stamp.to_ns();
        Line { stamp_ns, u_px: line.u.into_owned(), v_px: line.v.into_owned() }
    };
    reader.messages(&Filter::topics([topic])).map(|message| line(&message.unwrap().data)).collect()
}

/// The largest of the smallest 95 % of the errors.
fn percentile_95(mut errors: Vec<f64>) -> f64 {
    errors.sort_by(f64::total_cmp);
    errors[errors.len() * 95 / 100]
}

#[test]
fn the_suggested_file_finds_the_line_of_pictures() {
    let cases: [(Scene, &[(&str, Json)]); 3] = [
        (Scene::Vertical, &[("stripe_direction", json!("vertical"))]),
        (Scene::Deep, &[("full_scale", json!(4095))]),
        (Scene::Saturated, &[]),
    ];
    for (scene, expected) in cases {
        let pictures = Pictures::of(scene);
        let suggested = pictures.suggest(&["--json"]);
        assert_eq!(suggested.code, Some(0), "{scene:?}: {suggested:?}");
        let summary: Json = serde_json::from_str(&suggested.stdout).unwrap();
        eprintln!("{scene:?}: {summary}");
        for (name, value) in expected {
            assert_eq!(summary["parameters"][name], *value, "{scene:?}");
        }
        assert!(pictures.path("rig.png").exists(), "the picture of the line");
        if scene == Scene::Saturated {
            let channel = summary["parameters"]["channel"].as_str().unwrap();
            assert!(["green", "blue"].contains(&channel), "red is clipped: {channel}");
        }
        let lines = found(&pictures.path("pictures"), &pictures.path("rig.yaml"), 0);
        assert_eq!(lines.len(), NUM as usize, "{scene:?}");
        for (number, line) in (0..).zip(&lines) {
            let points: Vec<_> = line.points(scene.direction()).collect();
            assert!(points.len() > ALONG as usize * 95 / 100, "{scene:?}: {}", points.len());
            let error =
                |&(along, across): &(u32, f64)| (across - center_px(along.into(), number)).abs();
            let largest_px = points.iter().map(error).fold(0.0, f64::max);
            assert!(largest_px < LIMIT_PX, "{scene:?} {number}: {largest_px} px");
        }
    }
}

/// Numbers are numbers in JSON, and the text of the file is what `--json` states.
#[test]
fn the_bundled_recordings_are_measured_as_their_truth_says() {
    for (name, direction) in [
        ("film_defects", StripeDirection::Horizontal),
        ("saturated_vertical", StripeDirection::Vertical),
    ] {
        let (bag, place) = (bundled(name), tempfile::tempdir().unwrap());
        let file = place.path().join("rig.yaml");
        let suggested = suggest(&bag, &file, &["--json"]);
        assert_eq!(suggested.code, Some(0), "{name}: {suggested:?}");
        let summary: Json = serde_json::from_str(&suggested.stdout).unwrap();
        eprintln!("{name}: {summary}");
        let stated = summary["parameters"]["stripe_direction"].as_str();
        assert_eq!(stated.unwrap_or("horizontal"), direction.name(), "{name}");
        let text = fs::read_to_string(&file).unwrap();
        for (name, value) in summary["parameters"].as_object().unwrap() {
            let key = name.rsplit('.').next().unwrap();
            let shown = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            assert!(text.contains(&format!(" {key}: {shown}\n")), "{key}: {shown} in {text}");
        }
        // Lost frames are in the recordings on purpose.
        let lines = found(&bag, &file, 3);
        let mut truth: HashMap<i64, HashMap<u32, f64>> = HashMap::new();
        for line in self::lines(&bag, "/truth/centerline") {
            truth.insert(line.stamp_ns, line.points(direction).collect());
        }
        let (mut errors, mut sections) = (Vec::new(), 0);
        for line in &lines {
            let truth = &truth[&line.stamp_ns];
            sections += truth.len();
            let error = |(at, across): (u32, f64)| Some((across - truth.get(&at)?).abs());
            errors.extend(line.points(direction).filter_map(error));
        }
        assert!(errors.len() > sections * 8 / 10, "{name}: {} of {sections}", errors.len());
        let error_px = percentile_95(errors);
        assert!(error_px < LIMIT_PX, "{name}: {error_px} px");
    }
}

#[test]
fn a_picture_is_no_parameter_file() {
    let pictures = Pictures::of(Scene::Vertical);
    for name in ["x.png", "x.PNG", "x.jpg", "x.tiff"] {
        let refused = suggest(&pictures.path("pictures"), &pictures.path(name), &[]);
        assert_eq!(refused.code, Some(2), "{name}: {refused:?}");
        assert!(refused.stderr.contains("parameter file in YAML"), "{}", refused.stderr);
        assert!(refused.stderr.contains("x.yaml"), "{}", refused.stderr);
        assert!(!pictures.path(name).exists());
    }
}

#[test]
fn nothing_is_replaced_or_written_without_reason() {
    let pictures = Pictures::of(Scene::Vertical);
    fs::write(pictures.path("rig.png"), "mine").unwrap();
    let refused = pictures.suggest(&[]);
    assert!(refused.code == Some(1) && refused.stderr.contains("--force"), "{refused:?}");
    assert_eq!(fs::read(pictures.path("rig.png")).unwrap(), b"mine");
    let forced = pictures.suggest(&["--force"]);
    assert!(forced.code == Some(0) && forced.stdout.contains("rig.yaml"), "{forced:?}");
    let printed = end(laser_profiler(&["suggest"]).arg(pictures.path("pictures")));
    assert_eq!(printed.code, Some(0), "{printed:?}");
    assert_eq!(printed.stdout, fs::read_to_string(pictures.path("rig.yaml")).unwrap());

    let dark = Pictures::of(Scene::Dark);
    let nothing = dark.suggest(&[]);
    assert_eq!(nothing.code, Some(1), "{nothing:?}");
    assert!(nothing.stderr.contains("no line in 6 frames. Likely reason: "), "{nothing:?}");
    assert!(!dark.path("rig.yaml").exists() && !dark.path("rig.png").exists());
    let missing = suggest(&dark.path("none"), &dark.path("rig.yaml"), &[]);
    assert_eq!(missing.code, Some(1), "{missing:?}");
}

/// One file that cannot be read costs itself only.
#[test]
fn a_broken_picture_is_counted() {
    let pictures = Pictures::of(Scene::Vertical);
    fs::write(pictures.path("pictures/1.png"), b"\x89PNG\r\n\x1a\nno more").unwrap();
    let suggested = pictures.suggest(&["--json"]);
    assert_eq!(suggested.code, Some(0), "{suggested:?}");
    let summary: Json = serde_json::from_str(&suggested.stdout).unwrap();
    assert_eq!((&summary["examined"], &summary["unusable"]), (&json!(NUM - 1), &json!(1)));
}

/// A local background would take the glow away that makes the points doubtful, and leave their error.
#[test]
fn a_line_that_the_defaults_find_is_not_made_to_look_sound() {
    let pictures = Pictures::of(Scene::Glowing);
    assert_eq!(pictures.suggest(&[]).code, Some(0));
    let text = fs::read_to_string(pictures.path("rig.yaml")).unwrap();
    assert!(!text.contains("background"), "{text}");
    let parameters = pictures.path("rig.yaml").display().to_string();
    let results = pictures.path("results");
    let (summary, _) =
        replay(&pictures.path("pictures"), &results, 0, &["--params-file", &parameters]);
    assert_eq!(summary["points"], NUM * ALONG, "{summary}");
    let reader = BagReader::open(&results, &ReadOptions::default()).unwrap();
    for message in reader.messages(&Filter::topics(["/laser_profiler/centerline"])) {
        let message = message.unwrap();
        let line: Centerline<'_> = cdr::decode(&message.data).unwrap();
        let doubted = line.flags.iter().filter(|flags| **flags & flag::MISFIT != 0);
        assert_eq!(doubted.count(), ALONG as usize);
    }
}
