//! Decodes `sensor_msgs/CompressedImage` to the scanner's image, into a buffer reused between frames.

use std::{fmt, io::Cursor};

use image::{
    ColorType, ImageDecoder, ImageResult, Limits,
    codecs::{jpeg::JpegDecoder, png::PngDecoder},
};

use super::{
    file_kind::{self, Decoded},
    frame::{FrameRejected, excerpt, pixel_format},
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
/// colour as `rgb8` or `rgba8`. Reads TIFF, BMP and PGM files too.
///
/// Allocates no pixels before the size in the file's header is checked against `max_frame_bytes`; the decoders use a
/// small multiple of that.
///
/// # Errors
/// A format other than JPEG and PNG, a size above the limit, or a file that is damaged or of another format than
/// stated.
pub(crate) fn unpack(
    message: &CompressedImage<'_>,
    max_frame_bytes: u64,
    pixels: &mut Vec<u8>,
) -> Result<Shape, FrameRejected> {
    if let Some(decoded) = file_kind::decode(message.data, max_frame_bytes, pixels) {
        let Decoded { width, height, format } = decoded?;
        return Ok(Shape { width, height, format });
    }
    let codec = codec(&message.format)
        .ok_or_else(|| FrameRejected::Format { format: excerpt(&message.format) })?;
    let source = message.format.split(';').next().unwrap_or_default().trim();
    let file = File { codec, data: message.data, max_frame_bytes };
    let reader = Cursor::new(message.data);
    let (width, height, color) = match codec {
        Codec::Jpeg if !ends_as_jpeg(message.data) => {
            return Err(FrameRejected::Truncated { length: message.data.len() });
        }
        Codec::Jpeg => file.decode(JpegDecoder::new(reader), pixels)?,
        Codec::Png => {
            let mut limits = Limits::no_limits();
            limits.max_alloc = Some(max_frame_bytes.max(MIN_DECODER_BYTES));
            file.decode(PngDecoder::with_limits(reader, limits), pixels)?
        }
    };
    let format = match (color, pixel_format(source, NATIVE)) {
        (ColorType::L8, Some(bayer @ PixelFormat::Bayer8(_)))
        | (ColorType::L16, Some(bayer @ PixelFormat::Bayer16(..))) => bayer,
        (ColorType::L8, _) => PixelFormat::Mono8,
        (ColorType::L16, _) => PixelFormat::Mono16(NATIVE),
        (ColorType::Rgb8, _) => PixelFormat::Rgb8,
        (ColorType::Rgba8, _) => PixelFormat::Rgba8,
        _ => return Err(FrameRejected::Color { codec, color }),
    };
    Ok(Shape { width, height, format })
}

/// Returns the codec of a format: its only word, or the first word after the `;` written by `image_transport`.
fn codec(format: &str) -> Option<Codec> {
    let compression = format.rsplit(';').next()?;
    match compression.split_ascii_whitespace().next()?.to_ascii_lowercase().as_str() {
        "jpeg" | "jpg" => Some(Codec::Jpeg),
        "png" => Some(Codec::Png),
        _ => None,
    }
}

/// Returns true if the data ends with the end-of-image marker, possibly padded. The decoder completes truncated images
/// silently.
fn ends_as_jpeg(data: &[u8]) -> bool {
    let padding = data.iter().rev().take_while(|&&byte| byte == 0).count();
    data[..data.len() - padding].ends_with(&[0xff, 0xd9])
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
mod tests {
    use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

    use super::*;
    use crate::scanner::image::BayerPattern;

    const LIMIT: u64 = 1 << 20;

    fn png(width: u32, height: u32, pixels: &[u8], color: ExtendedColorType) -> Vec<u8> {
        let mut file = Vec::new();
        PngEncoder::new(&mut file).write_image(pixels, width, height, color).unwrap();
        file
    }

    fn jpeg(width: u32, height: u32, pixels: &[u8], color: ExtendedColorType) -> Vec<u8> {
        let mut file = Vec::new();
        image::codecs::jpeg::JpegEncoder::new_with_quality(&mut file, 100)
            .write_image(pixels, width, height, color)
            .unwrap();
        file
    }

    fn message<'a>(format: &'a str, data: &'a [u8]) -> CompressedImage<'a> {
        CompressedImage { format: format.into(), data, ..Default::default() }
    }

    #[test]
    fn png_decodes_exactly() {
        let grey: Vec<u8> = (0..6).collect();
        let deep: Vec<u8> =
            [1, 500, 65535, 256, 0, 7].iter().flat_map(|v: &u16| v.to_ne_bytes()).collect();
        let color: Vec<u8> = (0..18).collect();
        let alpha: Vec<u8> = (0..24).collect();
        let bayer8 = PixelFormat::Bayer8(BayerPattern::Gbrg);
        let mut pixels = vec![9; 100];
        for (format, file, expected, samples) in [
            ("png", png(3, 2, &grey, ExtendedColorType::L8), PixelFormat::Mono8, &grey),
            (
                "mono16; png compressed ",
                png(3, 2, &deep, ExtendedColorType::L16),
                PixelFormat::Mono16(NATIVE),
                &deep,
            ),
            (
                "bgr8; png compressed bgr8",
                png(3, 2, &color, ExtendedColorType::Rgb8),
                PixelFormat::Rgb8,
                &color,
            ),
            ("PNG", png(3, 2, &alpha, ExtendedColorType::Rgba8), PixelFormat::Rgba8, &alpha),
            (
                "bayer_gbrg8; png compressed ",
                png(3, 2, &grey, ExtendedColorType::L8),
                bayer8,
                &grey,
            ),
        ] {
            let image = image(&message(format, &file), LIMIT, &mut pixels).unwrap();
            assert_eq!(
                (image.width(), image.height(), image.format()),
                (3, 2, expected),
                "{format}"
            );
            assert_eq!(image.data(), samples, "{format}");
        }
    }

    #[test]
    fn jpeg_decodes_approximately() {
        // 16 x 8 pixels: whole blocks, each of a single colour.
        let grey: Vec<u8> = (0..128).map(|i| if i % 16 < 8 { 40 } else { 200 }).collect();
        let color: Vec<u8> = grey.iter().flat_map(|&v| [v, 100, 255 - v]).collect();
        for (format, file, expected, samples) in [
            ("jpeg", jpeg(16, 8, &grey, ExtendedColorType::L8), PixelFormat::Mono8, &grey),
            (
                "mono8; jpeg compressed ",
                jpeg(16, 8, &grey, ExtendedColorType::L8),
                PixelFormat::Mono8,
                &grey,
            ),
            (
                "rgb8; jpeg compressed bgr8",
                jpeg(16, 8, &color, ExtendedColorType::Rgb8),
                PixelFormat::Rgb8,
                &color,
            ),
        ] {
            let mut pixels = Vec::new();
            let image = image(&message(format, &file), LIMIT, &mut pixels).unwrap();
            assert_eq!(
                (image.width(), image.height(), image.format()),
                (16, 8, expected),
                "{format}"
            );
            let farthest = image.data().iter().zip(samples).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(farthest.unwrap() <= 8, "{format}: {farthest:?}");
        }
    }

    #[test]
    fn false_sizes_are_rejected_before_allocation() {
        let mut false_jpeg = jpeg(16, 8, &[0; 128], ExtendedColorType::L8);
        let frame = false_jpeg.windows(2).position(|marker| marker == [0xff, 0xc0]).unwrap();
        false_jpeg[frame + 5..frame + 9].fill(0xff);
        // Width and height of the header chunk, and its checksum (computed with zlib).
        let mut false_png = png(3, 2, &[0; 6], ExtendedColorType::L8);
        false_png[16..24].copy_from_slice(&[0, 0, 0xff, 0xff, 0, 0, 0xff, 0xff]);
        false_png[29..33].copy_from_slice(&[0x93, 0x6e, 0x86, 0x8c]);
        for (format, file) in [("jpeg", false_jpeg), ("png", false_png)] {
            let mut pixels = Vec::new();
            let error = image(&message(format, &file), LIMIT, &mut pixels).unwrap_err();
            assert!(
                matches!(error, FrameRejected::TooLarge { width: 65535, height: 65535, .. }),
                "{format}: {error}"
            );
            assert_eq!(pixels.capacity(), 0, "{format}");
        }
    }

    #[test]
    fn damaged_and_unknown_files_are_rejected() {
        let grey: Vec<u8> = (0..128).collect();
        let jpeg = jpeg(16, 8, &grey, ExtendedColorType::L8);
        let png = png(16, 8, &grey, ExtendedColorType::L8);
        let rejected = |format: &str, data: &[u8]| {
            image(&message(format, data), LIMIT, &mut Vec::new()).unwrap_err()
        };
        for length in 0..jpeg.len() {
            let error = rejected("jpeg", &jpeg[..length]);
            assert!(matches!(error, FrameRejected::Truncated { .. }), "{length}: {error}");
        }
        for length in 0..png.len() - 16 {
            let error = rejected("png", &png[..length]);
            assert!(
                matches!(error, FrameRejected::Codec { codec: Codec::Png, .. }),
                "{length}: {error}"
            );
        }
        assert!(matches!(rejected("jpeg", &[0xff, 0xd9]), FrameRejected::Codec { .. }));
        assert!(matches!(rejected("png", &jpeg), FrameRejected::Codec { .. }));
        for format in ["", ";", "tiff", "16UC1; compressedDepth png", "rgb8; rvl"] {
            assert!(matches!(rejected(format, &png), FrameRejected::Format { .. }), "{format}");
        }
    }

    #[test]
    fn padded_jpeg_is_accepted_and_unsupported_colour_is_named() {
        let mut padded = jpeg(16, 8, &[7; 128], ExtendedColorType::L8);
        padded.extend([0; 5]);
        assert!(image(&message("jpeg", &padded), LIMIT, &mut Vec::new()).is_ok());
        let deep_color = png(1, 1, &[0; 6], ExtendedColorType::Rgb16);
        let error = image(&message("png", &deep_color), LIMIT, &mut Vec::new()).unwrap_err();
        assert!(matches!(error, FrameRejected::Color { color: ColorType::Rgb16, .. }), "{error}");
    }
}
