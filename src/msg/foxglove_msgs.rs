//! `foxglove_msgs`: annotations of an image, in the version without `metadata` that ROS 2 distributions contain.
//!
//! Image coordinates have their origin at the *corner* of the top-left pixel, half a pixel from the scanner's.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use super::{builtin_interfaces::Time, schema::message, text};

/// All annotations of one image.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct ImageAnnotations<'a> {
    /// Circles.
    pub(crate) circles: Vec<CircleAnnotation>,
    /// Points and lines.
    pub(crate) points: Vec<PointsAnnotation>,
    /// Texts.
    #[serde(borrow)]
    pub(crate) texts: Vec<TextAnnotation<'a>>,
}

/// A circle over an image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct CircleAnnotation {
    /// Time of the image.
    pub(crate) timestamp: Time,
    /// Centre.
    pub(crate) position: Point2,
    /// Diameter, pixels.
    pub(crate) diameter: f64,
    /// Thickness of the line, pixels.
    pub(crate) thickness: f64,
    /// Colour of the area.
    pub(crate) fill_color: Color,
    /// Colour of the line.
    pub(crate) outline_color: Color,
}

/// Points or lines over an image.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct PointsAnnotation {
    /// Time of the image.
    pub(crate) timestamp: Time,
    /// [`LINE_STRIP`](Self::LINE_STRIP).
    pub r#type: u8,
    /// Points.
    pub(crate) points: Vec<Point2>,
    /// Colour of all lines.
    pub(crate) outline_color: Color,
    /// Colour of each point or line; may be empty.
    pub(crate) outline_colors: Vec<Color>,
    /// Colour of the enclosed area.
    pub(crate) fill_color: Color,
    /// Thickness of lines, pixels.
    pub(crate) thickness: f64,
}

impl PointsAnnotation {
    /// An open line through all points.
    pub(crate) const LINE_STRIP: u8 = 3;
}

/// Text over an image.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct TextAnnotation<'a> {
    /// Time of the image.
    pub(crate) timestamp: Time,
    /// Bottom-left corner of the text.
    pub(crate) position: Point2,
    /// Text.
    #[serde(borrow, with = "text")]
    pub(crate) text: Cow<'a, str>,
    /// Height of the letters, pixels.
    pub(crate) font_size: f64,
    /// Colour of the letters.
    pub(crate) text_color: Color,
    /// Background colour.
    pub(crate) background_color: Color,
}

/// A point of an image, pixels from the corner of its top-left pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Point2 {
    /// Position to the right.
    pub(crate) x: f64,
    /// Position down.
    pub(crate) y: f64,
}

/// A colour, components from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Color {
    /// Red.
    pub(crate) r: f64,
    /// Green.
    pub(crate) g: f64,
    /// Blue.
    pub(crate) b: f64,
    /// Opacity.
    pub(crate) a: f64,
}

message!(
    ImageAnnotations<'_>,
    "foxglove_msgs/msg/ImageAnnotations",
    include_str!("definitions/foxglove_msgs/ImageAnnotations.msg"),
    "RIHS01_47c6c0891ba263ec1b20d9b785c4261d4bc41051cbcc01668130e36aa2dcaee3",
    [CircleAnnotation, PointsAnnotation, TextAnnotation<'_>]
);
message!(
    CircleAnnotation,
    "foxglove_msgs/msg/CircleAnnotation",
    include_str!("definitions/foxglove_msgs/CircleAnnotation.msg"),
    "RIHS01_d3d8a00505117be541fe8b4b601aa90d5088209a75f313e3779be54db324d15b",
    [Time, Point2, Color]
);
message!(
    PointsAnnotation,
    "foxglove_msgs/msg/PointsAnnotation",
    include_str!("definitions/foxglove_msgs/PointsAnnotation.msg"),
    "RIHS01_61bd8dda01243d9c7232f00d9101577291b5a9bc1855b06ada4a29e0dc0496a7",
    [Time, Point2, Color]
);
message!(
    TextAnnotation<'_>,
    "foxglove_msgs/msg/TextAnnotation",
    include_str!("definitions/foxglove_msgs/TextAnnotation.msg"),
    "RIHS01_c02ec64b79eb5682e73b2b2572f127a27baec868b6ad6acc085abc39355a5b2b",
    [Time, Point2, Color]
);
message!(
    Point2,
    "foxglove_msgs/msg/Point2",
    include_str!("definitions/foxglove_msgs/Point2.msg"),
    "RIHS01_d85e823b78e2e88bc31629e305558bcdd2ecc9225f5f9390f96d91930f5696f0",
    []
);
message!(
    Color,
    "foxglove_msgs/msg/Color",
    include_str!("definitions/foxglove_msgs/Color.msg"),
    "RIHS01_ed1b16da40c954e6456b950c2ef4559c179e5cb98f1363cb28c3b90c6ee14120",
    []
);
