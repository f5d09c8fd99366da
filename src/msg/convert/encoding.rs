//! The names of image encodings, those of `sensor_msgs/image_encodings.hpp` and OpenCV's.

use std::fmt;

use crate::scanner::image::{BayerPattern, ByteOrder, PixelFormat};

/// Encodings supported by the scanner.
pub(crate) const ENCODINGS: &str = "mono8, mono16, rgb8, bgr8, rgba8, bgra8, rgb16, bgr16, rgba16, bgra16, \
     8UC1, 8UC3, 8UC4, 16UC1, 16UC3, 16UC4, bayer_{rggb,bggr,gbrg,grbg}{8,16}, \
     yuv422_yuy2, yuyv, yuv422, uyvy, nv12, nv21, nv24";

/// Memory layout of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// Pixel by pixel.
    Packed(PixelFormat),
    /// A plane of 8-bit luma, then a plane of chroma.
    SemiPlanar(Chroma),
}

/// Resolution of the chroma plane behind a luma plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Chroma {
    /// 4:2:0, one pair for four pixels: half as many rows as the luma has, of the same length.
    Quarter,
    /// 4:4:4, one pair a pixel: as many rows, twice as long.
    Full,
}

impl Chroma {
    /// Returns the bytes of the chroma plane of an image with that many rows of luma, `stride` bytes apart.
    pub(super) const fn bytes(self, height: u32, stride: u64) -> u64 {
        let rows = match self {
            Self::Quarter => height.div_ceil(2) as u64,
            Self::Full => 2 * height as u64,
        };
        rows.saturating_mul(stride)
    }
}

impl Encoding {
    /// Reads a name; `None` if it is unknown. The samples of several bytes have this order.
    ///
    /// The types of OpenCV (`8UC3`) state no order of the colours; OpenCV itself has blue first.
    pub(super) fn of(name: &str, order: ByteOrder) -> Option<Self> {
        Some(Self::Packed(match name {
            "mono8" | "8UC1" => PixelFormat::Mono8,
            "mono16" | "16UC1" => PixelFormat::Mono16(order),
            "rgb8" => PixelFormat::Rgb8,
            "bgr8" | "8UC3" => PixelFormat::Bgr8,
            "rgba8" => PixelFormat::Rgba8,
            "bgra8" | "8UC4" => PixelFormat::Bgra8,
            "rgb16" => PixelFormat::Rgb16(order),
            "bgr16" | "16UC3" => PixelFormat::Bgr16(order),
            "rgba16" => PixelFormat::Rgba16(order),
            "bgra16" | "16UC4" => PixelFormat::Bgra16(order),
            "yuyv" | "yuv422_yuy2" => PixelFormat::Yuyv,
            "uyvy" | "yuv422" => PixelFormat::Uyvy,
            "nv12" | "nv21" => return Some(Self::SemiPlanar(Chroma::Quarter)),
            "nv24" => return Some(Self::SemiPlanar(Chroma::Full)),
            _ => bayer(name, order)?,
        }))
    }
}

fn bayer(name: &str, order: ByteOrder) -> Option<PixelFormat> {
    let (pattern, bits) = name.strip_prefix("bayer_")?.split_at_checked(4)?;
    let pattern = match pattern {
        "rggb" => BayerPattern::Rggb,
        "bggr" => BayerPattern::Bggr,
        "gbrg" => BayerPattern::Gbrg,
        "grbg" => BayerPattern::Grbg,
        _ => return None,
    };
    match bits {
        "8" => Some(PixelFormat::Bayer8(pattern)),
        "16" => Some(PixelFormat::Bayer16(pattern, order)),
        _ => None,
    }
}

/// A name that [`Encoding::of`] does not know; shown with what would be right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownEncoding {
    /// The name, truncated to 32 characters.
    pub name: String,
}

impl UnknownEncoding {
    /// Takes the first 32 characters of a received name.
    pub(super) fn new(name: &str) -> Self {
        Self { name: excerpt(name) }
    }

    /// Says what the publisher can do about encodings that drivers are known to send.
    fn remedy(&self) -> Option<&'static str> {
        let name = self.name.to_ascii_lowercase();
        let has = |parts: &[&str]| parts.iter().any(|part| name.contains(part));
        if has(&["10", "12", "14"]) && has(&["mono", "gray", "grey", "bayer", "uc1", "y1"]) {
            return Some(
                "ROS has no name for samples of 10, 12 or 14 bits, packed or not: let the driver publish mono16 \
                 (bayer_*16 in colour) and set full_scale to 1023, 4095 or 16383, or let it publish mono8",
            );
        }
        if has(&["mjpeg", "mjpg", "jpeg", "jpg", "png", "h264", "h265", "hevc"]) {
            return Some(
                "these are compressed pictures: JPEG and PNG belong in a sensor_msgs/CompressedImage, \
                 video has to be decoded first",
            );
        }
        if has(&["32", "64", "sc"]) {
            return Some(
                "levels must be unsigned integers of 8 or 16 bits: let the driver publish mono8 or mono16",
            );
        }
        (ENCODINGS.split(", ").any(|known| known.eq_ignore_ascii_case(&name)))
            .then_some("names are case-sensitive")
    }
}

impl fmt::Display for UnknownEncoding {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "encoding {:?} is not one of {ENCODINGS}", self.name)?;
        self.remedy().map_or(Ok(()), |remedy| write!(formatter, "; {remedy}"))
    }
}

/// Returns the first 32 characters of a received text.
pub(super) fn excerpt(text: &str) -> String {
    text.chars().take(32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_encoding_has_its_layout() {
        let (little, big) = (ByteOrder::Little, ByteOrder::Big);
        let cases = [
            ("mono8", little, PixelFormat::Mono8),
            ("8UC1", big, PixelFormat::Mono8),
            ("mono16", little, PixelFormat::Mono16(little)),
            ("16UC1", big, PixelFormat::Mono16(big)),
            ("rgb8", little, PixelFormat::Rgb8),
            ("bgr8", little, PixelFormat::Bgr8),
            ("8UC3", little, PixelFormat::Bgr8),
            ("rgba8", little, PixelFormat::Rgba8),
            ("bgra8", little, PixelFormat::Bgra8),
            ("8UC4", little, PixelFormat::Bgra8),
            ("rgb16", big, PixelFormat::Rgb16(big)),
            ("bgr16", little, PixelFormat::Bgr16(little)),
            ("16UC3", big, PixelFormat::Bgr16(big)),
            ("rgba16", little, PixelFormat::Rgba16(little)),
            ("bgra16", big, PixelFormat::Bgra16(big)),
            ("16UC4", little, PixelFormat::Bgra16(little)),
            ("bayer_rggb8", little, PixelFormat::Bayer8(BayerPattern::Rggb)),
            ("bayer_bggr8", little, PixelFormat::Bayer8(BayerPattern::Bggr)),
            ("bayer_gbrg16", little, PixelFormat::Bayer16(BayerPattern::Gbrg, little)),
            ("bayer_grbg16", big, PixelFormat::Bayer16(BayerPattern::Grbg, big)),
            ("yuyv", little, PixelFormat::Yuyv),
            ("yuv422_yuy2", little, PixelFormat::Yuyv),
            ("uyvy", little, PixelFormat::Uyvy),
            ("yuv422", little, PixelFormat::Uyvy),
        ];
        for (name, order, format) in cases {
            assert_eq!(Encoding::of(name, order), Some(Encoding::Packed(format)), "{name}");
        }
        for (name, chroma) in
            [("nv12", Chroma::Quarter), ("nv21", Chroma::Quarter), ("nv24", Chroma::Full)]
        {
            assert_eq!(Encoding::of(name, little), Some(Encoding::SemiPlanar(chroma)), "{name}");
        }
    }

    /// The list in the message is the list that is read, apart from the braces of the Bayer patterns.
    #[test]
    fn every_listed_name_is_read() {
        let names = ENCODINGS.replace("bayer_{rggb,bggr,gbrg,grbg}{8,16}", "bayer_rggb8");
        for name in names.split(", ") {
            assert!(Encoding::of(name, ByteOrder::Little).is_some(), "{name}");
        }
    }

    #[test]
    fn unknown_names_are_told_with_what_would_be_right() {
        let cases = [
            ("mono10p", "full_scale to 1023"),
            ("mono12packed", "mono16"),
            ("bayer_rggb12", "bayer_*16"),
            ("y10", "mono16"),
            ("mjpeg", "CompressedImage"),
            ("h264", "decoded first"),
            ("32FC1", "unsigned"),
            ("16SC1", "unsigned"),
            ("MONO8", "case-sensitive"),
            ("nv16", "nv12, nv21, nv24"),
        ];
        for (name, remedy) in cases {
            assert_eq!(Encoding::of(name, ByteOrder::Little), None, "{name}");
            let words = UnknownEncoding::new(name).to_string();
            assert!(words.contains(remedy) && words.contains(name), "{words}");
        }
    }
}
