//! `report` and `compare`: pages as a browser parses them, with the data of the recording in them.

mod compare;

use std::path::{Path, PathBuf};

use base64::{Engine as _, engine::general_purpose::STANDARD};
use laser_profiler::{
    bag::{
        BagReader, Compression, Filter, RawMessage, ReadOptions, RecordOptions, Recorder, Times,
    },
    msg::{
        cdr,
        convert::cloud,
        laser_profiler_msgs::Centerline,
        schema::Message as _,
        sensor_msgs::{Image, PointCloud2},
    },
    scanner::scan::{Point, Slice},
};
use rand::{RngExt as _, SeedableRng};
use rand_chacha::ChaCha8Rng;
use scraper::{ElementRef, Html, Selector};
use serde_json::Value as Json;

use crate::{
    program::{Ended, end, laser_profiler, replay},
    recordings::{bundled, good_images, record_images, topic},
};

const PARAMETERS: [&str; 2] = ["--params-file", "bags/film_defects.params.yaml"];

/// The results of the bundled recording, in a directory of one's own.
fn results(directory: &Path, more: &[&str]) -> PathBuf {
    let output = directory.join("results");
    replay(&bundled("film_defects"), &output, 3, &[&PARAMETERS[..], more].concat());
    output
}

fn run(verb: &str, paths: &[&Path], more: &[&str]) -> Ended {
    let mut command = laser_profiler(&[verb]);
    end(command.args(paths).args(more))
}

/// Writes a page; the exit code must be `code`.
fn report(bag: &Path, code: i32, more: &[&str]) -> (Html, Json) {
    let directory = tempfile::tempdir().unwrap();
    let page = directory.path().join("page.html");
    let output = page.display().to_string();
    let ended = run("report", &[bag], &[&["-o", &output, "--json"], more].concat());
    assert_eq!(ended.code, Some(code), "{ended:?}");
    let html = std::fs::read_to_string(page).unwrap();
    needs_no_network(&html);
    (Html::parse_document(&html), serde_json::from_str(&ended.stdout).unwrap())
}

fn all<'a>(html: &'a Html, selector: &str) -> Vec<ElementRef<'a>> {
    html.select(&Selector::parse(selector).unwrap()).collect()
}

fn text(html: &Html, selector: &str) -> String {
    all(html, selector).iter().flat_map(ElementRef::text).collect()
}

fn data(html: &Html) -> Json {
    serde_json::from_str(&text(html, "#report-data")).unwrap()
}

/// The page loads nothing: everything that an element or a style refers to is inside it.
fn needs_no_network(html: &str) {
    let page = Html::parse_document(html);
    for element in all(&page, "[src], [href], [data], [action], [poster], [srcset]") {
        for (name, value) in element.value().attrs() {
            let refers = ["src", "href", "data", "action", "poster", "srcset"].contains(&name);
            assert!(!refers || value.starts_with("data:"), "{name}={value}");
        }
    }
    assert!(all(&page, "iframe, object, embed, link[rel=stylesheet]").is_empty());
    for style in all(&page, "style") {
        let style: String = style.text().collect();
        assert!(!style.contains("url(") && !style.contains("@import"));
    }
    let policy = all(&page, "meta[http-equiv=Content-Security-Policy]");
    assert!(policy[0].attr("content").unwrap().starts_with("default-src 'none'"));
}

/// x, y and z of the page's map in metres, by the format's description alone.
fn unpacked(html: &Html) -> (usize, [Vec<f64>; 3]) {
    let grid = &data(html)["map"]["grid"];
    let size = |key: &str| grid[key].as_u64().unwrap() as usize;
    let (rows, columns) = (size("rows"), size("columns"));
    let packed = STANDARD.decode(text(html, "#map-data").trim()).unwrap();
    let bytes = miniz_oxide::inflate::decompress_to_vec_zlib(&packed).unwrap();
    assert_eq!(bytes.len(), 6 * rows * columns);
    let number = |axis: usize, key: &str| grid["scales"][axis][key].as_f64().unwrap();
    let axes = [0, 1, 2].map(|axis| {
        let plane = &bytes[2 * axis * rows * columns..][..2 * rows * columns];
        let (low, high) = plane.split_at(rows * columns);
        let mut codes: Vec<i16> =
            low.iter().zip(high).map(|(low, high)| i16::from_le_bytes([*low, *high])).collect();
        for at in columns..codes.len() {
            codes[at] = codes[at].wrapping_add(codes[at - columns]);
        }
        let value = |code: &i16| {
            let is_missing = i64::from(*code) == grid["missing"].as_i64().unwrap();
            let value = number(axis, "offset") + number(axis, "step") * f64::from(*code);
            if is_missing { f64::NAN } else { value }
        };
        codes.iter().map(value).collect()
    });
    (columns, axes)
}

fn messages(bag: &Path, topic: &str) -> Vec<RawMessage> {
    let reader = BagReader::open(bag, &ReadOptions::default()).unwrap();
    reader.messages(&Filter::topics([topic])).map(Result::unwrap).collect()
}

#[test]
fn the_page_holds_the_heights_of_the_recording() {
    let directory = tempfile::tempdir().unwrap();
    let results = results(directory.path(), &[]);
    let (html, reported) = report(&results, 0, &[]);
    for id in ["height-map", "section-across", "section-along", "readout"] {
        assert_eq!(all(&html, &format!("#{id}")).len(), 1, "{id}");
    }
    let map = all(&html, "canvas#height-map")[0].value();
    assert!(map.attr("tabindex") == Some("0") && map.attr("aria-label").is_some());
    let (columns, axes) = unpacked(&html);
    let mut at = 0;
    let scales = data(&html)["map"]["grid"]["scales"].clone();
    let steps = [0, 1, 2].map(|axis| scales[axis]["step"].as_f64().unwrap());
    assert!(steps[2] < 1e-6, "steps of less than a micrometre: {steps:?}");
    for message in messages(&results, "/laser_profiler/points") {
        let cloud: PointCloud2<'_> = cdr::decode(&message.data).unwrap();
        assert_eq!((cloud.width as usize, cloud.point_step), (columns, 16));
        for point in cloud.data.chunks_exact(16) {
            for (axis, bytes) in point.as_chunks::<4>().0[..3].iter().enumerate() {
                let (found, truth) = (axes[axis][at], f64::from(f32::from_le_bytes(*bytes)));
                let step = steps[axis].mul_add(0.5, 1e-9);
                assert!(found.is_nan() == truth.is_nan(), "{axis} {at}");
                assert!(truth.is_nan() || (found - truth).abs() <= step, "{found} {truth}");
            }
            at += 1;
        }
    }
    assert_eq!(at, axes[2].len(), "all of them");
    assert_eq!((reported["rows"].as_u64(), reported["frames"].as_u64()), (Some(147), Some(147)));
    assert_eq!(reported["lost_frames"], 3);
    assert!(text(&html, "#documents").contains("min_segment_area"), "the parameters");
    assert!(
        text(&html, "#documents").contains("of_laser")
            || text(&html, "#documents").contains("type:")
    );
    let facts = text(&html, "#facts");
    assert!(facts.contains("147") && facts.contains("px"), "{facts}");
}

#[test]
fn frames_lie_under_their_centrelines() {
    let directory = tempfile::tempdir().unwrap();
    let results = results(directory.path(), &[]);
    let images = bundled("film_defects").display().to_string();
    let more = ["--images", &images, "--frames", "0,70,9999"];
    let (html, reported) = report(&results, 0, &more);
    let notes = reported["notes"].to_string();
    assert!(notes.contains("9999") && notes.contains("0 to 146"), "{notes}");
    let frames = all(&html, "#frames figure");
    assert_eq!(frames.len(), 2);
    let lines = messages(&results, "/laser_profiler/centerline");
    let pictures = messages(&bundled("film_defects"), "/camera/image_raw");
    for (frame, number) in frames.iter().zip([0, 70]) {
        let line: Centerline<'_> = cdr::decode(&lines[number].data).unwrap();
        let select =
            |selector: &str| frame.select(&Selector::parse(selector).unwrap()).collect::<Vec<_>>();
        let drawn: Vec<[f32; 2]> = select("polyline")
            .iter()
            .flat_map(|strip| strip.attr("points").unwrap().split(' '))
            .map(|point| point.split_once(',').unwrap())
            .map(|(u, v)| [u.parse().unwrap(), v.parse().unwrap()])
            .collect();
        let is_drawn = |(u, v): (&f32, &f32)| {
            drawn.iter().any(|place| (place[0] - u).abs() < 1e-3 && (place[1] - v).abs() < 1e-3)
        };
        assert!(line.u.iter().zip(line.v.iter()).all(is_drawn), "frame {number}");
        let address = select("image")[0].attr("href").unwrap();
        let png = STANDARD.decode(address.strip_prefix("data:image/png;base64,").unwrap()).unwrap();
        let shown = image::load_from_memory(&png).unwrap().to_luma8();
        let recorded = pictures.iter().find_map(|message| {
            let image: Image<'_> = cdr::decode(&message.data).unwrap();
            (image.header.stamp == line.header.stamp).then(|| image.data.to_vec())
        });
        assert_eq!(shown.into_raw(), recorded.unwrap(), "the image as it was recorded");
    }
}

#[test]
fn missing_parts_are_named_and_the_rest_is_shown() {
    let directory = tempfile::tempdir().unwrap();
    // No images: the frames are shown without.
    let results = results(directory.path(), &[]);
    let (html, reported) = report(&results, 0, &[]);
    assert!(reported["notes"].to_string().contains("--images"), "{reported}");
    assert_eq!(all(&html, "#frames figure").len(), 4);
    assert!(all(&html, "#frames image").is_empty() && text(&html, "#notes").contains("--images"));
    // No results at all.
    let (html, reported) = report(&bundled("film_defects"), 0, &[]);
    let notes = reported["notes"].to_string();
    for missing in ["no centrelines", "no height map"] {
        assert!(notes.contains(missing), "{notes}");
    }
    assert!(text(&html, "table").contains("/camera/image_raw"), "its topics are there");
    // No calibration: where the stripe was in the image.
    let [input, plain] = ["in", "plain"].map(|name| directory.path().join(name));
    record_images(&input, &good_images(5));
    replay(&input, &plain, 0, &[]);
    let (html, reported) = report(&plain, 0, &[]);
    assert!(reported["notes"].to_string().contains("no height map"), "{reported}");
    let (columns, [_, frames, rows]) = unpacked(&html);
    assert_eq!((columns, rows.len()), (160, 800));
    assert!(rows.iter().all(|row| (row - 10.0).abs() < 1e-3), "the row of the stripe");
    assert!((frames[799] - 4.0).abs() < 1e-3);
}

#[test]
fn lost_frames_are_counted_and_the_rest_is_shown() {
    let directory = tempfile::tempdir().unwrap();
    let whole = results(directory.path(), &[]).join("results_0.mcap");
    let bytes = std::fs::read(whole).unwrap();
    let cut = directory.path().join("cut.mcap");
    std::fs::write(&cut, &bytes[..bytes.len() * 6 / 10]).unwrap();
    let (html, reported) = report(&cut, 3, &[]);
    let frames = reported["frames"].as_u64().unwrap();
    assert!((20..147).contains(&frames) && reported["lost"].as_u64().unwrap() > 0, "{reported}");
    assert!(text(&html, "#notes").contains("cut.mcap"));
    assert!(!all(&html, "#chart-sigma").is_empty(), "the quality of what is left");
    let text_file = directory.path().join("text.mcap");
    std::fs::write(&text_file, "no recording").unwrap();
    let ended = run("report", &[&text_file], &["-o", "/nowhere/page.html"]);
    assert!(ended.code == Some(1) && ended.stderr.contains("text.mcap"), "{ended:?}");
}

#[test]
fn figures_are_files_too_and_nothing_is_replaced_unasked() {
    let directory = tempfile::tempdir().unwrap();
    let results = results(directory.path(), &[]);
    let plots = directory.path().join("figures");
    let page = directory.path().join("page.html").display().to_string();
    let more = ["--plots", plots.to_str().unwrap(), "--frames", "3", "-o", &page];
    let ended = run("report", &[&results], &more);
    assert_eq!(ended.code, Some(0), "{ended:?}");
    for file in ["sigma.svg", "width.svg", "section_across.svg", "section_along.svg", "frame_3.svg"]
    {
        let svg = std::fs::read_to_string(plots.join(file)).unwrap();
        assert!(svg.starts_with("<svg") && !svg.contains("NaN"), "{file}");
    }
    let map = image::open(plots.join("height_map.png")).unwrap();
    assert!(map.width() > 300 && map.height() > 300);
    let again = run("report", &[&results], &["-o", &page]);
    assert!(again.code == Some(1) && again.stderr.contains("--force"), "{again:?}");
    assert_eq!(run("report", &[&results], &["-o", &page, "--force"]).code, Some(0));
    assert_eq!(run("report", &[&results], &[]).code, Some(2), "no output is requested");
}

/// 20 mm of height in steps of 0.3 µm, noise of 10 µm: no profile is like the one before.
#[test]
fn a_page_of_a_thousand_wide_profiles_is_small() {
    let directory = tempfile::tempdir().unwrap();
    let bag = directory.path().join("wide");
    let mut random = ChaCha8Rng::seed_from_u64(6);
    let options = RecordOptions { compression: Compression::None, force: false };
    let mut recorder = Recorder::create(&bag, options).unwrap();
    let id = recorder.add_topic(&topic("/laser_profiler/points", PointCloud2::TYPE)).unwrap();
    let mut data = Vec::new();
    for number in 0..10 {
        let points = (0..100 * 2592).map(|at: u32| -> Point {
            let (x, y) = ((at % 2592) as f32, (at / 2592 + 100 * number) as f32);
            let noise: f32 = random.random_range(-1e-5..1e-5);
            let z = 0.02 * (0.003 * x).sin().powi(2) + noise;
            [2e-5 * x * (1.0 + z), 1e-4 * y, z, 0.5]
        });
        let slice =
            Slice { width: 2592, height: 100, points: points.collect(), ..Slice::default() };
        cdr::encode(&cloud::organised("laser_plane", &slice), &mut data).unwrap();
        let log_ns = i64::from(number);
        recorder
            .write(id, Times { log_ns, publish_ns: log_ns, sequence: number + 1 }, &data)
            .unwrap();
    }
    recorder.finish().unwrap();
    let page = directory.path().join("page.html");
    let ended = run("report", &[&bag], &["-o", page.to_str().unwrap(), "--json"]);
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let reported: Json = serde_json::from_str(&ended.stdout).unwrap();
    assert_eq!((&reported["rows"], &reported["columns"]), (&Json::from(1000), &Json::from(2592)));
    let bytes = std::fs::metadata(page).unwrap().len();
    eprintln!("a page of 1000 profiles of 2592 points: {bytes} bytes");
    assert!(bytes < 10_000_000, "{bytes}");
}
