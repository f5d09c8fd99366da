//! `sensor_msgs`: input from cameras and axes, and published point clouds.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::{schema::message, std_msgs::Header, text};

/// An uncompressed image, row by row from the top.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Image<'a> {
    /// Acquisition time and optical frame of the camera.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// Memory layout of a pixel, such as `mono8`.
    #[serde(borrow, with = "text")]
    pub encoding: Cow<'a, str>,
    /// Not 0 if samples of several bytes are big-endian.
    pub is_bigendian: u8,
    /// Bytes from the start of one row to the next.
    pub step: u32,
    /// `height * step` bytes.
    #[serde(with = "serde_bytes")]
    pub data: &'a [u8],
}

/// An image as a compressed file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CompressedImage<'a> {
    /// Acquisition time and optical frame of the camera.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Codec, such as `jpeg`, `png` or `mono8; png compressed`.
    #[serde(borrow, with = "text")]
    pub format: Cow<'a, str>,
    /// Content of the file.
    #[serde(with = "serde_bytes")]
    pub data: &'a [u8],
}

/// Calibration of a camera, valid for the image of the same stamp.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraInfo<'a> {
    /// Acquisition time and optical frame of the camera.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Rows of the calibrated resolution.
    pub height: u32,
    /// Columns of the calibrated resolution.
    pub width: u32,
    /// Name of the distortion model, such as `plumb_bob`.
    #[serde(borrow, with = "text")]
    pub distortion_model: Cow<'a, str>,
    /// Distortion coefficients of that model.
    pub d: Vec<f64>,
    /// Camera matrix, row-major 3 x 3, pixels.
    pub k: [f64; 9],
    /// Rectifying rotation, row-major 3 x 3.
    pub r: [f64; 9],
    /// Projection matrix, row-major 3 x 4, pixels.
    pub p: [f64; 12],
    /// Sensor columns combined into one image column; 0 means 1.
    pub binning_x: u32,
    /// Sensor rows combined into one image row; 0 means 1.
    pub binning_y: u32,
    /// Part of the sensor shown in the image, in unbinned pixels.
    pub roi: RegionOfInterest,
}

/// A rectangle of an image, pixels; width 0 and height 0: the whole image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegionOfInterest {
    /// First column.
    pub x_offset: u32,
    /// First row.
    pub y_offset: u32,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// True if rectified images require a rectified rectangle.
    pub do_rectify: bool,
}

/// Points as binary records, row by row; height 1 if unordered.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointCloud2<'a> {
    /// Acquisition time and coordinate frame.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Rows.
    pub height: u32,
    /// Points in a row.
    pub width: u32,
    /// Layout of a point.
    #[serde(borrow)]
    pub fields: Cow<'a, [PointField<'a>]>,
    /// True if numbers are big-endian.
    pub is_bigendian: bool,
    /// Bytes of a point.
    pub point_step: u32,
    /// Bytes of a row.
    pub row_step: u32,
    /// `height * row_step` bytes.
    #[serde(with = "serde_bytes")]
    pub data: &'a [u8],
    /// True if no point is missing.
    pub is_dense: bool,
}

/// One field of the points of a [`PointCloud2`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointField<'a> {
    /// Name, such as `x`.
    #[serde(borrow, with = "text")]
    pub name: Cow<'a, str>,
    /// Bytes from the start of the point.
    pub offset: u32,
    /// Type of an element: [`FLOAT32`](Self::FLOAT32) or another of the constants.
    pub datatype: u8,
    /// Number of elements.
    pub count: u32,
}

impl PointField<'_> {
    /// `i8`.
    pub const INT8: u8 = 1;
    /// `u8`.
    pub const UINT8: u8 = 2;
    /// `i16`.
    pub const INT16: u8 = 3;
    /// `u16`.
    pub const UINT16: u8 = 4;
    /// `i32`.
    pub const INT32: u8 = 5;
    /// `u32`.
    pub const UINT32: u8 = 6;
    /// `f32`.
    pub const FLOAT32: u8 = 7;
    /// `f64`.
    pub const FLOAT64: u8 = 8;
}

/// State of some axes at one time; an array is empty or as long as `name`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointState<'a> {
    /// Time of the measurement.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Names of the axes.
    pub name: Vec<String>,
    /// Positions, radians or metres.
    pub position: Vec<f64>,
    /// Velocities, radians or metres per second.
    pub velocity: Vec<f64>,
    /// Efforts, newton metres or newtons.
    pub effort: Vec<f64>,
}

message!(
    Image<'_>,
    "sensor_msgs/msg/Image",
    include_str!("definitions/sensor_msgs/Image.msg"),
    "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
    [Header<'_>]
);
message!(
    CompressedImage<'_>,
    "sensor_msgs/msg/CompressedImage",
    include_str!("definitions/sensor_msgs/CompressedImage.msg"),
    "RIHS01_15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
    [Header<'_>]
);
message!(
    CameraInfo<'_>,
    "sensor_msgs/msg/CameraInfo",
    include_str!("definitions/sensor_msgs/CameraInfo.msg"),
    "RIHS01_b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275",
    [Header<'_>, RegionOfInterest]
);
message!(
    RegionOfInterest,
    "sensor_msgs/msg/RegionOfInterest",
    include_str!("definitions/sensor_msgs/RegionOfInterest.msg"),
    "RIHS01_ad16bcba5f9131dcdba6fbded19f726f5440e3c513b4fb586dd3027eeed8abb1",
    []
);
message!(
    PointCloud2<'_>,
    "sensor_msgs/msg/PointCloud2",
    include_str!("definitions/sensor_msgs/PointCloud2.msg"),
    "RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
    [Header<'_>, PointField<'_>]
);
message!(
    PointField<'_>,
    "sensor_msgs/msg/PointField",
    include_str!("definitions/sensor_msgs/PointField.msg"),
    "RIHS01_5c6a4750728c2bcfbbf7037225b20b02d4429634732146b742dee1726637ef01",
    []
);
message!(
    JointState<'_>,
    "sensor_msgs/msg/JointState",
    include_str!("definitions/sensor_msgs/JointState.msg"),
    "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    [Header<'_>]
);
