//! Views `sensor_msgs/Image` as the scanner's image: checked once, never copied.

use thiserror::Error;

use super::{
    encoding::{Chroma, Encoding, UnknownEncoding, excerpt},
    file_kind::{FileKind, KINDS, UnknownPicture},
};
use crate::{
    msg::sensor_msgs,
    scanner::image::{ByteOrder, Image, ImageError, PixelFormat},
};

/// Reasons to reject a camera's message. The frame is skipped and counted; the stream continues.
#[derive(Debug, Error)]
pub enum FrameRejected {
    /// Size, step and data are inconsistent.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// Unknown encoding.
    #[error("{0}")]
    Encoding(UnknownEncoding),
    /// Luma and chroma planes of another length than size and step say.
    #[error(
        "data has {actual} bytes, but {encoding} of {width} x {height} pixels with a step of {step} bytes needs {needed}: \
         {height} rows of luma, then the chroma (height counts the rows of luma alone)"
    )]
    Planes {
        /// Stated encoding.
        encoding: String,
        /// Columns.
        width: u32,
        /// Rows of luma.
        height: u32,
        /// Bytes from the start of one row of luma to the next.
        step: u32,
        /// Bytes in the buffer.
        actual: u64,
        /// Bytes expected.
        needed: u64,
    },
    /// Data that are no picture file.
    #[error("{0}")]
    Format(UnknownPicture),
    /// A file that is no picture.
    #[error("is no picture: its first bytes are not those of {KINDS}")]
    NoPicture,
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
    /// Unsupported pixels in a picture file.
    #[error("{kind} image has {color:?} pixels, but must have 8-bit or 16-bit grey or colour")]
    Color {
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
    /// Truncated JPEG file.
    #[error("JPEG image of {length} bytes is cut off: it has no end-of-image marker")]
    Truncated {
        /// Number of bytes.
        length: usize,
    },
}

/// Views an image message as an image. Of an image in planes it is the luma plane.
///
/// # Errors
/// Unknown encoding; more than `max_frame_bytes` bytes, stated or required; inconsistent size, step and data.
pub(crate) fn image<'a>(
    message: &sensor_msgs::Image<'a>,
    max_frame_bytes: u64,
) -> Result<Image<'a>, FrameRejected> {
    let &sensor_msgs::Image { width, height, step, data, .. } = message;
    let order = if message.is_bigendian == 0 { ByteOrder::Little } else { ByteOrder::Big };
    let encoding = Encoding::of(&message.encoding, order)
        .ok_or_else(|| FrameRejected::Encoding(UnknownEncoding::new(&message.encoding)))?;
    let plane = |row: u64, chroma: Option<Chroma>| {
        let chroma = chroma.map_or(0, |chroma| chroma.bytes(height, row));
        row.saturating_mul(height.into()).saturating_add(chroma)
    };
    let bytes = |bytes_per_pixel: usize, chroma| {
        let row = u64::from(width).saturating_mul(bytes_per_pixel as u64);
        plane(row.max(step.into()), chroma)
    };
    let bytes = match encoding {
        Encoding::Packed(format) => bytes(format.bytes_per_pixel(), None),
        Encoding::SemiPlanar(chroma) => bytes(1, Some(chroma)),
    };
    if bytes > max_frame_bytes {
        return Err(FrameRejected::TooLarge { width, height, bytes, max_frame_bytes });
    }
    match encoding {
        Encoding::Packed(format) => Ok(Image::new(width, height, step, format, data)?),
        Encoding::SemiPlanar(chroma) => luma_plane(message, chroma),
    }
}

/// Views the luma plane in front of a chroma plane.
///
/// ROS defines neither the step nor the length of such images exactly. Two forms are in use: `step` is the distance of the
/// rows of luma, those of the chroma follow with the same distance; or `step` is the length of the data over `height`, and
/// nothing is padded. In both, `height` counts the rows of luma.
fn luma_plane<'a>(
    message: &sensor_msgs::Image<'a>,
    chroma: Chroma,
) -> Result<Image<'a>, FrameRejected> {
    let &sensor_msgs::Image { width, height, step, data, .. } = message;
    let actual = data.len() as u64;
    let luma = |stride: u32| u64::from(stride) * u64::from(height);
    let needed = |stride: u32| luma(stride) + chroma.bytes(height, stride.into());
    // A pair of chroma samples takes two bytes, also behind a last column without a neighbour.
    let paired = luma(step) + chroma.bytes(height, u64::from(step) + u64::from(step % 2));
    let is_paired = chroma == Chroma::Quarter && actual == paired;
    let stride = if actual == needed(step) || is_paired {
        step
    } else if actual == needed(width) && actual == luma(step) {
        width
    } else if width == 0 || height == 0 || step < width {
        // The view below states the reason.
        step
    } else {
        let encoding = excerpt(&message.encoding);
        let needed = needed(step);
        return Err(FrameRejected::Planes { encoding, width, height, step, actual, needed });
    };
    let plane = data.get(..luma(stride) as usize).unwrap_or(data);
    Ok(Image::new(width, height, stride, PixelFormat::Luma8, plane)?)
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
    fn unknown_encodings_are_rejected_with_a_list() {
        let long = "x".repeat(10_000);
        for encoding in [
            "",
            "yuv420",
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
            assert!(matches!(error, FrameRejected::Encoding(_)), "{encoding}: {error}");
            let words = error.to_string();
            assert!(words.contains("bayer_{rggb,bggr,gbrg,grbg}{8,16}") && words.len() < 600);
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

    /// Step 8 for a row of 3 pixels, 2 rows: each layout with padding, and what it needs.
    #[test]
    fn every_layout_is_viewed_with_its_step() {
        for (encoding, bytes_per_pixel) in [
            ("mono8", 1),
            ("8UC3", 3),
            ("8UC4", 4),
            ("16UC1", 2),
            ("yuv422_yuy2", 2),
            ("yuyv", 2),
            ("yuv422", 2),
            ("uyvy", 2),
            ("rgb16", 6),
            ("bgr16", 6),
            ("rgba16", 8),
            ("bgra16", 8),
        ] {
            for padding in [0, 1, 5] {
                let step = 3 * bytes_per_pixel + padding;
                let data: Vec<u8> = (0..2 * step as u8).collect();
                let message = message(encoding, step, &data);
                let viewed = image(&message, LIMIT).unwrap();
                assert_eq!((viewed.width(), viewed.height()), (3, 2), "{encoding}");
                assert_eq!(
                    (viewed.step(), viewed.data()),
                    (step as usize, &data[..]),
                    "{encoding}"
                );
            }
            let short = vec![0; 2 * (3 * bytes_per_pixel as usize - 1)];
            let error =
                image(&message(encoding, 3 * bytes_per_pixel - 1, &short), LIMIT).unwrap_err();
            assert!(matches!(error, FrameRejected::Image(ImageError::Step { .. })), "{encoding}");
        }
    }

    /// Sizes of V4L2's definitions: NV12 and NV21 have a row of chroma for two of luma, NV24 two for one.
    #[test]
    fn the_luma_plane_lies_in_front_of_the_chroma() {
        for (encoding, [width, height, step], length) in [
            ("nv12", [4, 2, 4], 12),
            ("nv21", [4, 2, 4], 12),
            ("nv12", [4, 2, 6], 18),
            ("nv12", [4, 3, 4], 12 + 8),
            ("nv12", [3, 2, 3], 9),
            ("nv12", [3, 2, 3], 6 + 4),
            ("nv12", [3, 3, 4], 12 + 8),
            ("nv24", [4, 2, 4], 24),
            ("nv24", [3, 3, 5], 45),
        ] {
            let data: Vec<u8> = (0..length).collect();
            let message = sensor_msgs::Image { height, width, ..message(encoding, step, &data) };
            let image = image(&message, LIMIT).unwrap();
            assert_eq!(image.format(), PixelFormat::Luma8);
            assert_eq!(
                (image.width(), image.height(), image.step()),
                (width, height, step as usize)
            );
            assert_eq!(image.data().as_ptr_range().start, data.as_ptr(), "no copy");
            assert_eq!(image.data().len() as u32, step * height);
        }
    }

    /// Drivers that divide the length by the height state one and a half times the width (three times for NV24).
    #[test]
    fn a_step_of_luma_and_chroma_together_is_understood() {
        for (encoding, step) in [("nv12", 6), ("nv24", 12)] {
            let data: Vec<u8> = (0..2 * step as u8).collect();
            let message = sensor_msgs::Image { width: 4, ..message(encoding, step, &data) };
            let image = image(&message, LIMIT).unwrap();
            assert_eq!((image.step(), image.data()), (4, &data[..8]), "{encoding}");
        }
    }

    #[test]
    fn planes_of_another_length_are_rejected() {
        for (encoding, height, step, length) in [
            ("nv12", 2, 4, 8),
            ("nv12", 2, 4, 11),
            ("nv12", 2, 4, 13),
            ("nv21", 2, 8, 16),
            ("nv24", 2, 4, 12),
            // The height of the buffer instead of that of the picture.
            ("nv12", 3, 4, 12),
        ] {
            let data = vec![0; length];
            let message = sensor_msgs::Image { width: 4, height, ..message(encoding, step, &data) };
            let error = image(&message, LIMIT).unwrap_err();
            let words = error.to_string();
            assert!(matches!(error, FrameRejected::Planes { .. }), "{encoding} {length}: {words}");
            assert!(words.contains("rows of luma alone") && words.contains(encoding), "{words}");
        }
        let narrow = sensor_msgs::Image { width: 4, ..message("nv12", 3, &[0; 9]) };
        let error = image(&narrow, LIMIT).unwrap_err();
        assert!(matches!(error, FrameRejected::Image(ImageError::Step { .. })), "{error}");
    }

    #[test]
    fn the_limit_counts_the_chroma() {
        let data = [0; 12];
        let message = sensor_msgs::Image { width: 4, ..message("nv12", 4, &data) };
        assert!(image(&message, 12).is_ok());
        assert!(matches!(image(&message, 11), Err(FrameRejected::TooLarge { bytes: 12, .. })));
    }
}
