//! Tests parameters that change between two frames.

use std::thread;

use super::{
    Received,
    rig::{Rig, Setup, set, text},
    stream::counts,
};
use crate::{
    bag::{BagReader, ReadOptions},
    msg::{
        laser_profiler_msgs::{Centerline, SliceInfo},
        rcl_interfaces::ParameterEvent,
        schema::Message,
        sensor_msgs::PointCloud2,
    },
    node::stop::Stop,
    ros::{loopback::Loopback, value::Value},
};

#[test]
fn changes_by_this_process_are_published_like_those_by_a_service() {
    let rig = Rig::start();
    let (listener, _subscription) = rig.listen("/parameter_events", ParameterEvent::TYPE);
    let name = "extraction.method";
    rig.parameters.set(name, text("gray_gravity")).unwrap();
    let reason = rig.parameters.set(name, text("magic")).unwrap_err();
    assert!(reason.contains(name) && reason.contains("one of"), "{reason}");
    let value = rig.parameters.read(|values| values.get(name).map(|it| it.value().clone()));
    assert_eq!(value, Some(text("gray_gravity")));
    let is_change = |message: &Received| {
        let event: ParameterEvent<'_> = message.decode();
        event.changed_parameters.iter().any(|changed| changed.name == name)
    };
    listener.wait("the change", |messages| messages.iter().any(is_change));
}

#[test]
fn a_change_applies_from_the_next_frame_on_and_a_refused_one_never() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    let mut methods = Vec::new();
    let mut shoot = |rig: &Rig| {
        camera.shoot();
        let lines = rig.results("centerline", methods.len() + 1);
        let line: Centerline<'_> = lines.last().unwrap().decode();
        methods.push((line.method.into_owned(), line.roi.x_offset, line.u.len()));
    };
    shoot(&rig);
    for (name, value) in [
        ("extraction.method", text("gray_gravity")),
        ("extraction.segment_threshold", Value::Float(30.0)),
    ] {
        rig.set(name, &value).unwrap();
        shoot(&rig);
    }
    for (name, value) in [
        ("extraction.method", text("magic")),
        ("extraction.segment_threshold", Value::Float(1e6)),
        ("motion.velocity", Value::Float(0.1)),
        ("cameras", text("left")),
        ("nothing", Value::Bool(true)),
    ] {
        let reason = rig.set(name, &value).unwrap_err();
        assert!(reason.contains(name), "{reason}");
    }
    shoot(&rig);
    assert_eq!(rig.listener.received("/laser_profiler/slice_info").len(), 0, "one scan until now");
    rig.set("roi.x_offset", &Value::Integer(8)).unwrap();
    shoot(&rig);
    rig.results("height_map", 1);
    rig.set("motion.step", &Value::Float(0.002)).unwrap();
    rig.set("slice.profiles", &Value::Integer(2)).unwrap();
    for _ in 0..3 {
        shoot(&rig);
    }
    let listener = rig.listener.clone();
    assert_eq!(counts(rig.end()).processed, 8);
    let names: Vec<_> =
        methods.iter().map(|(method, ..)| method.split('/').next().unwrap()).collect();
    assert_eq!(names[..3], ["improved_gravity", "gray_gravity", "gray_gravity"]);
    let methods: Vec<_> = methods.iter().map(|(method, x, num)| (method, *x, *num)).collect();
    assert!(methods[1] != methods[2] && methods[2] == methods[3], "the hash differs");
    assert_eq!([methods[3].1, methods[4].1], [0, 8]);
    assert_eq!([methods[3].2, methods[4].2], [64, 56]);
    let infos = listener.received("/laser_profiler/slice_info");
    let slices: Vec<_> = infos
        .iter()
        .map(Received::decode::<SliceInfo<'_>>)
        .map(|info| (info.first_frame, info.last_frame, (info.last_position * 1e3).round() as i32))
        .collect();
    // A scan does not mix different regions or steps.
    assert_eq!(slices, [(0, 3, 3), (4, 4, 0), (5, 6, 2), (7, 7, 4)]);
}

#[test]
fn ten_thousand_sets_drop_no_frame_and_the_last_one_applies() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    let done = Stop::default();
    let num_frames = thread::scope(|scope| {
        let (network, is_done) = (rig.network.clone(), done.clone());
        scope.spawn(move || {
            hammer(&network);
            is_done.raise();
        });
        let mut num_frames = 0;
        while !done.is_raised() || num_frames < 10 {
            camera.shoot();
            num_frames += 1;
            rig.listener.wait_for("/laser_profiler/centerline", num_frames);
        }
        num_frames
    });
    camera.shoot();
    let lines = rig.results("centerline", num_frames + 1);
    let line: Centerline<'_> = lines.last().unwrap().decode();
    let mut last = Setup::new();
    last.set("extraction.segment_threshold", Value::Float(threshold(9999)));
    let expected = last.values.camera_sha256("");
    assert_eq!(line.method, format!("improved_gravity/{}", &expected[..8]));
    let counts = counts(rig.end());
    assert_eq!((counts.processed, counts.dropped_overload), (num_frames as u64 + 1, 0));
}

fn threshold(number: i32) -> f64 {
    20.0 + f64::from(number) / 1000.0
}

/// Ten thousand changes, half of them invalid.
fn hammer(network: &Loopback) {
    for number in 0..10_000 {
        let is_right = number % 2 == 1;
        let value = if is_right { threshold(number) } else { -1.0 };
        let done = set(network, "extraction.segment_threshold", &Value::Float(value));
        assert_eq!(done.is_ok(), is_right, "{done:?}");
    }
}

#[test]
fn the_limit_of_the_middleware_limits_slices_and_is_recorded() {
    let mut setup = Setup::new().with("recording.enabled", Value::Bool(true));
    // Three profiles of 64 points of 16 bytes, and the rest of the message.
    setup.network = Loopback::carrying(3 * 64 * 16 + 400);
    let rig = setup.start().unwrap();
    let mut camera = rig.camera();
    for number in 1..=8 {
        camera.shoot();
        rig.results("centerline", number);
    }
    rig.set("points.max_bytes", &Value::Integer(64 * 16 + 400)).unwrap();
    for number in 9..=10 {
        camera.shoot();
        rig.results("centerline", number);
    }
    let (listener, place) = (rig.listener.clone(), rig.place.path().join("bags"));
    let directory = std::fs::read_dir(place).unwrap().next().unwrap().unwrap().path();
    let parameters = |bag: &BagReader| -> Vec<String> {
        let records = bag.metadata().map(Result::unwrap);
        let own = records.filter(|record| record.name == "laser_profiler");
        own.map(|record| record.entries["parameters"].clone()).collect()
    };
    super::listener::wait_until("the change is in the bag", || {
        parameters(&BagReader::open(&directory, &ReadOptions::default()).unwrap()).len() == 2
    });
    let (_, _place) = rig.end_and_keep();
    let heights: Vec<_> = listener
        .received("/laser_profiler/points")
        .iter()
        .map(|cloud| cloud.decode::<PointCloud2<'_>>().height)
        .collect();
    assert_eq!(heights, [3, 3, 2, 1, 1]);
    let recorded = parameters(&BagReader::open(&directory, &ReadOptions::default()).unwrap());
    assert!(recorded[0].contains("points.max_bytes: 3472"), "{}", recorded[0]);
    assert!(recorded[1].contains("points.max_bytes: 1424"), "{}", recorded[1]);
}

#[test]
fn peers_set_files_only_where_the_operator_did() {
    let rig = Setup::new().with("autostart", Value::Bool(false)).start().unwrap();
    for name in ["calibration_file", "extraction.background_file", "recording.directory"] {
        for path in ["/etc/passwd", "/dev/zero", "/", "../c.yaml", "/no/such/file"] {
            let reason = rig.set(name, &text(path)).unwrap_err();
            assert!(reason.contains(name) && reason.contains(path), "{reason}");
            assert!(!reason.contains("root:"), "{reason}");
            assert_eq!(rig.parameters.set(name, text(path)).unwrap_err(), reason, "a viewer");
        }
        let beside = rig.place.path().join("bags/other");
        rig.set(name, &text(beside.to_str().unwrap())).unwrap();
    }
    // What is no calibration is refused without a word of it.
    let secret = rig.place.path().join("secret");
    std::fs::write(&secret, "password: hunter2").unwrap();
    rig.set("extraction.background_file", &text("")).unwrap();
    rig.set("calibration_file", &text(secret.to_str().unwrap())).unwrap();
    assert!(!rig.change_state("configure"));
}
