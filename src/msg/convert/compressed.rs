//! Decodes `sensor_msgs/CompressedImage` to the scanner's image, into a buffer reused between frames.

use image::ColorType;

use super::{
    decode::{self, NATIVE, Shape},
    encoding::Encoding,
    file_kind::FileKind,
    frame::FrameRejected,
};
use crate::{
    msg::sensor_msgs::CompressedImage,
    scanner::image::{Image, PixelFormat},
};

/// Decodes a compressed image into `pixels`, like `unpack`, and returns a view of it.
///
/// # Errors
/// Those of `unpack`.
pub fn image<'a>(
    message: &CompressedImage<'_>,
    max_frame_bytes: u64,
    pixels: &'a mut Vec<u8>,
) -> Result<Image<'a>, FrameRejected> {
    unpack(message, max_frame_bytes, pixels)?.image(pixels)
}

/// Decodes a compressed image into `pixels`: grey as 8- or 16-bit grey (or the Bayer pattern named in the format),
/// colour as `rgb8` or `rgba8`, or with 16 bits. The data decide the kind of the file, whatever the format states.
///
/// # Errors
/// Data that are no picture file, a size above `max_frame_bytes`, or a file that is damaged.
pub(crate) fn unpack(
    message: &CompressedImage<'_>,
    max_frame_bytes: u64,
    pixels: &mut Vec<u8>,
) -> Result<Shape, FrameRejected> {
    let kind =
        FileKind::of_message(&message.format, message.data).map_err(FrameRejected::Format)?;
    let mut shape = decode::decode(kind, message.data, max_frame_bytes, pixels)?;
    let source = message.format.split(';').next().unwrap_or_default().trim();
    shape.format = match (shape.format(), Encoding::of(source, NATIVE)) {
        (PixelFormat::Mono8, Some(Encoding::Packed(bayer @ PixelFormat::Bayer8(_))))
        | (PixelFormat::Mono16(_), Some(Encoding::Packed(bayer @ PixelFormat::Bayer16(..)))) => {
            bayer
        }
        (decoded, _) => decoded,
    };
    Ok(shape)
}

/// Size and encoding of a compressed image, from the header of its file.
#[derive(Clone, Debug)]
pub(crate) struct Kind {
    /// Columns.
    pub(crate) width: u32,
    /// Rows.
    pub(crate) height: u32,
    /// Kind of the file and pixels, such as `jpeg rgb8`.
    pub(crate) encoding: String,
}

/// Reads the header of a compressed image.
///
/// # Errors
/// Data that are no picture file, or one whose header is damaged.
pub(crate) fn kind(message: &CompressedImage<'_>) -> Result<Kind, FrameRejected> {
    let data = message.data;
    let kind = FileKind::of_message(&message.format, data).map_err(FrameRejected::Format)?;
    let broken = |reason| FrameRejected::File { kind, length: data.len(), reason };
    let ([width, height], color) = kind.header(data).map_err(broken)?;
    let pixels = match color {
        ColorType::L8 => "mono8",
        ColorType::L16 => "mono16",
        ColorType::La8 | ColorType::La16 => "grey with alpha",
        ColorType::Rgb8 => "rgb8",
        ColorType::Rgba8 => "rgba8",
        ColorType::Rgb16 => "rgb16",
        ColorType::Rgba16 => "rgba16",
        _ => "pixels of another kind",
    };
    Ok(Kind { width, height, encoding: format!("{} {pixels}", kind.format()) })
}

#[cfg(test)]
mod tests;
