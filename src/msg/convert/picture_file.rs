//! Recognises the kind of a picture file by its first bytes.

use std::fmt;

use super::{compressed::Codec, encoding::excerpt};

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";
/// Length of the header that `compressed_depth_image_transport` writes before its PNG.
const DEPTH_HEADER_BYTES: usize = 12;

/// Returns the codec of a file, or what the file is if it has another.
///
/// The stated format is no evidence of the codec: publishers write `image/jpeg`, `mjpeg`, the encoding, or nothing.
pub(super) fn codec(format: &str, data: &[u8]) -> Result<Codec, UnknownPicture> {
    if data.starts_with(&[0xff, 0xd8]) {
        return Ok(Codec::Jpeg);
    }
    if data.starts_with(PNG) {
        return Ok(Codec::Png);
    }
    let found = if is_depth(format, data) {
        "a depth image of compressed_depth_image_transport, which is no picture of a line".into()
    } else if let Some((_, name)) = KINDS.iter().find(|(is, _)| is(data)) {
        (*name).into()
    } else if data.is_empty() {
        "no data".into()
    } else {
        let bytes: Vec<_> = data.iter().take(4).map(|byte| format!("{byte:02x}")).collect();
        format!("data that start with the bytes {}", bytes.join(" "))
    };
    Err(UnknownPicture { format: excerpt(format), found })
}

fn is_depth(format: &str, data: &[u8]) -> bool {
    let is_png = data.get(DEPTH_HEADER_BYTES..).is_some_and(|behind| behind.starts_with(PNG));
    is_png || format.to_ascii_lowercase().contains("compresseddepth")
}

type Test = fn(&[u8]) -> bool;

/// What publishers are known to send besides JPEG and PNG.
const KINDS: [(Test, &str); 8] = [
    (
        |data| data.starts_with(b"\0\0\0\x01") || data.starts_with(b"\0\0\x01"),
        "video (H.264 or H.265)",
    ),
    (|data| data.starts_with(b"RIFF"), "WebP or AVI"),
    (|data| data.starts_with(b"GIF8"), "GIF"),
    (|data| data.starts_with(b"BM"), "BMP"),
    (|data| data.starts_with(b"II*\0") || data.starts_with(b"MM\0*"), "TIFF"),
    (|data| data.get(4..8) == Some(b"ftyp"), "AVIF, HEIF or MP4"),
    (|data| data.starts_with(b"\xff\x4f\xff\x51") || data.get(4..8) == Some(b"jP  "), "JPEG 2000"),
    (|data| data.starts_with(b"\x28\xb5\x2f\xfd"), "data compressed with zstd"),
];

/// A compressed image that is neither JPEG nor PNG.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnknownPicture {
    /// Stated format, truncated to 32 characters.
    pub format: String,
    /// What the data are.
    pub found: String,
}

impl fmt::Display for UnknownPicture {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { format, found } = self;
        write!(
            formatter,
            "compressed image of format {format:?} holds {found}: it must be JPEG or PNG"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bytes_decide_whatever_is_stated() {
        for format in ["", "png", "image/jpeg", "mjpeg", "bgr8; jpeg compressed bgr8", "garbage"] {
            assert_eq!(codec(format, b"\xff\xd8\xff\xe0"), Ok(Codec::Jpeg), "{format}");
            assert_eq!(codec(format, PNG), Ok(Codec::Png), "{format}");
        }
    }

    #[test]
    fn other_files_are_named() {
        let depth = [&[0; DEPTH_HEADER_BYTES], PNG].concat();
        let cases: [(&str, &[u8], &str); 9] = [
            ("16UC1; compressedDepth png", &depth, "compressed_depth_image_transport"),
            ("png", &depth, "compressed_depth_image_transport"),
            ("16UC1; compressedDepth rvl", &[7; 30], "compressed_depth_image_transport"),
            ("h264", b"\0\0\0\x01\x67", "H.264"),
            ("jpeg", b"RIFF\0\0\0\0WEBP", "WebP"),
            ("tiff", b"II*\0", "TIFF"),
            ("jpeg", b"\x28\xb5\x2f\xfd\0", "zstd"),
            ("jpeg", b"", "no data"),
            ("jpeg", b"\x01\x02\x03\x04\x05", "01 02 03 04"),
        ];
        for (format, data, name) in cases {
            let words = codec(format, data).unwrap_err().to_string();
            assert!(words.contains(name) && words.contains("must be JPEG or PNG"), "{words}");
        }
    }
}
