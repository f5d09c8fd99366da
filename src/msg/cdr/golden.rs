//! Golden bytes written by `rosbags` (see `tests/data/cdr/README.md`), which cover every kind of field.

use std::fmt::Debug;

use serde::Deserialize;

use super::{decode, encode};
use crate::msg::{
    builtin_interfaces::Time,
    diagnostic_msgs::{DiagnosticArray, DiagnosticStatus, KeyValue},
    laser_profiler_msgs::{Centerline, FrameTrace, SliceInfo},
    schema::Message,
    sensor_msgs::{CameraInfo, RegionOfInterest},
    std_msgs::Header,
    unique_identifier_msgs::Uuid,
};

fn check<'a, T: Message + Deserialize<'a> + PartialEq + Debug>(golden: &'a [u8], message: &T) {
    assert_eq!(&decode::<T>(golden).unwrap(), message);
    let mut bytes = Vec::new();
    encode(message, &mut bytes).unwrap();
    assert_eq!(bytes, golden);
}

fn header() -> Header<'static> {
    let stamp = Time { sec: 1_700_000_000, nanosec: 123_456_789 };
    Header { stamp, frame_id: "camera".into() }
}

const ROI: RegionOfInterest =
    RegionOfInterest { x_offset: 1, y_offset: 2, height: 3, width: 4, do_rectify: true };

#[test]
fn centerline() {
    let trace = FrameTrace {
        frame_number: (1 << 40) + 1,
        frame_number_source: FrameTrace::SOURCE_HOST,
        frames_missing: 7,
        frames_missing_valid: true,
        encoder: -5,
        position: 0.125,
        encoder_source: FrameTrace::SOURCE_DEVICE,
        encoder_status: FrameTrace::ENCODER_REVERSED | FrameTrace::ENCODER_EXTRAPOLATED,
        digital_inputs: 513,
        exposure_time: 0.5,
        receive_stamp: Time { sec: -1, nanosec: 999_999_999 },
    };
    let message = Centerline {
        header: header(),
        trace,
        image_width: 640,
        image_height: 480,
        roi: ROI,
        stripe_direction: Centerline::STRIPE_VERTICAL,
        method: "gray_gravity/0a".into(),
        u: vec![10.0, 11.0, 12.0].into(),
        v: vec![20.25, 20.5, 30.75].into(),
        stripe_start: vec![0, 2].into(),
        width: vec![4.0, 5.0, 6.0].into(),
        intensity: vec![200.0, 210.0, 220.0].into(),
        sigma: vec![].into(),
        flags: vec![0, 5, 16].into(),
    };
    check(include_bytes!("../../../tests/data/cdr/centerline.cdr"), &message);
}

#[test]
fn slice_info() {
    let message = SliceInfo {
        header: header(),
        scan_id: Uuid { uuid: std::array::from_fn(|i| i as u8) },
        part_id: "cell 7".into(),
        slice_index: 3,
        last_slice: true,
        first_frame: 100,
        last_frame: 199,
        first_position: -0.5,
        last_position: 0.25,
        frames_expected: 100,
        frames_accepted: 97,
        frames_missing: 2,
        frames_rejected: 1,
        profiles_empty: 4,
        points: 1 << 33,
        state: SliceInfo::GAPS,
    };
    check(include_bytes!("../../../tests/data/cdr/slice_info.cdr"), &message);
}

#[test]
fn camera_info() {
    let message = CameraInfo {
        header: header(),
        height: 480,
        width: 640,
        distortion_model: "plumb_bob".into(),
        d: vec![0.1, -0.2, 0.3, -0.4, 0.5],
        k: std::array::from_fn(|i| i as f64),
        r: std::array::from_fn(|i| i as f64 / 2.0),
        p: std::array::from_fn(|i| i as f64 / 4.0),
        binning_x: 1,
        binning_y: 2,
        roi: ROI,
    };
    check(include_bytes!("../../../tests/data/cdr/camera_info.cdr"), &message);
}

#[test]
fn diagnostic_array() {
    let status = DiagnosticStatus {
        level: DiagnosticStatus::WARN,
        name: "laser_profiler".into(),
        message: "2 frames lost".into(),
        hardware_id: "".into(),
        values: vec![KeyValue { key: "lost".into(), value: "2".into() }],
    };
    let message = DiagnosticArray { header: header(), status: vec![status] };
    check(include_bytes!("../../../tests/data/cdr/diagnostic_array.cdr"), &message);
}
