//! Pictures as messages: files as they are, or their pixels.

use super::{compressed, file_kind::FileKind, frame::FrameRejected};
use crate::{
    msg::{
        sensor_msgs::{CompressedImage, Image},
        std_msgs::Header,
    },
    scanner::image::{self, ByteOrder, PixelFormat},
};

/// Returns a picture file as a compressed image.
pub(crate) fn compressed<'a>(
    header: Header<'a>,
    kind: FileKind,
    file: &'a [u8],
) -> CompressedImage<'a> {
    CompressedImage { header, format: kind.format().into(), data: file }
}

/// Decodes a picture file; its pixels replace the content of `pixels`.
///
/// # Errors
/// A size above `max_frame_bytes`, pixels that are not supported, or no picture that can be read.
pub(crate) fn decode<'a>(
    file: &[u8],
    max_frame_bytes: u64,
    pixels: &'a mut Vec<u8>,
) -> Result<image::Image<'a>, FrameRejected> {
    let kind = FileKind::of(file).ok_or(FrameRejected::NoPicture)?;
    compressed::image(&compressed(Header::default(), kind, file), max_frame_bytes, pixels)
}

/// Returns a picture file as an uncompressed image, whose pixels replace the content of `pixels`.
///
/// # Errors
/// A size above `max_frame_bytes`, pixels that are not supported, or a damaged file.
pub(crate) fn raw<'a>(
    message: CompressedImage<'a>,
    max_frame_bytes: u64,
    pixels: &'a mut Vec<u8>,
) -> Result<Image<'a>, FrameRejected> {
    let shape = compressed::unpack(&message, max_frame_bytes, pixels)?;
    let [width, height] = shape.size_px();
    let (encoding, is_bigendian) = match shape.format() {
        PixelFormat::Mono16(order) => ("mono16", order == ByteOrder::Big),
        PixelFormat::Rgb8 => ("rgb8", false),
        PixelFormat::Rgba8 => ("rgba8", false),
        PixelFormat::Rgb16(order) => ("rgb16", order == ByteOrder::Big),
        PixelFormat::Rgba16(order) => ("rgba16", order == ByteOrder::Big),
        // The decoders return no other format for a file that names no Bayer pattern.
        _ => ("mono8", false),
    };
    Ok(Image {
        header: message.header,
        height,
        width,
        encoding: encoding.into(),
        is_bigendian: is_bigendian.into(),
        step: width.saturating_mul(shape.format().bytes_per_pixel() as u32),
        data: pixels,
    })
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use ::image::{DynamicImage, ImageBuffer, ImageFormat, Luma, Rgb, Rgba};

    use super::*;
    use crate::msg::convert::frame;

    /// The message, seen as an image, has the picture's pixels.
    #[test]
    fn the_message_has_the_pixels_of_the_file() {
        let pictures: [(DynamicImage, PixelFormat); 4] = [
            (ImageBuffer::from_fn(7, 4, |x, y| Luma([(x * y) as u8])).into(), PixelFormat::Mono8),
            (
                ImageBuffer::from_fn(7, 4, |x, y| Luma([(999 * x + y) as u16])).into(),
                PixelFormat::Mono16(ByteOrder::Little),
            ),
            (
                ImageBuffer::from_fn(7, 4, |x, y| Rgb([x as u8, y as u8, 9])).into(),
                PixelFormat::Rgb8,
            ),
            (
                ImageBuffer::from_fn(7, 4, |x, y| Rgba([x as u8, y as u8, 9, 8])).into(),
                PixelFormat::Rgba8,
            ),
        ];
        for (picture, format) in pictures {
            for kind in [ImageFormat::Png, ImageFormat::Tiff] {
                let mut file = Cursor::new(Vec::new());
                picture.write_to(&mut file, kind).unwrap();
                let file = file.into_inner();
                let message = compressed(Header::default(), FileKind::of(&file).unwrap(), &file);
                let mut pixels = Vec::new();
                let image = raw(message, 1 << 20, &mut pixels).unwrap();
                let seen = frame::image(&image, 1 << 20).unwrap();
                assert_eq!((seen.width(), seen.height()), (7, 4));
                if cfg!(target_endian = "little") {
                    assert_eq!(seen.format(), format);
                }
                assert_eq!(seen.data(), picture.as_bytes());
            }
        }
    }
}
