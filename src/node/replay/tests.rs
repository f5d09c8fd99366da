use std::{collections::BTreeMap, fs, path::Path};

use super::*;
use crate::{
    bag::{RawMessage, Recorder, Times, Topic},
    msg::{cdr, geometry_msgs::Vector3, laser_profiler_msgs::Centerline, tf2_msgs::TFMessage},
    node::{source::Input, tests::good},
    ros::{arguments::Assignment, value::Value},
};

/// Time from the publication of an image to its recording.
const DELAY_NS: i64 = 3_000_000;

/// Writes a bag with five frames on each of these topics.
fn recording(directory: &Path, topics: &[&str]) -> PathBuf {
    let mut recorder = Recorder::create(directory, RecordOptions::default()).unwrap();
    for name in topics {
        for number in 1..=5 {
            let Input::Message(message, _) = good(number, i64::from(number) * 500) else {
                unreachable!()
            };
            let mut topic = Topic { name: (*name).to_owned(), ..(*message.topic).clone() };
            if name.ends_with("/compressed") {
                topic.type_name = "sensor_msgs/msg/CompressedImage".to_owned();
            }
            let id = recorder.add_topic(&topic).unwrap();
            let (log_ns, publish_ns) = (message.log_time_ns, message.publish_time_ns - DELAY_NS);
            recorder
                .write(id, Times { log_ns, publish_ns, sequence: number }, &message.data)
                .unwrap();
        }
    }
    recorder.finish().unwrap();
    directory.to_owned()
}

fn request(bags: Vec<PathBuf>, output: &Path) -> ReplayRequest {
    let area = Assignment {
        node: None,
        name: "extraction.min_segment_area".into(),
        value: Value::Integer(20),
    };
    let ros = RosArguments { assignments: vec![area], ..RosArguments::default() };
    ReplayRequest { bags, output: output.to_owned(), ros, ..ReplayRequest::default() }
}

fn replay(request: ReplayRequest) -> Result<Summary, ReplayError> {
    Replay::prepare(request)?.run(&Stop::default(), &mut |_| {})
}

fn messages(bag: &Path) -> BTreeMap<String, Vec<RawMessage>> {
    let bag = BagReader::open(bag, &ReadOptions::default()).unwrap();
    let mut by_topic = BTreeMap::<_, Vec<_>>::new();
    for message in bag.messages(&Filter::all()) {
        let message = message.unwrap();
        by_topic.entry(message.topic.name.clone()).or_default().push(message);
    }
    by_topic
}

#[test]
fn the_results_bag_is_self_contained() {
    let place = tempfile::tempdir().unwrap();
    let input = recording(&place.path().join("input"), &["/cam/image_raw"]);
    let calibration = "type: vertical_incidence\nframe_id: laser\nimage_distance_m: 0.05\nobject_distance_m: 0.5\n\
                       beta_rad: 0.6\npixel_pitch_m: 5.0e-6\nbase_row_px: 16.0\ncenter_column_px: 32.0\nheight_sign: -1\n";
    fs::write(place.path().join("c.yaml"), calibration).unwrap();
    let output = place.path().join("results");
    let mut request = request(vec![input], &output);
    request.with_images = true;
    request.ros.assignments.push(Assignment {
        node: None,
        name: "calibration_file".into(),
        value: Value::Text(place.path().join("c.yaml").to_str().unwrap().to_owned()),
    });
    assert_eq!(replay(request).unwrap().counts.processed, 5);

    let bag = BagReader::open(&output, &ReadOptions::default()).unwrap();
    assert!(
        bag.topics()
            .iter()
            .all(|topic| topic.type_hash.starts_with("RIHS01_") && !topic.qos.is_empty()
                || topic.name == "/cam/image_raw")
    );
    let record = bag.metadata().map(Result::unwrap).find(|record| record.name == "laser_profiler");
    let entries = record.unwrap().entries;
    assert_eq!(entries["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!((&*entries["input"], &*entries["input_topic"]), ("input", "/cam/image_raw"));
    assert!(entries["parameters"].contains("extraction.min_segment_area: 20"));
    assert!(!entries["parameters"].contains(place.path().to_str().unwrap()), "no absolute paths");
    let attached = bag.attachments().next().unwrap().unwrap();
    assert_eq!((&*attached.name, &*attached.data), ("calibration.yaml", calibration.as_bytes()));

    let results = messages(&output);
    let count = |name: &str| results.get(name).map_or(0, Vec::len);
    assert_eq!(count("/laser_profiler/centerline"), 5);
    assert_eq!(count("/laser_profiler/profile"), 5);
    assert_eq!(count("/laser_profiler/points"), 1);
    assert_eq!(count("/laser_profiler/height_map"), 1);
    assert_eq!(count("/cam/image_raw"), 5);
    // The pose of the laser plane, latched, before the first result. The axis of the fan is that of the formula.
    let [pose] = results["/tf_static"].as_slice() else { panic!("one message") };
    assert!(pose.topic.is_latched());
    assert_eq!(pose.log_time_ns, results["/laser_profiler/centerline"][0].log_time_ns);
    let placed: TFMessage<'_> = cdr::decode(&pose.data).unwrap();
    let [placed] = placed.transforms.as_slice() else { panic!("one transform") };
    assert_eq!((&*placed.header.frame_id, &*placed.child_frame_id), ("optical", "laser"));
    let Vector3 { x, y, z } = placed.transform.translation;
    assert!([x, y, z].iter().all(|metres| metres.is_finite()) && z > 0.0, "{x} {y} {z}");
    let lines = &results["/laser_profiler/centerline"];
    for (number, (line, image)) in (1..).zip(lines.iter().zip(&results["/cam/image_raw"])) {
        let log_ns = image.log_time_ns;
        assert_eq!(
            (line.sequence, line.log_time_ns, line.publish_time_ns),
            (number, log_ns, log_ns)
        );
        assert_eq!((image.sequence, image.publish_time_ns), (number, log_ns - DELAY_NS));
    }
    let line = &lines[0];
    let line: Centerline<'_> = cdr::decode(&line.data).unwrap();
    let hash = entries["parameters_sha256"].get(..8).unwrap();
    assert_eq!(line.method, format!("improved_gravity/{hash}"));
}

#[test]
fn the_recorded_parameters_state_the_transport_that_was_found() {
    let place = tempfile::tempdir().unwrap();
    for (name, transport) in [("/image_raw", "raw"), ("/image_raw/compressed", "compressed")] {
        let input = recording(&place.path().join(transport), &[name]);
        let output = place.path().join("results");
        let replay = Replay::prepare(request(vec![input], &output)).unwrap();
        let line = format!("image_transport: {transport}\n");
        assert!(replay.cameras[0].description(&replay).parameters.contains(&line));
    }
}

#[test]
fn a_second_replay_gives_the_same_bytes() {
    let place = tempfile::tempdir().unwrap();
    let input = recording(&place.path().join("input"), &["/cam/image_raw"]);
    let files = ["a", "b"].map(|directory| {
        let output = place.path().join(directory).join("results");
        replay(request(vec![input.clone()], &output)).unwrap();
        ["results_0.mcap", "metadata.yaml"].map(|name| fs::read(output.join(name)).unwrap())
    });
    assert!(files[0] == files[1]);
}

#[test]
fn an_invalid_request_is_refused_before_anything_is_written() {
    let place = tempfile::tempdir().unwrap();
    let one = recording(&place.path().join("one"), &["/left/image_raw"]);
    let other = recording(&place.path().join("other"), &["/right/image_raw"]);
    let two = recording(&place.path().join("two"), &["/left/image_raw", "/right/image_raw"]);
    let output = place.path().join("results");
    let refused = |bags: &[&PathBuf], output: &Path| {
        let bags = bags.iter().map(|bag| (*bag).clone()).collect();
        let request = ReplayRequest { force: true, ..request(bags, output) };
        let error = replay(request).unwrap_err();
        assert!(error.is_usage(), "{error}");
        error.to_string()
    };
    assert!(refused(&[&two], &output).contains("--ros-args -r image_raw:=/right/image_raw"));
    assert!(refused(&[&one, &other], &output).contains("replay them one by one"));
    assert!(refused(&[&one], &one).contains("is the recording itself"));
    assert!(refused(&[&one], place.path()).contains("is the recording itself"), "its parent");
    assert!(!output.exists());
    assert_eq!(messages(&one)["/left/image_raw"].len(), 5, "untouched");
}

#[test]
fn recordings_are_replayed_in_the_given_order() {
    let place = tempfile::tempdir().unwrap();
    let bag = recording(&place.path().join("input"), &["/cam/image_raw"]);
    let summary = replay(request(vec![bag.clone(), bag], &place.path().join("out"))).unwrap();
    assert_eq!((summary.counts.received, summary.counts.processed), (10, 10));
    assert!(summary.is_complete());
}

#[test]
fn a_damaged_recording_is_replayed_and_reported_as_incomplete() {
    let place = tempfile::tempdir().unwrap();
    let bag = recording(&place.path().join("input"), &["/cam/image_raw"]);
    let file = bag.join("input_0.mcap");
    let mut bytes = fs::read(&file).unwrap();
    // Inside the only chunk, whose checksum is then wrong.
    let chunk = bytes.windows(4).position(|name| name == b"zstd").unwrap();
    bytes[chunk + 200] ^= 1;
    fs::write(&file, bytes).unwrap();
    let summary = replay(request(vec![bag], &place.path().join("out"))).unwrap();
    assert!(summary.num_damaged > 0 && !summary.is_complete());
}

#[test]
fn a_rate_scales_the_time_between_messages() {
    let place = tempfile::tempdir().unwrap();
    let bag = recording(&place.path().join("input"), &["/cam/image_raw"]);
    let request = request(vec![bag], &place.path().join("out"));
    let summary = replay(ReplayRequest { rate: Some(100.0), ..request }).unwrap();
    assert_eq!(summary.counts.processed, 5);
    // Two seconds from the first frame to the last.
    assert!(summary.elapsed.as_millis() >= 20, "{:?}", summary.elapsed);
}

#[test]
fn an_existing_output_stays_without_force() {
    let place = tempfile::tempdir().unwrap();
    let bag = recording(&place.path().join("input"), &["/cam/image_raw"]);
    let output = place.path().join("out");
    let file = output.join("out_0.mcap");
    replay(request(vec![bag.clone()], &output)).unwrap();
    let before = fs::read(&file).unwrap();
    let error = replay(request(vec![bag.clone()], &output)).unwrap_err();
    assert!(error.to_string().contains("--force"), "{error}");
    assert!(fs::read(&file).unwrap() == before);
    replay(ReplayRequest { force: true, ..request(vec![bag], &output) }).unwrap();
    assert!(fs::read(&file).unwrap() == before, "the same again");
}

/// Adds two cameras, `left` and `right`, with the minimum segment area of the request.
fn two_cameras(mut request: ReplayRequest) -> ReplayRequest {
    for camera in ["left", "right"] {
        let mut area = request.ros.assignments[0].clone();
        area.name = format!("{camera}.{}", area.name);
        request.ros.assignments.push(area);
    }
    let cameras = Value::TextList(vec!["left".into(), "right".into()]);
    request.ros.assignments[0] = Assignment { node: None, name: "cameras".into(), value: cameras };
    request
}

#[test]
fn two_cameras_together_give_the_same_results_as_each_alone() {
    let place = tempfile::tempdir().unwrap();
    let bag = recording(&place.path().join("both"), &["/left/image_raw", "/right/image_raw"]);
    let together = place.path().join("together");
    let request = |output: &Path| {
        let mut request = two_cameras(request(vec![bag.clone(), bag.clone()], output));
        request.with_images = true;
        request
    };
    let summary = replay(request(&together)).unwrap();
    assert_eq!((summary.counts.received, summary.counts.processed), (20, 20));
    assert!(summary.is_complete());
    for camera in ["left", "right"] {
        let output = place.path().join("alone").join(camera);
        replay(ReplayRequest { camera: Some(camera.to_owned()), ..request(&output) }).unwrap();
        for name in [&format!("{camera}_0.mcap"), "metadata.yaml"] {
            let [of_both, of_one] =
                [&together.join(camera), &output].map(|bag| fs::read(bag.join(name)).unwrap());
            assert!(of_both.len() > 100 && of_both == of_one, "{camera}/{name}");
        }
    }
    fs::remove_dir_all(together.join("left")).unwrap();
    let error = replay(request(&together)).unwrap_err();
    assert!(error.to_string().contains("right"), "{error}");
    assert!(!together.join("left").exists(), "refused before anything was written");
}

#[test]
fn cameras_with_the_same_images_are_refused() {
    let place = tempfile::tempdir().unwrap();
    let bag = recording(&place.path().join("input"), &["/image_raw"]);
    let mut request = two_cameras(request(vec![bag], &place.path().join("out")));
    for camera in ["left", "right"] {
        let rule =
            ros2args::RemapRule::new_global(format!("{camera}/image_raw"), "/image_raw".into());
        request.ros.remaps.push(rule);
    }
    let error = replay(request).unwrap_err();
    assert!(error.is_usage(), "{error}");
    let words = "the cameras left and right both take /image_raw: replay them one by one";
    assert!(error.to_string().contains(words), "{error}");
}

#[test]
fn one_of_several_cameras_can_be_replayed_alone() {
    let place = tempfile::tempdir().unwrap();
    let both = recording(&place.path().join("both"), &["/left/image_raw", "/right/image_raw"]);
    let right = recording(&place.path().join("right"), &["/right/image_raw", "/other"]);
    let output = place.path().join("results");
    let request = |bag: &PathBuf, camera: Option<&str>| {
        let mut request = request(vec![bag.clone()], &output);
        request.camera = camera.map(str::to_owned);
        request.force = true;
        two_cameras(request)
    };
    for (bag, camera, taken) in [(&both, Some("left"), "left"), (&right, None, "right")] {
        let replay = Replay::prepare(request(bag, camera)).unwrap();
        assert_eq!(replay.image_topics().next().unwrap().name, format!("/{taken}/image_raw"));
        let parameters = replay.cameras[0].description(&replay).parameters;
        assert!(parameters.contains(&format!("    {taken}.image_transport: raw\n")));
        replay.run(&Stop::default(), &mut |_| {}).unwrap();
        let results = messages(&output);
        assert_eq!(results[&format!("/laser_profiler/{taken}/centerline")].len(), 5);
        assert!(results.contains_key("/diagnostics"));
    }
    let other = recording(&place.path().join("other"), &["/image_raw"]);
    for (bag, camera, words) in [
        (&other, None, "the cameras are left, right (--ros-args -r left/image_raw:=TOPIC"),
        (&both, Some("top"), "no camera is called \"top\"; the cameras are left, right"),
        (&right, Some("left"), "no raw or compressed images on /left/image_raw"),
    ] {
        let error = replay(request(bag, camera)).unwrap_err();
        assert!(error.is_usage() && error.to_string().contains(words), "{error}");
    }
}
