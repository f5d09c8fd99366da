//! Picture files by their first bytes: kind, size and colours.

use std::{fmt, io::Cursor};

use image::{ColorType, ImageDecoder as _, ImageError, ImageFormat, ImageReader};

use super::{encoding::excerpt, jpeg, png};

/// Length of the header that `compressed_depth_image_transport` writes before its PNG.
const DEPTH_HEADER_BYTES: usize = 12;

/// Kind of a picture file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// PNG.
    Png,
    /// JPEG.
    Jpeg,
    /// TIFF, the first picture in it.
    Tiff,
    /// Windows bitmap.
    Bmp,
    /// PGM, PPM and PBM, as text or binary.
    Pnm,
}

impl fmt::Display for FileKind {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
            Self::Tiff => "TIFF",
            Self::Bmp => "BMP",
            Self::Pnm => "PGM",
        })
    }
}

impl FileKind {
    /// Returns the kind of a file that begins with these bytes; `None` if it is no picture.
    pub(crate) fn of(bytes: &[u8]) -> Option<Self> {
        let begins_with = |magic: &[&[u8]]| magic.iter().any(|magic| bytes.starts_with(magic));
        if begins_with(&[png::SIGNATURE]) {
            Some(Self::Png)
        } else if begins_with(&[b"\xff\xd8"]) {
            Some(Self::Jpeg)
        } else if begins_with(&[b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"]) {
            Some(Self::Tiff)
        } else if begins_with(&[b"BM"]) {
            Some(Self::Bmp)
        } else {
            let is_pnm =
                matches!(bytes, [b'P', b'1'..=b'7', after, ..] if after.is_ascii_whitespace());
            is_pnm.then_some(Self::Pnm)
        }
    }

    /// Name of the kind in the format of a compressed image.
    pub(crate) const fn format(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Jpeg => "jpeg",
            Self::Tiff => "tiff",
            Self::Bmp => "bmp",
            Self::Pnm => "pnm",
        }
    }

    /// Returns the kind of a compressed image's data, or what they are instead.
    ///
    /// The stated format is no evidence of the kind: publishers write `image/jpeg`, `mjpeg`, the encoding, or nothing.
    pub(super) fn of_message(format: &str, data: &[u8]) -> Result<Self, UnknownPicture> {
        if let Some(kind) = Self::of(data) {
            return Ok(kind);
        }
        let found = if is_depth(format, data) {
            "a depth image of compressed_depth_image_transport, which is no picture of a line"
                .into()
        } else if let Some((_, name)) = OTHERS.iter().find(|(is, _)| is(data)) {
            (*name).into()
        } else if data.is_empty() {
            "no data".into()
        } else {
            let bytes: Vec<_> = data.iter().take(4).map(|byte| format!("{byte:02x}")).collect();
            format!("data that start with the bytes {}", bytes.join(" "))
        };
        Err(UnknownPicture { format: excerpt(format), found })
    }

    /// Returns true if a PNG or JPEG file has no end. Of other kinds only decoding shows that.
    pub(crate) fn is_cut_off(self, file: &[u8]) -> bool {
        match self {
            Self::Png => !png::has_end(file),
            Self::Jpeg => jpeg::whole(file).is_none(),
            Self::Tiff | Self::Bmp | Self::Pnm => false,
        }
    }

    /// Columns and rows according to the header of a file of this kind.
    ///
    /// # Errors
    /// The header is damaged.
    pub(crate) fn size_px(self, file: &[u8]) -> Result<[u32; 2], ImageError> {
        self.header(file).map(|(size_px, _)| size_px)
    }

    /// Columns and rows, and the pixels, according to the header of a file of this kind.
    ///
    /// # Errors
    /// The header is damaged.
    pub(super) fn header(self, file: &[u8]) -> Result<([u32; 2], ColorType), ImageError> {
        let format = match self {
            Self::Png => ImageFormat::Png,
            Self::Jpeg => ImageFormat::Jpeg,
            Self::Tiff => ImageFormat::Tiff,
            Self::Bmp => ImageFormat::Bmp,
            Self::Pnm => ImageFormat::Pnm,
        };
        let decoder = ImageReader::with_format(reader(file), format).into_decoder()?;
        let (width, height) = decoder.dimensions();
        Ok(([width, height], decoder.color_type()))
    }
}

/// Returns a reader of bytes in memory.
pub(super) const fn reader(bytes: &[u8]) -> Cursor<&[u8]> {
    Cursor::new(bytes)
}

fn is_depth(format: &str, data: &[u8]) -> bool {
    let is_png =
        data.get(DEPTH_HEADER_BYTES..).is_some_and(|behind| behind.starts_with(png::SIGNATURE));
    is_png || format.to_ascii_lowercase().contains("compresseddepth")
}

/// The names of the kinds of pictures that are read.
pub(crate) const KINDS: &str = "PNG, JPEG, TIFF, BMP or PGM";

type Test = fn(&[u8]) -> bool;

/// Data that publishers are known to send besides pictures.
const OTHERS: [(Test, &str); 6] = [
    (
        |data| data.starts_with(b"\0\0\0\x01") || data.starts_with(b"\0\0\x01"),
        "video (H.264 or H.265)",
    ),
    (|data| data.starts_with(b"RIFF"), "WebP or AVI"),
    (|data| data.starts_with(b"GIF8"), "GIF"),
    (|data| data.get(4..8) == Some(b"ftyp"), "AVIF, HEIF or MP4"),
    (|data| data.starts_with(b"\xff\x4f\xff\x51") || data.get(4..8) == Some(b"jP  "), "JPEG 2000"),
    (|data| data.starts_with(b"\x28\xb5\x2f\xfd"), "data compressed with zstd"),
];

/// A compressed image that is no picture file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownPicture {
    /// Stated format, truncated to 32 characters.
    pub format: String,
    /// Kind of the data.
    pub found: String,
}

impl fmt::Display for UnknownPicture {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { format, found } = self;
        write!(
            formatter,
            "compressed image of format {format:?} holds {found}: it must be JPEG, PNG, TIFF, BMP or PGM"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bytes_decide_whatever_is_stated() {
        for format in ["", "png", "image/jpeg", "mjpeg", "bgr8; jpeg compressed bgr8", "garbage"] {
            assert_eq!(
                FileKind::of_message(format, b"\xff\xd8\xff\xe0"),
                Ok(FileKind::Jpeg),
                "{format}"
            );
            assert_eq!(FileKind::of_message(format, png::SIGNATURE), Ok(FileKind::Png), "{format}");
        }
    }

    #[test]
    fn other_files_are_named() {
        let depth = [&[0; DEPTH_HEADER_BYTES], png::SIGNATURE].concat();
        let cases: [(&str, &[u8], &str); 8] = [
            ("16UC1; compressedDepth png", &depth, "compressed_depth_image_transport"),
            ("png", &depth, "compressed_depth_image_transport"),
            ("16UC1; compressedDepth rvl", &[7; 30], "compressed_depth_image_transport"),
            ("h264", b"\0\0\0\x01\x67", "H.264"),
            ("jpeg", b"RIFF\0\0\0\0WEBP", "WebP"),
            ("jpeg", b"\x28\xb5\x2f\xfd\0", "zstd"),
            ("jpeg", b"", "no data"),
            ("jpeg", b"\x01\x02\x03\x04\x05", "01 02 03 04"),
        ];
        for (format, data, name) in cases {
            let words = FileKind::of_message(format, data).unwrap_err().to_string();
            assert!(words.contains(name) && words.contains("must be JPEG, PNG"), "{words}");
        }
    }

    #[test]
    fn kinds_are_told_apart() {
        for (bytes, kind) in [
            (&b"\x89PNG\r\n\x1a\n"[..], Some(FileKind::Png)),
            (b"\xff\xd8\xff\xe0", Some(FileKind::Jpeg)),
            (b"MM\0*", Some(FileKind::Tiff)),
            (b"P5\n", Some(FileKind::Pnm)),
            (b"P5", None),
            (b"P9 ", None),
            (b"GIF89a", None),
            (b"", None),
        ] {
            assert_eq!(FileKind::of(bytes), kind, "{bytes:?}");
        }
    }
}
