//! Tests time, transforms, log and quality of service on the network.

use std::{fs, sync::Arc};

use tracing::subscriber::with_default;
use tracing_subscriber::{layer::SubscriberExt, registry};

use super::{
    Received,
    driver::{START_NS, encoded},
    listener::wait_until,
    rig::{CALIBRATION, Rig, Setup, text},
};
use crate::{
    msg::{
        builtin_interfaces::Time,
        diagnostic_msgs::DiagnosticArray,
        laser_profiler_msgs::{SliceInfo, StreamStatus},
        qos::{Durability, QosProfile, Reliability},
        rosgraph_msgs::Clock,
        rosout::Log,
        schema::Message,
        sensor_msgs::{CameraInfo, Image},
        std_msgs::Header,
        tf2_msgs::TFMessage,
    },
    node::rosout,
    ros::{
        transport::{Publication, TopicEndpoint, Transport},
        value::Value,
    },
};

fn publisher<M: Message>(rig: &Rig, name: &str) -> Box<dyn Publication> {
    let endpoint =
        TopicEndpoint { name: name.into(), kind: M::TYPE, qos: QosProfile::reliable(10) };
    rig.network.advertise(&endpoint).unwrap()
}

fn send(publication: &mut dyn Publication, message: &impl Message) {
    publication.publish(&Arc::from(encoded(message)), 0).unwrap();
}

#[test]
fn a_clock_that_steps_back_starts_a_new_session() {
    let rig = Setup::new().with("use_sim_time", Value::Bool(true)).start().unwrap();
    let mut clock = publisher::<Clock>(&rig, "/clock");
    let mut set_clock = |ns| send(&mut *clock, &Clock { clock: Time::from_ns(ns) });
    let status_at = |rig: &Rig, ns: i64| {
        rig.listener.wait_until(
            "a status of that time",
            "/laser_profiler/stream_status",
            |received| {
                let status: StreamStatus<'_> = received.decode();
                (status.header.stamp.to_ns() == ns).then_some(status.session_id.uuid)
            },
        )
    };
    let mut camera = rig.camera();
    set_clock(START_NS + 100);
    camera.shoot_times(2);
    rig.results("centerline", 2);
    let first = status_at(&rig, START_NS + 100);
    set_clock(START_NS + 50);
    rig.results("height_map", 1);
    let second = status_at(&rig, START_NS + 50);
    assert_ne!(first, second);
    // The simulation restarts: earlier stamps are not late.
    camera.at_ms = 0;
    camera.shoot();
    rig.results("centerline", 3);
    let listener = rig.listener.clone();
    let counts = super::stream::counts(rig.end());
    assert_eq!((counts.processed, counts.rejected()), (3, 0));
    let infos = listener.received("/laser_profiler/slice_info");
    let infos: Vec<SliceInfo<'_>> = infos.iter().map(Received::decode).collect();
    assert_eq!(infos.len(), 2);
    assert_ne!(infos[0].scan_id, infos[1].scan_id);
}

/// Waits until the diagnostics contain a text.
fn wait_for_text(rig: &Rig, text: &str) {
    rig.listener.wait_until(text, "/diagnostics", |received| {
        let diagnostics: DiagnosticArray<'_> = received.decode();
        diagnostics.status[0].message.contains(text).then_some(())
    });
}

#[test]
fn a_missing_or_malformed_clock_is_reported() {
    let rig = Setup::new().with("use_sim_time", Value::Bool(true)).start().unwrap();
    wait_for_text(&rig, "use_sim_time is set, but no /clock has arrived");
    let mut clock = publisher::<Clock>(&rig, "/clock");
    clock.publish(&Arc::from([0, 1, 0, 0, 7].as_slice()), 0).unwrap();
    wait_for_text(&rig, "malformed /clock messages: 1");
    rig.end();
}

#[test]
fn a_laser_plane_that_cannot_be_placed_is_reported() {
    let setup = Setup::new();
    // The frame of the images.
    let calibration = CALIBRATION.replace("frame_id: laser", "frame_id: optical");
    fs::write(setup.place.path().join("c.yaml"), calibration).unwrap();
    let rig = setup.start().unwrap();
    let mut camera = rig.camera();
    camera.shoot();
    wait_for_text(&rig, "images and laser plane both have frame \"optical\"");
    rig.end();
}

#[test]
fn the_laser_plane_is_published_once_and_after_a_change_of_direction() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    camera.shoot_times(3);
    rig.results("centerline", 3);
    // Latched: a late subscriber receives it, too.
    let (listener, _subscription) = rig.listen("/tf_static", TFMessage::TYPE);
    let received = listener.wait_for("/tf_static", 1);
    let message: TFMessage<'_> = received[0].decode();
    let [transform] = message.transforms.as_slice() else { panic!("{message:?}") };
    assert_eq!((&*transform.header.frame_id, &*transform.child_frame_id), ("optical", "laser"));
    camera.shoot();
    rig.results("centerline", 4);
    assert_eq!(listener.received("/tf_static").len(), 1);
    rig.set("stripe_direction", &text("vertical")).unwrap();
    camera.shoot();
    let received = listener.wait_for("/tf_static", 2);
    let turned: TFMessage<'_> = received[1].decode();
    assert_ne!(turned.transforms[0].transform, transform.transform);
    rig.end();
}

#[test]
fn a_camera_info_of_another_size_is_reported_in_either_order() {
    for info_first in [true, false] {
        let rig = Rig::start();
        let mut camera = rig.camera();
        let mut infos = publisher::<CameraInfo<'_>>(&rig, "/camera_info");
        let mut describe = |ms: i64| {
            let stamp = Time::from_ns(START_NS + ms * 1_000_000);
            let header = Header { stamp, frame_id: "optical".into() };
            let info = CameraInfo { header, width: 640, height: 480, ..CameraInfo::default() };
            send(&mut *infos, &info);
        };
        if info_first {
            describe(10);
        }
        camera.shoot();
        rig.results("centerline", 1);
        if !info_first {
            describe(10);
        }
        rig.listener.wait_until("the conflict is reported", "/diagnostics", |received| {
            let diagnostics: DiagnosticArray<'_> = received.decode();
            let message = &diagnostics.status[0].message;
            message.contains("camera_info describes images of 640 x 480").then_some(())
        });
        rig.end();
    }
}

#[test]
fn log_lines_are_on_rosout() {
    let (layer, slot) = rosout::layer();
    let mut setup = Setup::new();
    setup.slot = slot;
    with_default(registry().with(layer), || {
        let rig = setup.start().unwrap();
        let (listener, _subscription) = rig.listen("/rosout", Log::TYPE);
        // Logged on the thread that calls the service.
        assert!(!rig.change_state("configure"));
        listener.wait("the refusal", |received| {
            received.iter().any(|line| {
                let line: Log<'_> = line.decode();
                line.name == "laser_profiler" && line.msg.contains("cannot begin")
            })
        });
        rig.end();
    });
}

#[test]
fn quality_of_service_follows_the_overrides() {
    let rig = Setup::new()
        .with("qos_overrides./image_raw.subscription.reliability", text("reliable"))
        .with("qos_overrides./image_raw.subscription.depth", Value::Integer(17))
        .with("qos_overrides./laser_profiler/centerline.publisher.reliability", text("best_effort"))
        .start()
        .unwrap();
    let [images] = rig.network.qos("/image_raw")[..] else { panic!() };
    assert_eq!((images.reliability, images.depth), (Reliability::Reliable, 17));
    let [info] = rig.network.qos("/camera_info")[..] else { panic!() };
    assert_eq!(info.reliability, Reliability::BestEffort, "so that it matches every publisher");
    let lines = rig.network.qos("/laser_profiler/centerline");
    assert!(lines.iter().any(|qos| qos.reliability == Reliability::BestEffort), "{lines:?}");
    let maps = rig.network.qos("/laser_profiler/height_map");
    assert!(maps.iter().all(|qos| qos.durability == Durability::TransientLocal));
    rig.end();
}

#[test]
fn publishers_of_images_are_reported() {
    let rig = Rig::start();
    wait_for_text(&rig, "/image_raw has no publisher");
    let _first = publisher::<Image<'_>>(&rig, "/image_raw");
    wait_for_text(&rig, "every frame measured");
    let second = publisher::<Image<'_>>(&rig, "/image_raw");
    wait_for_text(&rig, "2 publishers on /image_raw");
    drop(second);
    let network = rig.network.clone();
    rig.end();
    // The node has left the graph.
    wait_until("the graph is empty", || {
        network.topics().iter().all(|topic| topic.num_publishers == 0 || topic.name == "/image_raw")
    });
    assert!(network.services().is_empty());
}
