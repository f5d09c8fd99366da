//! Pictures with a known line, as files and as messages.

use std::{fs, path::Path};

use image::{DynamicImage, GrayImage, ImageBuffer, ImageFormat, Luma, Rgb, RgbImage};
use laser_profiler::{
    bag::{BagReader, Filter, RawMessage, ReadOptions, RecordOptions, Recorder, Times, Topic},
    msg::{
        builtin_interfaces::Time,
        cdr,
        laser_profiler_msgs::{Centerline, Profile},
        sensor_msgs::{Image, JointState},
        std_msgs::Header,
    },
};

use crate::recordings;

/// Pictures of a series.
pub(super) const NUM: usize = 12;
pub(super) const WIDTH: u32 = 160;
pub(super) const HEIGHT: u32 = 48;
/// Between two pictures at 50 Hz, nanoseconds.
pub(super) const PERIOD_NS: i64 = 20_000_000;

/// Stamp of a picture at 50 Hz: counted from 1, because 0 means no clock.
pub(super) fn stamp_ns(number: usize) -> i64 {
    (number as i64 + 1) * PERIOD_NS
}

/// Pixels of the pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scene {
    Grey,
    Deep,
    Color,
    DeepColor,
}

impl Scene {
    pub(super) const ALL: [Self; 4] = [Self::Grey, Self::Deep, Self::Color, Self::DeepColor];

    /// The row of the line in a column: a slope that moves from picture to picture.
    pub(super) fn row_px(self, column: f32, number: usize) -> f32 {
        12.0 + 0.03 * column
            + 1.3 * number as f32
            + if matches!(self, Self::Color | Self::DeepColor) { 2.0 } else { 0.0 }
    }

    fn level(self, x: u32, y: u32, number: usize) -> f32 {
        let away = (y as f32 - self.row_px(x as f32, number)) / 1.8;
        8.0 + 190.0 * (-0.5 * away * away).exp()
    }

    pub(super) fn picture(self, number: usize) -> DynamicImage {
        let level = |x, y| self.level(x, y, number);
        match self {
            Self::Grey => {
                GrayImage::from_fn(WIDTH, HEIGHT, |x, y| Luma([level(x, y).round() as u8])).into()
            }
            Self::Deep => ImageBuffer::from_fn(WIDTH, HEIGHT, |x, y| {
                Luma([(257.0 * level(x, y)).round() as u16])
            })
            .into(),
            Self::Color => RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
                Rgb([level(x, y), 0.3 * level(x, y), 5.0].map(|level| level.round() as u8))
            })
            .into(),
            Self::DeepColor => ImageBuffer::from_fn(WIDTH, HEIGHT, |x, y| {
                let level = 257.0 * level(x, y);
                Rgb([level, 0.3 * level, 1285.0].map(|level| level.round() as u16))
            })
            .into(),
        }
    }
}

/// Kinds of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Png,
    Jpeg,
    Tiff,
    Bmp,
    Pgm,
}

impl Kind {
    pub(super) const ALL: [Self; 5] = [Self::Png, Self::Jpeg, Self::Tiff, Self::Bmp, Self::Pgm];

    /// JPEG and BMP files have 8 bits.
    pub(super) fn holds(self, scene: Scene) -> bool {
        !matches!(scene, Scene::Deep | Scene::DeepColor) || !matches!(self, Self::Jpeg | Self::Bmp)
    }

    pub(super) fn name(self, number: usize) -> String {
        let ending = match self {
            Self::Png => "png",
            Self::Jpeg => "JPG",
            Self::Tiff => "tif",
            Self::Bmp => "bmp",
            Self::Pgm => "pgm",
        };
        format!("frame_{number}.{ending}")
    }
}

pub(super) fn write(path: &Path, kind: Kind, picture: &DynamicImage) {
    let format = match kind {
        Kind::Png => ImageFormat::Png,
        Kind::Jpeg => ImageFormat::Jpeg,
        Kind::Tiff => ImageFormat::Tiff,
        Kind::Bmp => ImageFormat::Bmp,
        Kind::Pgm => ImageFormat::Pnm,
    };
    let mut bytes = std::io::Cursor::new(Vec::new());
    if kind == Kind::Jpeg {
        let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 95);
        picture.write_with_encoder(encoder).unwrap();
    } else {
        picture.write_to(&mut bytes, format).unwrap();
    }
    fs::write(path, bytes.into_inner()).unwrap();
}

/// The picture as an uncompressed image message.
pub(super) fn message(picture: &DynamicImage, number: usize) -> Vec<u8> {
    message_at(picture, stamp_ns(number))
}

pub(super) fn message_at(picture: &DynamicImage, stamp_ns: i64) -> Vec<u8> {
    let (encoding, bytes_per_pixel) = match picture {
        DynamicImage::ImageLuma8(_) => ("mono8", 1),
        DynamicImage::ImageLuma16(_) => ("mono16", 2),
        DynamicImage::ImageRgb16(_) => ("rgb16", 6),
        _ => ("rgb8", 3),
    };
    recordings::image_of(picture.as_bytes(), 0, |image: &mut Image<'_>| {
        image.header.stamp = Time::from_ns(stamp_ns);
        (image.width, image.height) = (picture.width(), picture.height());
        image.step = bytes_per_pixel * image.width;
        image.encoding = encoding.into();
    })
}

pub(super) fn position_message(stamp_ns: i64, position: f64) -> Vec<u8> {
    let header = Header { stamp: Time::from_ns(stamp_ns), frame_id: "".into() };
    let state = JointState { header, position: vec![position], ..JointState::default() };
    let mut bytes = Vec::new();
    cdr::encode(&state, &mut bytes).unwrap();
    bytes
}

/// Records images and positions at their times.
pub(super) fn record_both(
    bag: &Path,
    topics: &[Topic; 2],
    images: &[Vec<u8>],
    joints: &[Vec<u8>],
    time_ns: impl Fn(usize) -> i64,
) {
    let mut recorder = Recorder::create(bag, RecordOptions::default()).unwrap();
    let [image, joint] = topics.each_ref().map(|topic| recorder.add_topic(topic).unwrap());
    for (number, (picture, position)) in images.iter().zip(joints).enumerate() {
        let log_ns = time_ns(number);
        let times = Times { log_ns, publish_ns: log_ns, sequence: number as u32 + 1 };
        recorder.write(joint, times, position).unwrap();
        recorder.write(image, times, picture).unwrap();
    }
    recorder.finish().unwrap();
}

/// The line found in a picture.
#[derive(Debug)]
pub(super) struct Line {
    pub(super) stamp_ns: i64,
    /// Everything that is published about its points: column, row, sigma, width, intensity, flags.
    pub(super) points: Vec<(f32, f32, f32, f32, f32, u8)>,
}

impl Line {
    /// Largest distance from the true line, pixels; infinite unless nearly every column has a point.
    pub(super) fn error_px(&self, scene: Scene, number: usize) -> f32 {
        if self.points.len() + 8 < WIDTH as usize {
            return f32::INFINITY;
        }
        let error =
            |&(u, v, ..): &(f32, f32, f32, f32, f32, u8)| (v - scene.row_px(u, number)).abs();
        self.points.iter().map(error).fold(0.0, f32::max)
    }
}

fn messages(results: &Path, name: &str) -> Vec<RawMessage> {
    let reader = BagReader::open(results, &ReadOptions::default()).unwrap();
    reader
        .messages(&Filter::topics([format!("/laser_profiler/{name}")]))
        .map(Result::unwrap)
        .collect()
}

pub(super) fn lines(results: &Path) -> Vec<Line> {
    let line = |message: &RawMessage| {
        let line: Centerline<'_> = cdr::decode(&message.data).unwrap();
        let point = |at: usize| {
            (
                line.u[at],
                line.v[at],
                line.sigma[at],
                line.width[at],
                line.intensity[at],
                line.flags[at],
            )
        };
        Line { stamp_ns: line.header.stamp.to_ns(), points: (0..line.u.len()).map(point).collect() }
    };
    messages(results, "centerline").iter().map(line).collect()
}

/// Bytes of the clouds.
pub(super) fn clouds(results: &Path) -> Vec<Vec<u8>> {
    messages(results, "points").into_iter().map(|message| message.data).collect()
}

/// Position of each profile along the scan, metres.
pub(super) fn profile_positions(results: &Path) -> Vec<f64> {
    let position =
        |message: &RawMessage| cdr::decode::<Profile<'_>>(&message.data).unwrap().trace.position;
    messages(results, "profile").iter().map(position).collect()
}
