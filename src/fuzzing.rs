//! Entry points for the fuzz targets in `fuzz/`: whatever reads bytes from files or peers, without I/O where possible.
//! Exists only in builds of cargo-fuzz (`--cfg fuzzing`).

#![allow(clippy::unwrap_used, reason = "a broken property is a finding, and a panic reports it")]

use std::{fs, path::Path};

use crate::{
    bag::{BagReader, Filter, ReadOptions},
    msg::{
        cdr,
        convert::compressed,
        laser_profiler_msgs::{
            Centerline, EncoderStamped, Profile, SliceInfo, StartScanRequest, StreamStatus,
        },
        lifecycle_msgs::ChangeStateRequest,
        rcl_interfaces as rcl,
        rosgraph_msgs::Clock,
        schema::Message,
        sensor_msgs::{CameraInfo, CompressedImage, Image, JointState, PointCloud2},
        std_msgs::Header,
        std_srvs::SetBoolRequest,
        tf2_msgs::TFMessage,
    },
    ros::{arguments, parameter_file},
    scanner::calibration::{Calibration, CameraCalibration},
};

/// Largest picture of the targets, bytes: a fuzzer's memory is limited.
const MAX_FRAME_BYTES: u64 = 16 << 20;

/// Decodes bytes, encodes the message, and decodes and encodes that.
macro_rules! round_trip {
    ($message:ty, $bytes:expr) => {{
        let Ok(message) = cdr::decode::<$message>($bytes) else { return };
        let encoded = encoded(&message);
        // A string without its zero takes four bytes, the encoded one eight, and up to seven of alignment.
        assert!(encoded.len() <= 4 * $bytes.len() + 8, "{} bytes", encoded.len());
        let again: $message = cdr::decode(&encoded).unwrap();
        assert_eq!(self::encoded(&again), encoded);
    }};
}

fn encoded(message: &impl Message) -> Vec<u8> {
    let mut bytes = Vec::new();
    cdr::encode(message, &mut bytes).unwrap();
    bytes
}

/// Decodes a message of the type that the first byte selects. What decodes can be encoded, and again to the same bytes.
pub fn cdr(data: &[u8]) {
    let Some((selector, bytes)) = data.split_first() else { return };
    match selector % 16 {
        0 => round_trip!(Image<'_>, bytes),
        1 => round_trip!(CompressedImage<'_>, bytes),
        2 => round_trip!(CameraInfo<'_>, bytes),
        3 => round_trip!(JointState<'_>, bytes),
        4 => round_trip!(PointCloud2<'_>, bytes),
        5 => round_trip!(TFMessage<'_>, bytes),
        6 => round_trip!(Clock, bytes),
        7 => round_trip!(EncoderStamped<'_>, bytes),
        8 => round_trip!(StartScanRequest<'_>, bytes),
        9 => round_trip!(SetBoolRequest, bytes),
        10 => round_trip!(ChangeStateRequest<'_>, bytes),
        11 => round_trip!(Centerline<'_>, bytes),
        12 => round_trip!(Profile<'_>, bytes),
        13 => round_trip!(SliceInfo<'_>, bytes),
        14 => round_trip!(StreamStatus<'_>, bytes),
        _ => round_trip!(rcl::SetParametersRequest<'_>, bytes),
    }
}

/// Reads a file as a recording: the description, then every message.
pub fn bag(data: &[u8], scratch: &Path) {
    let path = scratch.join("fuzzed.mcap");
    fs::write(&path, data).unwrap();
    let options = ReadOptions::for_frames(MAX_FRAME_BYTES);
    let Ok(bag) = BagReader::open(&path, &options) else { return };
    let all = Filter::topics(bag.topics().iter().map(|topic| topic.name.as_str()));
    for message in bag.messages(&all).flatten() {
        assert!(message.data.len() as u64 <= MAX_FRAME_BYTES * 2);
    }
    bag.attachments().for_each(drop);
    bag.metadata().for_each(drop);
}

/// Parses a parameter file.
pub fn parameter_file(data: &[u8]) {
    if let Ok(text) = std::str::from_utf8(data) {
        drop(parameter_file::parse(text, "/laser_profiler"));
    }
}

/// Splits a command line with ROS arguments, one argument a line.
pub fn ros_arguments(data: &[u8]) {
    if let Ok(text) = std::str::from_utf8(data) {
        let line: Vec<_> = text.lines().map(str::to_owned).collect();
        drop(arguments::split(&line));
    }
}

/// Reads a calibration. What is read is written and read again as the same.
pub fn calibration(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    drop(CameraCalibration::from_yaml(text));
    if let Ok(calibration) = Calibration::from_yaml(text) {
        let written = calibration.to_yaml();
        let read = Calibration::from_yaml(&written).unwrap();
        assert_eq!(read.to_yaml(), written);
    }
}

/// Decodes a compressed image.
pub fn compressed_image(data: &[u8]) {
    let message = CompressedImage { header: Header::default(), format: "".into(), data };
    let mut pixels = Vec::new();
    drop(compressed::image(&message, MAX_FRAME_BYTES, &mut pixels));
    assert!(pixels.len() as u64 <= MAX_FRAME_BYTES);
}

/// Reads the frames of the pipe between a node and its middleware process.
pub fn process_pipe(data: &[u8]) {
    crate::ros::process::fuzz(data);
}

/// Parses what Zenoh peers send beside messages: attachments, and the keys of their liveliness tokens.
#[cfg(feature = "zenoh")]
pub fn zenoh(data: &[u8]) {
    crate::ros::zenoh::fuzz(data);
}

/// Opens a request in every mapping of services on DDS.
#[cfg(feature = "dds")]
pub fn dds_request(data: &[u8]) {
    crate::ros::dds::fuzz(data);
}
