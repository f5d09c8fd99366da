//! Views `sensor_msgs/Image` as the scanner's image: checked once, never copied.

use thiserror::Error;

use super::{compressed::Codec, file_kind::FileKind};
use crate::{
    msg::sensor_msgs,
    scanner::image::{BayerPattern, ByteOrder, Image, ImageError, PixelFormat},
};

/// Encodings supported by the scanner.
pub(crate) const ENCODINGS: &str = "mono8, mono16, 8UC1, 16UC1, rgb8, bgr8, rgba8, bgra8, \
                             bayer_{rggb,bggr,gbrg,grbg}{8,16}";

/// Reasons to reject a camera's message. The frame is skipped and counted; the stream continues.
#[derive(Debug, Error)]
pub enum FrameRejected {
    /// Size, step and data are inconsistent.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// Unknown encoding.
    #[error("encoding {encoding:?} is not one of {ENCODINGS}")]
    Encoding {
        /// Stated text, truncated to 32 characters.
        encoding: String,
    },
    /// Unknown format of a compressed image.
    #[error("format {format:?} is neither jpeg nor png")]
    Format {
        /// Stated text, truncated to 32 characters.
        format: String,
    },
    /// The frame exceeds the memory limit.
    #[error(
        "image of {width} x {height} pixels takes {bytes} bytes, more than the limit of {max_frame_bytes}"
    )]
    TooLarge {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Larger of the bytes of the pixels and of the buffer, saturating at `u64::MAX`.
        bytes: u64,
        /// Limit, bytes.
        max_frame_bytes: u64,
    },
    /// Unsupported pixels in a compressed image.
    #[error(
        "{codec} image has {color:?} pixels, but must have 8-bit grey or colour, or 16-bit grey"
    )]
    Color {
        /// Stated format.
        codec: Codec,
        /// Pixels according to the file's header.
        color: image::ColorType,
    },
    /// Unsupported pixels in a picture file.
    #[error(
        "{kind} image has {color:?} pixels, but must have 8-bit grey or colour, or 16-bit grey"
    )]
    FileColor {
        /// Kind of the file.
        kind: FileKind,
        /// Pixels according to the file's header.
        color: image::ColorType,
    },
    /// A picture file that cannot be decoded.
    #[error("cannot decode {kind} image of {length} bytes: {reason}")]
    File {
        /// Kind of the file.
        kind: FileKind,
        /// Number of bytes.
        length: usize,
        /// Error of the decoder.
        reason: image::ImageError,
    },
    /// Truncated compressed image.
    #[error("JPEG image of {length} bytes has no end-of-image marker at its end")]
    Truncated {
        /// Number of bytes.
        length: usize,
    },
    /// A compressed image that cannot be decoded.
    #[error("cannot decode {codec} image of {length} bytes: {reason}")]
    Codec {
        /// Stated format.
        codec: Codec,
        /// Number of bytes.
        length: usize,
        /// Error of the decoder.
        reason: image::ImageError,
    },
}

/// Views an image message as an image.
///
/// # Errors
/// Unknown encoding; more than `max_frame_bytes` bytes, stated or required; inconsistent size, step and data.
pub(crate) fn image<'a>(
    message: &sensor_msgs::Image<'a>,
    max_frame_bytes: u64,
) -> Result<Image<'a>, FrameRejected> {
    let &sensor_msgs::Image { width, height, step, data, .. } = message;
    let order = if message.is_bigendian == 0 { ByteOrder::Little } else { ByteOrder::Big };
    let format = pixel_format(&message.encoding, order)
        .ok_or_else(|| FrameRejected::Encoding { encoding: excerpt(&message.encoding) })?;
    let pixel_bytes = u64::from(width)
        .saturating_mul(u64::from(height))
        .saturating_mul(format.bytes_per_pixel() as u64);
    let bytes = pixel_bytes.max(u64::from(height) * u64::from(step));
    if bytes > max_frame_bytes {
        return Err(FrameRejected::TooLarge { width, height, bytes, max_frame_bytes });
    }
    Ok(Image::new(width, height, step, format, data)?)
}

/// Returns the pixel format of an encoding; `None` if unsupported.
pub(super) fn pixel_format(encoding: &str, order: ByteOrder) -> Option<PixelFormat> {
    Some(match encoding {
        "mono8" | "8UC1" => PixelFormat::Mono8,
        "mono16" | "16UC1" => PixelFormat::Mono16(order),
        "rgb8" => PixelFormat::Rgb8,
        "bgr8" => PixelFormat::Bgr8,
        "rgba8" => PixelFormat::Rgba8,
        "bgra8" => PixelFormat::Bgra8,
        _ => {
            let (pattern, bits) = encoding.strip_prefix("bayer_")?.split_at_checked(4)?;
            let pattern = match pattern {
                "rggb" => BayerPattern::Rggb,
                "bggr" => BayerPattern::Bggr,
                "gbrg" => BayerPattern::Gbrg,
                "grbg" => BayerPattern::Grbg,
                _ => return None,
            };
            match bits {
                "8" => PixelFormat::Bayer8(pattern),
                "16" => PixelFormat::Bayer16(pattern, order),
                _ => return None,
            }
        }
    })
}

/// Returns the first 32 characters of a received text.
pub(super) fn excerpt(text: &str) -> String {
    text.chars().take(32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: u64 = 1 << 20;

    fn message<'a>(encoding: &'a str, step: u32, data: &'a [u8]) -> sensor_msgs::Image<'a> {
        sensor_msgs::Image {
            width: 3,
            height: 2,
            encoding: encoding.into(),
            step,
            data,
            ..Default::default()
        }
    }

    #[test]
    fn every_encoding_has_its_format() {
        let (little, big) = (ByteOrder::Little, ByteOrder::Big);
        let cases = [
            ("mono8", 0, PixelFormat::Mono8),
            ("8UC1", 1, PixelFormat::Mono8),
            ("mono16", 0, PixelFormat::Mono16(little)),
            ("16UC1", 1, PixelFormat::Mono16(big)),
            ("rgb8", 0, PixelFormat::Rgb8),
            ("bgr8", 0, PixelFormat::Bgr8),
            ("rgba8", 0, PixelFormat::Rgba8),
            ("bgra8", 0, PixelFormat::Bgra8),
            ("bayer_rggb8", 0, PixelFormat::Bayer8(BayerPattern::Rggb)),
            ("bayer_bggr8", 0, PixelFormat::Bayer8(BayerPattern::Bggr)),
            ("bayer_gbrg16", 0, PixelFormat::Bayer16(BayerPattern::Gbrg, little)),
            ("bayer_grbg16", 1, PixelFormat::Bayer16(BayerPattern::Grbg, big)),
        ];
        for (encoding, is_bigendian, format) in cases {
            let step = 3 * format.bytes_per_pixel() as u32 + 5;
            let data: Vec<u8> = (0..2 * step as u8).collect();
            let message = sensor_msgs::Image { is_bigendian, ..message(encoding, step, &data) };
            let image = image(&message, LIMIT).unwrap();
            assert_eq!(image.format(), format, "{encoding}");
            assert_eq!((image.width(), image.height(), image.step()), (3, 2, step as usize));
            assert_eq!(image.data(), data);
        }
    }

    #[test]
    fn unknown_encodings_are_rejected_with_a_list() {
        let long = "x".repeat(10_000);
        for encoding in [
            "",
            "yuv422",
            "mono32",
            "32FC1",
            "bayer_",
            "bayer_rgb8",
            "bayer_rggb12",
            "bayer_\u{e9}\u{e9}8",
            "MONO8",
            &long,
        ] {
            let error = image(&message(encoding, 3, &[0; 6]), LIMIT).unwrap_err();
            assert!(matches!(error, FrameRejected::Encoding { .. }), "{encoding}: {error}");
            let words = error.to_string();
            assert!(words.contains("bayer_{rggb,bggr,gbrg,grbg}{8,16}") && words.len() < 300);
        }
    }

    #[test]
    fn the_limit_applies_to_stated_bytes_without_overflow() {
        let data = [0; 6];
        let fits = message("mono8", 3, &data);
        assert!(image(&fits, 6).is_ok());
        let step = sensor_msgs::Image { step: u32::MAX, ..fits.clone() };
        let size = sensor_msgs::Image { width: 1 << 31, height: 1 << 31, ..fits.clone() };
        let all = sensor_msgs::Image {
            width: u32::MAX,
            height: u32::MAX,
            step: u32::MAX,
            encoding: "rgba8".into(),
            ..fits.clone()
        };
        for (message, limit, expected) in [
            (fits, 5, 6),
            (step, LIMIT, 2 * u64::from(u32::MAX)),
            (size, LIMIT, 1 << 62),
            (all, LIMIT, u64::MAX),
        ] {
            match image(&message, limit) {
                Err(FrameRejected::TooLarge { bytes, .. }) => assert_eq!(bytes, expected),
                other => panic!("{other:?}"),
            }
        }
    }

    #[test]
    fn size_step_and_data_must_agree() {
        let rejected = |message: &sensor_msgs::Image<'_>| match image(message, LIMIT) {
            Err(FrameRejected::Image(error)) => error,
            other => panic!("{other:?}"),
        };
        let good = message("mono8", 4, &[0; 8]);
        assert!(matches!(
            rejected(&sensor_msgs::Image { width: 0, ..good.clone() }),
            ImageError::Empty { width: 0, height: 2 }
        ));
        assert!(matches!(
            rejected(&sensor_msgs::Image { step: 2, ..good.clone() }),
            ImageError::Step { step: 2, needed: 3, .. }
        ));
        assert!(matches!(
            rejected(&sensor_msgs::Image { data: &[0; 7], ..good.clone() }),
            ImageError::Length { actual: 7, needed: 8, .. }
        ));
        let long = vec![0; 1 << 16];
        assert!(matches!(
            rejected(&sensor_msgs::Image {
                width: 1 << 16,
                height: 1,
                ..message("mono8", 1 << 16, &long)
            }),
            ImageError::TooLong { width: 65_536, height: 1 }
        ));
        // A 16-bit image whose step is stated in pixels.
        assert!(matches!(
            rejected(&sensor_msgs::Image { encoding: "mono16".into(), ..good }),
            ImageError::Step { step: 4, needed: 6, .. }
        ));
    }
}
