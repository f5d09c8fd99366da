//! `compare` on results whose difference is known.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use laser_profiler::{
    bag::{Compression, MetadataRecord, RecordOptions, Recorder, Times},
    msg::{
        builtin_interfaces::Time,
        cdr,
        laser_profiler_msgs::{Centerline, Profile},
        schema::Message as _,
        std_msgs::Header,
    },
    scanner::stripe::flag,
};
use serde_json::Value as Json;

use super::{all, data, needs_no_network, report, results, run, text, unpacked};
use crate::recordings::{stamp_ns, topic};

const FRAMES: usize = 40;
const COLUMNS: usize = 200;

/// Results of a recording: centrelines and profiles after `edit`, which receives the frame's number.
fn record(
    directory: &Path,
    input: &str,
    edit: impl Fn(usize, &mut Centerline<'_>, &mut Profile<'_>),
) -> PathBuf {
    let options = RecordOptions { compression: Compression::None, force: false };
    let mut recorder = Recorder::create(directory, options).unwrap();
    let entries = [("input", input), ("input_topic", "/image_raw"), ("version", "1.2.3")];
    let entries = entries.map(|(key, text)| (key.to_owned(), text.to_owned()));
    let name = "laser_profiler".to_owned();
    recorder.metadata(&MetadataRecord { name, entries: BTreeMap::from(entries) }).unwrap();
    let topics = [
        ("/laser_profiler/centerline", Centerline::TYPE),
        ("/laser_profiler/profile", Profile::TYPE),
    ];
    let ids = topics.map(|(name, kind)| recorder.add_topic(&topic(name, kind)).unwrap());
    for number in 0..FRAMES {
        let header = || Header { stamp: Time::from_ns(stamp_ns(number)), frame_id: "".into() };
        let u: Vec<f32> = (0..COLUMNS).map(|column| column as f32).collect();
        let v = u.iter().map(|u| 50.0 + 0.125 * u + (number % 5) as f32).collect::<Vec<_>>();
        let mut line = Centerline {
            header: header(),
            image_width: COLUMNS as u32,
            image_height: 100,
            stripe_direction: Centerline::STRIPE_HORIZONTAL,
            v: v.into(),
            u: u.into(),
            stripe_start: vec![0].into(),
            sigma: vec![0.02; COLUMNS].into(),
            flags: vec![0; COLUMNS].into(),
            ..Centerline::default()
        };
        line.roi.width = COLUMNS as u32;
        line.roi.height = 100;
        let z = vec![0.001; COLUMNS].into();
        let mut profile = Profile { header: header(), z, ..Profile::default() };
        edit(number, &mut line, &mut profile);
        let times = Times { log_ns: stamp_ns(number), publish_ns: 0, sequence: number as u32 + 1 };
        let mut bytes = Vec::new();
        cdr::encode(&line, &mut bytes).unwrap();
        recorder.write(ids[0], times, &bytes).unwrap();
        cdr::encode(&profile, &mut bytes).unwrap();
        recorder.write(ids[1], times, &bytes).unwrap();
    }
    recorder.finish().unwrap();
    directory.to_owned()
}

fn compared(a: &Path, b: &Path) -> Json {
    let ended = run("compare", &[a, b], &["--json"]);
    assert_eq!(ended.code, Some(0), "{ended:?}");
    serde_json::from_str(&ended.stdout).unwrap()
}

fn near(json: &Json, expected: f64, limit: f64) {
    let value = json.as_f64().unwrap();
    assert!((value - expected).abs() <= limit, "{value}, not {expected}");
}

#[test]
fn compare_finds_a_known_shift() {
    let directory = tempfile::tempdir().unwrap();
    let [a, b] = ["a", "b"].map(|name| directory.path().join(name));
    record(&a, "one", |_, _, _| {});
    record(&b, "one", |number, line, profile| {
        line.v.to_mut().iter_mut().for_each(|v| *v += 0.25);
        profile.z.to_mut().iter_mut().for_each(|z| *z += 10e-6);
        if number == 17 {
            line.v.to_mut()[120] += 4.0;
            line.flags.to_mut()[30] |= flag::SATURATED;
        }
        if number == 3 {
            // The last ten points are missing.
            let keep = COLUMNS - 10;
            line.u.to_mut().truncate(keep);
            line.v.to_mut().truncate(keep);
            line.flags.to_mut().truncate(keep);
            line.sigma.to_mut().truncate(keep);
        }
    });
    let reported = compared(&a, &b);
    let points = FRAMES * COLUMNS - 10;
    assert_eq!(
        (reported["frames"].as_u64(), reported["points"].as_u64()),
        (Some(40), Some(points as u64))
    );
    near(&reported["px"]["bias"], 0.25 + 4.0 / points as f64, 1e-6);
    near(&reported["px"]["median"], 0.25, 1.0 / 4096.0);
    near(&reported["px"]["p95"], 0.25, 1.0 / 4096.0);
    near(&reported["px"]["robust"], 0.0, 1.0 / 2048.0);
    near(&reported["px"]["largest"], 4.25, 1e-5);
    near(&reported["um"]["bias"], 10.0, 0.1);
    assert_eq!(reported["a"]["points_only"], 10);
    assert_eq!(reported["b"]["points_only"], 0);
    assert_eq!(reported["flags"]["saturated"], serde_json::json!([0, 1]));
    let worst = &reported["frames_worst"][0];
    assert_eq!((&worst["frame"], &worst["worst_section"]), (&Json::from(17), &Json::from(120)));
    assert_eq!(reported["sections_worst"][0]["section"], 120);
    let same = compared(&a, &a);
    assert_eq!(same["px"]["largest"], 0.0);
    assert!(same["frames_worst"].as_array().unwrap().is_empty());

    let fails =
        |limit: &str, a: &Path, b: &Path| run("compare", &[a, b], &["--fail-above", limit]).code;
    assert_eq!(fails("0", &a, &a), Some(0));
    assert_eq!(fails("4.2", &a, &b), Some(1));
    assert_eq!(fails("5", &a, &b), Some(1), "points are missing in B");
    let terminal = run("compare", &[&a, &b], &[]);
    assert!(
        terminal.stdout.contains("0.2505") && terminal.stdout.contains("10 only in A"),
        "{terminal:?}"
    );
}

#[test]
fn results_of_other_recordings_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let [a, b] = ["a", "b"].map(|name| directory.path().join(name));
    record(&a, "one", |_, _, _| {});
    record(&b, "two", |_, _, _| {});
    let refused = run("compare", &[&a, &b], &[]);
    assert_eq!(refused.code, Some(1), "{refused:?}");
    assert!(
        refused.stderr.contains("\"two\"") && refused.stderr.contains("--force"),
        "{refused:?}"
    );
    assert_eq!(run("compare", &[&a, &b], &["--force"]).code, Some(0));
    let c = directory.path().join("c");
    record(&c, "one", |_, line, _| line.header.stamp.sec += 1000);
    let apart = run("compare", &[&a, &c], &[]);
    assert!(apart.code == Some(1) && apart.stderr.contains("no frame is in both"), "{apart:?}");
}

#[test]
fn the_page_lists_differing_parameters() {
    let directory = tempfile::tempdir().unwrap();
    let [first, second] = ["first", "second"].map(|name| directory.path().join(name));
    let a = results(&first, &[]);
    let b = results(&second, &["--ros-args", "-p", "extraction.blur_radius:=5"]);
    let page = directory.path().join("compare.html");
    let more = ["-o", page.to_str().unwrap(), "--json"];
    let ended = run("compare", &[&a, &b], &more);
    assert_eq!(ended.code, Some(0), "{ended:?}");
    let reported: Json = serde_json::from_str(&ended.stdout).unwrap();
    let reasons: Vec<_> = reported["reasons"]
        .as_array()
        .unwrap()
        .iter()
        .map(|reason| {
            (
                reason["what"].as_str().unwrap(),
                reason["a"].as_str().unwrap(),
                reason["b"].as_str().unwrap(),
            )
        })
        .collect();
    assert!(reasons.contains(&("extraction.blur_radius", "3", "5")), "{reasons:?}");
    assert!(
        reported["px"]["rms"].as_f64().unwrap() > 0.0
            && reported["um"]["num"].as_u64().unwrap() > 1000
    );
    let html = std::fs::read_to_string(page).unwrap();
    needs_no_network(&html);
    let html = scraper::Html::parse_document(&html);
    assert!(text(&html, "table").contains("extraction.blur_radius"));
    assert_eq!(all(&html, "#height-map, #section-across, #section-along, #readout").len(), 4);
    // The map is that of the differences: its mean square is that of the answer.
    let (_, [_, _, differences]) = unpacked(&html);
    let known: Vec<f64> = differences.into_iter().filter(|d| d.is_finite()).collect();
    assert_eq!(known.len() as u64, reported["points"].as_u64().unwrap());
    let rms = (known.iter().map(|d| d * d).sum::<f64>() / known.len() as f64).sqrt();
    near(&reported["px"]["rms"], rms, 1e-4);
    let colors = &data(&html)["map"]["grid"]["colors"];
    near(&colors[0], -colors[1].as_f64().unwrap(), 1e-12);
    // And a result is no result of its own recording.
    let (_, report) = report(&a, 0, &[]);
    assert_eq!(report["lost"], 0);
}
