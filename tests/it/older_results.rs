//! Profiles with the calibration's uncertainty, and results that older versions recorded without it.

use std::{
    fs,
    path::{Path, PathBuf},
};

use laser_profiler::{
    bag::{
        Attachment, BagReader, Compression, Filter, ReadOptions, RecordOptions, Recorder, Times,
        Topic,
    },
    msg::{cdr, laser_profiler_msgs::Profile, schema::Message as _},
};
use serde_json::Value as Json;

use crate::{
    program::{Ended, end, laser_profiler, replay},
    recordings::render_flat,
};

const FRAMES: u64 = 12;
const PROFILES: &str = "/laser_profiler/profile";
/// Type hash of profiles before `calibration_sigma_z`.
const FORMER_HASH: &str = "RIHS01_6ae9c3a296bad0a4be78cf73576c8a554044f25f2fb0d33e021a3b74d0342220";

/// A distance of the laser plane that is uncertain by a millimetre of 250, and a focal length by one of 600 pixels.
const QUALITY: &str = "
camera_quality: {rms_px: 0.1, views_used: 20, views_rejected: 0, parameters: [fx, fy], covariance: [1.0, 0.0, 0.0, 1.0]}
plane_quality: {rms_m: 0.0001, boards_used: 20, covariance: [1.0e-8, 0.0, 0.0, 0.0, 1.0e-8, 0.0, 0.0, 0.0, 1.0e-6]}
";

/// Returns the calibration file's text, and the results of a flat.
fn results(directory: &Path) -> (String, PathBuf) {
    let [bag, file, out] = ["flat", "uncertain.yaml", "results"].map(|name| directory.join(name));
    render_flat(FRAMES, &bag);
    let known = fs::read_to_string(bag.join("calibration.yaml")).unwrap();
    let text = format!("{}{QUALITY}", known.trim_end());
    fs::write(&file, &text).unwrap();
    let calibration = format!("calibration_file:={}", file.display());
    let motion = ["-p", "motion.source:=constant", "-p", "motion.step:=0.001"];
    let arguments = [&["--ros-args", "-p", calibration.as_str()][..], &motion].concat();
    replay(&bag, &out, 0, &arguments);
    (text, out)
}

/// Copies results with profiles of another definition, whose messages end `cut` bytes earlier.
fn copied(
    from: &Path,
    to: &Path,
    calibration: &str,
    cut: impl Fn(&Profile<'_>) -> usize,
    edit: impl Fn(&mut Topic),
) {
    let reader = BagReader::open(from, &ReadOptions::default()).unwrap();
    let options = RecordOptions { compression: Compression::None, force: false };
    let mut recorder = Recorder::create(to, options).unwrap();
    let attachment = Attachment {
        name: "calibration.yaml".into(),
        media_type: "application/yaml".into(),
        log_time_ns: 0,
        create_time_ns: 0,
        data: calibration.as_bytes().to_vec(),
    };
    recorder.attach(&attachment).unwrap();
    let mut ids = std::collections::BTreeMap::new();
    for topic in reader.topics() {
        let mut topic = Topic::clone(topic);
        if topic.name == PROFILES {
            edit(&mut topic);
        }
        ids.insert(topic.name.clone(), recorder.add_topic(&topic).unwrap());
    }
    for message in reader.messages(&Filter::all()) {
        let message = message.unwrap();
        let cut = match message.topic.name.as_str() {
            PROFILES => cut(&cdr::decode(&message.data).unwrap()),
            _ => 0,
        };
        let (log_ns, publish_ns) = (message.log_time_ns, message.publish_time_ns);
        let times = Times { log_ns, publish_ns, sequence: message.sequence };
        let bytes = &message.data[..message.data.len() - cut];
        recorder.write(ids[&message.topic.name], times, bytes).unwrap();
    }
    recorder.finish().unwrap();
}

/// As older versions recorded: without the last array.
fn as_before(from: &Path, to: &Path, calibration: &str) {
    let array_bytes = |profile: &Profile<'_>| 4 + 4 * profile.calibration_sigma_z.len();
    copied(from, to, calibration, array_bytes, |topic| {
        let text = String::from_utf8(topic.schema.clone()).unwrap();
        let former = text.replace("float32[] calibration_sigma_z\n", "");
        assert!(former.len() < text.len());
        topic.schema = former.into_bytes();
        FORMER_HASH.clone_into(&mut topic.type_hash);
    });
}

fn run(arguments: &[&str]) -> Ended {
    end(&mut laser_profiler(arguments))
}

fn csv(bag: &Path, code: i32) -> (Vec<Vec<String>>, String) {
    let file = bag.with_extension("csv");
    let ended = run(&["export", &bag.display().to_string(), "-o", &file.display().to_string()]);
    assert_eq!(ended.code, Some(code), "{ended:?}");
    let text = fs::read_to_string(&file).unwrap();
    (text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect(), ended.stderr)
}

fn plane(bag: &Path) -> Json {
    let ended = run(&["measure", "plane", &bag.display().to_string(), "--json"]);
    assert_eq!(ended.code, Some(0), "{ended:?}");
    serde_json::from_str(&ended.stdout).unwrap()
}

#[test]
fn profiles_state_the_calibrations_share_and_csv_has_it() {
    let directory = tempfile::tempdir().unwrap();
    let (_, results) = results(directory.path());
    let reader = BagReader::open(&results, &ReadOptions::default()).unwrap();
    let mut num = 0;
    for message in reader.messages(&Filter::topics([PROFILES])) {
        let message = message.unwrap();
        let profile: Profile<'_> = cdr::decode(&message.data).unwrap();
        assert_eq!(profile.calibration_sigma_z.len(), profile.z.len());
        for (z, sigma) in profile.z.iter().zip(profile.calibration_sigma_z.iter()) {
            // A plane that is off by 1 mm of 250 mm moves the origin, where the optical axis meets it, not the height beside
            // it; its tilt of 0.1 mrad moves what is 10 mm beside it by micrometres.
            assert_eq!(z.is_nan(), sigma.is_nan());
            assert!(sigma.is_nan() || (1e-8..1e-3).contains(sigma), "{sigma}");
            num += usize::from(z.is_finite());
        }
    }
    assert!(num > 2000, "{num}");
    let (lines, _) = csv(&results, 0);
    assert_eq!(lines[0].last().unwrap(), "calibration_sigma_z_m");
    assert_eq!(lines.len(), num + 1);
    let is_stated = |line: &Vec<String>| line.last().unwrap().parse::<f64>().unwrap() > 0.0;
    assert!(lines[1..].iter().all(is_stated));
}

#[test]
fn results_of_older_versions_are_read_as_before() {
    let directory = tempfile::tempdir().unwrap();
    let (calibration, now) = results(directory.path());
    let before = directory.path().join("before");
    as_before(&now, &before, &calibration);
    let ((now_lines, _), (before_lines, _)) = (csv(&now, 0), csv(&before, 0));
    assert_eq!(now_lines.len(), before_lines.len());
    for (now, before) in now_lines.iter().zip(&before_lines).skip(1) {
        let last = now.len() - 1;
        assert_eq!(now[..last], before[..last]);
        assert_eq!(before[last], "NaN");
    }
    assert_eq!(plane(&now), plane(&before), "measure adds the calibration's share itself");
    let [now, before] = [&now, &before].map(|path| path.display().to_string());
    let page = directory.path().join("page.html").display().to_string();
    assert_eq!(run(&["report", &before, "-o", &page]).code, Some(0));
    let compared = run(&["compare", &now, &before, "--json"]);
    let compared: Json = serde_json::from_str(&compared.stdout).unwrap();
    let largest = compared["um"]["largest"].as_f64().unwrap();
    assert!(largest < 1e-9, "{compared}");
}

#[test]
fn profiles_of_an_unknown_definition_are_refused_by_name() {
    let directory = tempfile::tempdir().unwrap();
    let (calibration, now) = results(directory.path());
    let other = directory.path().join("other");
    copied(
        &now,
        &other,
        &calibration,
        |_| 0,
        |topic| {
            let text = String::from_utf8(topic.schema.clone()).unwrap();
            let swapped = text.replace("float32[] x\nfloat32[] z\n", "float32[] z\nfloat32[] x\n");
            assert!(swapped != text && topic.type_hash == Profile::TYPE.hash);
            topic.schema = swapped.into_bytes();
            topic.type_hash = format!("RIHS01_{}", "0".repeat(64));
        },
    );
    let (lines, stderr) = csv(&other, 3);
    assert_eq!(lines.len(), 1, "no point: x and z would be swapped");
    assert!(stderr.contains("laser_profiler_msgs/msg/Profile is defined diff"), "{stderr}");
}
