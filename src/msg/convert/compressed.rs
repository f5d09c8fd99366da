//! Decodes `sensor_msgs/CompressedImage` to the scanner's image, into a buffer reused between frames.

use std::{fmt, io::Cursor};

use image::{
    ColorType, ImageDecoder, ImageResult, Limits,
    codecs::{jpeg::JpegDecoder, png::PngDecoder},
};

use super::{
    encoding::Encoding,
    file_kind::{self, Decoded},
    frame::FrameRejected,
    jpeg, picture_file,
};
use crate::{
    msg::sensor_msgs::CompressedImage,
    scanner::image::{ByteOrder, Image, PixelFormat},
};

/// Compression of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Codec {
    /// JPEG, 8 bit.
    Jpeg,
    /// PNG, 8 or 16 bit.
    Png,
}

impl fmt::Display for Codec {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Jpeg => "JPEG",
            Self::Png => "PNG",
        })
    }
}

/// Byte order of the 16-bit samples from a decoder.
const NATIVE: ByteOrder =
    if cfg!(target_endian = "big") { ByteOrder::Big } else { ByteOrder::Little };

/// Memory that the PNG decoder may always use for its own buffers: 64 KiB.
const MIN_DECODER_BYTES: u64 = 1 << 16;

/// Size and pixel format of a decoded image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    width: u32,
    height: u32,
    format: PixelFormat,
}

impl Shape {
    /// Columns and rows.
    pub(crate) const fn size_px(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Memory layout of a pixel.
    pub(crate) const fn format(&self) -> PixelFormat {
        self.format
    }

    /// Views `pixels` as an image of this shape.
    ///
    /// # Errors
    /// The length of `pixels` does not match.
    pub(crate) fn image<'a>(&self, pixels: &'a [u8]) -> Result<Image<'a>, FrameRejected> {
        let &Self { width, height, format } = self;
        let step = width.saturating_mul(format.bytes_per_pixel() as u32);
        Ok(Image::new(width, height, step, format, pixels)?)
    }
}

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
/// colour as `rgb8` or `rgba8`, or with 16 bits. Reads TIFF, BMP and PGM files too.
///
/// The data decide between JPEG and PNG, whatever the format states. Allocates no pixels before the size in the file's
/// header is checked against `max_frame_bytes`; the decoders use a small multiple of that.
///
/// # Errors
/// A file other than JPEG and PNG, a size above the limit, or a file that is damaged.
pub(crate) fn unpack(
    message: &CompressedImage<'_>,
    max_frame_bytes: u64,
    pixels: &mut Vec<u8>,
) -> Result<Shape, FrameRejected> {
    if let Some(decoded) = file_kind::decode(message.data, max_frame_bytes, pixels) {
        let Decoded { width, height, format } = decoded?;
        return Ok(Shape { width, height, format });
    }
    let codec =
        picture_file::codec(&message.format, message.data).map_err(FrameRejected::Format)?;
    let source = message.format.split(';').next().unwrap_or_default().trim();
    let file = File { codec, data: message.data, max_frame_bytes };
    let (width, height, color) = match codec {
        Codec::Jpeg => {
            let whole = jpeg::whole(message.data);
            let whole = whole.ok_or(FrameRejected::Truncated { length: message.data.len() })?;
            file.decode(JpegDecoder::new(Cursor::new(whole)), pixels)?
        }
        Codec::Png => {
            let mut limits = Limits::no_limits();
            limits.max_alloc = Some(max_frame_bytes.max(MIN_DECODER_BYTES));
            file.decode(PngDecoder::with_limits(Cursor::new(message.data), limits), pixels)?
        }
    };
    let format = match (color, Encoding::of(source, NATIVE)) {
        (ColorType::L8, Some(Encoding::Packed(bayer @ PixelFormat::Bayer8(_))))
        | (ColorType::L16, Some(Encoding::Packed(bayer @ PixelFormat::Bayer16(..)))) => bayer,
        (ColorType::L8, _) => PixelFormat::Mono8,
        (ColorType::L16, _) => PixelFormat::Mono16(NATIVE),
        (ColorType::Rgb8, _) => PixelFormat::Rgb8,
        (ColorType::Rgba8, _) => PixelFormat::Rgba8,
        (ColorType::Rgb16, _) => PixelFormat::Rgb16(NATIVE),
        (ColorType::Rgba16, _) => PixelFormat::Rgba16(NATIVE),
        _ => return Err(FrameRejected::Color { codec, color }),
    };
    Ok(Shape { width, height, format })
}

/// What a compressed image is, from the header of its file.
#[derive(Clone, Debug)]
pub(crate) struct Kind {
    /// Columns.
    pub(crate) width: u32,
    /// Rows.
    pub(crate) height: u32,
    /// Codec and pixels, such as `jpeg rgb8`.
    pub(crate) encoding: String,
}

/// Reads the header of a compressed image.
///
/// # Errors
/// A file other than JPEG and PNG, or one whose header is damaged.
pub(crate) fn kind(message: &CompressedImage<'_>) -> Result<Kind, FrameRejected> {
    let data = message.data;
    let codec = picture_file::codec(&message.format, data).map_err(FrameRejected::Format)?;
    let opened = match codec {
        Codec::Jpeg => JpegDecoder::new(Cursor::new(data)).map(|file| size_and_color(&file)),
        Codec::Png => PngDecoder::new(Cursor::new(data)).map(|file| size_and_color(&file)),
    };
    let length = data.len();
    let broken = |reason| FrameRejected::Codec { codec, length, reason };
    let ((width, height), color) = opened.map_err(broken)?;
    let pixels = match color {
        ColorType::L8 => "mono8",
        ColorType::L16 => "mono16",
        ColorType::Rgb8 => "rgb8",
        ColorType::Rgba8 => "rgba8",
        ColorType::Rgb16 => "rgb16",
        ColorType::Rgba16 => "rgba16",
        _ => "grey with alpha",
    };
    let encoding = format!("{} {pixels}", codec.to_string().to_ascii_lowercase());
    Ok(Kind { width, height, encoding })
}

fn size_and_color(file: &impl ImageDecoder) -> ((u32, u32), ColorType) {
    (file.dimensions(), file.color_type())
}

/// A compressed image and the size limit of its pixels.
struct File<'a> {
    codec: Codec,
    data: &'a [u8],
    max_frame_bytes: u64,
}

impl File<'_> {
    /// Decodes into `pixels` and returns width, height and kind of the pixels.
    fn decode<D: ImageDecoder>(
        &self,
        decoder: ImageResult<D>,
        pixels: &mut Vec<u8>,
    ) -> Result<(u32, u32, ColorType), FrameRejected> {
        let &Self { codec, data, max_frame_bytes } = self;
        let broken = |reason| FrameRejected::Codec { codec, length: data.len(), reason };
        let decoder = decoder.map_err(broken)?;
        let (width, height) = decoder.dimensions();
        let color = decoder.color_type();
        let bytes = decoder.total_bytes();
        if bytes > max_frame_bytes {
            return Err(FrameRejected::TooLarge { width, height, bytes, max_frame_bytes });
        }
        // Zeroed, so that a partial frame contains no pixels of an earlier one.
        pixels.clear();
        pixels.resize(bytes as usize, 0);
        decoder.read_image(pixels).map_err(broken)?;
        Ok((width, height, color))
    }
}

#[cfg(test)]
mod tests;
