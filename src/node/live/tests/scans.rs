//! Tests scans started by service calls.

use nalgebra::{Point3, Unit, Vector3};

use super::{
    rig::{Rig, Setup, text},
    stream::counts,
};
use crate::{
    msg::{laser_profiler_msgs::SliceInfo, sensor_msgs::Image},
    ros::value::Value,
    scanner::{
        axis::{Axis, AxisKind},
        calibration::{Calibration, CameraAndPlane},
        camera::{Camera, Distortion},
        laser_plane::LaserPlane,
    },
};

/// Returns from the last slice of the only camera: scan identity, part, first and last frame, and true if the scan ends
/// with it.
fn last_slice(rig: &Rig, num: usize) -> ([u8; 16], String, u64, u64, bool) {
    let infos = rig.results("slice_info", num);
    assert_eq!(infos.len(), num);
    let info: SliceInfo<'_> = infos[num - 1].decode();
    let part = info.part_id.into_owned();
    (info.scan_id.uuid, part, info.first_frame, info.last_frame, info.last_slice)
}

#[test]
fn a_scan_of_a_length_ends_with_its_height_map() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    camera.shoot_times(2);
    rig.results("centerline", 2);
    let (success, message, scan_id) = rig.scan("part 7", 0.0055);
    assert!(success && scan_id != [0; 16], "{message}");
    assert!(last_slice(&rig, 1).4, "the previous scan has ended");
    for number in 3..=12 {
        camera.shoot();
        rig.results("centerline", number);
    }
    // 0 to 6 mm: seven profiles, in slices of four.
    rig.results("height_map", 2);
    assert_eq!(last_slice(&rig, 3), (scan_id, "part 7".into(), 6, 8, true));
    assert_eq!(rig.results("height_map", 2)[1].decode::<Image<'_>>().height, 7);
    assert_eq!(rig.trigger("stop_scan"), (true, "no scan was open".into()), "frames give profiles");

    let (success, _, second_id) = rig.scan("", 0.0);
    assert!(success && second_id != scan_id);
    camera.shoot();
    rig.results("centerline", 13);
    assert_eq!(rig.trigger("stop_scan"), (true, "scan ended".into()));
    assert_eq!(last_slice(&rig, 4), (second_id, String::new(), 12, 12, true));
    assert_eq!(counts(rig.end()).slices, 4);
}

/// A camera over a part on an axis whose joint is off by `scale`.
fn on_axis(kind: AxisKind, scale: f64) -> Rig {
    let setup = Setup::new();
    let direction = Vector3::y_axis();
    let geometry = CameraAndPlane {
        frame_id: "laser".into(),
        camera_name: "camera".into(),
        camera: Camera {
            width_px: 64,
            height_px: 32,
            fx_px: 100.0,
            fy_px: 100.0,
            cx_px: 31.5,
            cy_px: 15.5,
            distortion: Distortion::None,
            tilt_rad: [0.0; 2],
        },
        camera_quality: None,
        plane: LaserPlane {
            normal: Unit::new_normalize(Vector3::new(0.0, 0.8, 0.6)),
            distance_m: 0.3,
        },
        plane_quality: None,
        alignment: None,
        part: None,
        axis: Some(Axis { kind, point_m: Point3::new(0.0, 0.0, 0.6), direction, scale }),
        axis_quality: None,
        calibrated_at: None,
    };
    let text = Calibration::CameraAndPlane(Box::new(geometry)).to_yaml();
    std::fs::write(setup.path("c.yaml"), text).unwrap();
    setup.start().unwrap()
}

#[test]
fn a_length_is_measured_after_the_scale_of_the_axis() {
    // Each frame states 1 mm, which is 0.5 mm.
    let rig = on_axis(AxisKind::Prismatic, 0.5);
    let mut camera = rig.camera();
    assert!(rig.scan("", 0.0029).0);
    for number in 1..=9 {
        camera.shoot();
        rig.results("centerline", number);
    }
    // 0 to 3 mm: seven profiles, in slices of four.
    let (_, _, first, last, is_last) = last_slice(&rig, 2);
    assert_eq!((first, last, is_last), (4, 6, true));
    rig.end();
}

#[test]
fn a_length_in_metres_is_refused_on_a_revolute_axis() {
    let rig = on_axis(AxisKind::Revolute, 2.0);
    let mut camera = rig.camera();
    let (success, message, scan_id) = rig.scan("", 0.003);
    assert!(
        !success && scan_id == [0; 16] && message.contains("the axis is revolute"),
        "{message}"
    );
    assert!(rig.scan("", 0.0).0, "a scan until it is stopped");
    for number in 1..=3 {
        camera.shoot();
        rig.results("centerline", number);
    }
    assert_eq!(rig.trigger("stop_scan"), (true, "scan ended".into()));
    assert_eq!(last_slice(&rig, 1).3, 2);
    rig.end();
}

#[test]
fn services_start_stop_and_reset_a_scan() {
    let rig = Rig::start();
    let mut camera = rig.camera();
    let mut num = 0;
    let mut shoot = |rig: &Rig| {
        camera.shoot();
        num += 1;
        rig.results("centerline", num);
    };
    assert!(rig.trigger("start_scan").0, "a triggered camera sends nothing before the motion");
    shoot(&rig);
    assert_eq!(rig.trigger("reset"), (true, "scan discarded".into()));
    shoot(&rig);
    assert!(rig.trigger("stop_scan").0);
    let (_, _, first, last, ended) = last_slice(&rig, 1);
    assert_eq!((first, last, ended), (1, 1, true), "the discarded scan was not published");
    shoot(&rig);
    assert!(rig.trigger("start_scan").0);
    shoot(&rig);
    assert!(rig.trigger("stop_scan").0);
    assert_eq!(last_slice(&rig, 2).2, 3, "between stop and start there is no scan");
    let listener = rig.listener.clone();
    rig.end();
    assert_eq!(listener.received("/laser_profiler/height_map").len(), 2);
}

#[test]
fn a_refused_request_gives_the_reason() {
    let rig = Rig::start();
    for length in [-1.0, f64::NAN, f64::INFINITY] {
        let (success, message, scan_id) = rig.scan("", length);
        assert!(!success && scan_id == [0; 16] && message.contains("length is"), "{message}");
    }
    assert!(rig.change_state("deactivate"));
    for service in ["start_scan", "stop_scan", "reset"] {
        let (success, message) = rig.trigger(service);
        assert!(!success && message.contains("activate it first"), "{message}");
    }
    assert!(rig.change_state("cleanup"));
    for (success, message) in [rig.start_recording(), rig.trigger("snapshot")] {
        assert!(!success && message.contains("configure it first"), "{message}");
    }
    assert_eq!(rig.network.call("/laser_profiler/scan", &[1, 2, 3]), None, "malformed");
    rig.end();

    let rig = Setup::new().with("calibration_file", text("")).start().unwrap();
    let (success, message) = rig.trigger("start_scan");
    assert!(!success && message.contains("calibration_file"), "{message}");
    assert!(rig.trigger("stop_scan").0);
    rig.end();
}

#[test]
fn every_service_exists_once() {
    let own = ["start_scan", "stop_scan", "reset", "scan", "record", "snapshot"];
    let rig = Rig::start();
    let services = rig.network.services();
    let is_own = |name: &&String| own.iter().any(|own| name.ends_with(&format!("/{own}")));
    assert_eq!(services.iter().filter(is_own).count(), own.len());
    assert_eq!(services.len(), own.len() + 6 + 5 + 3, "of parameters, lifecycle and the action");
    rig.end();

    let mut setup = Setup::new();
    setup.set("cameras", Value::TextList(vec!["left".into(), "right".into()]));
    for camera in ["left", "right"] {
        setup.set_camera(camera);
    }
    let rig = setup.start().unwrap();
    assert_eq!(rig.network.services().iter().filter(is_own).count(), 3 * own.len());
    rig.end();
}
