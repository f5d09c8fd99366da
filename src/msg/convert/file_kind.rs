//! Picture files by their first bytes: kind, size, and the pixels of the kinds that cameras' messages do not carry (TIFF,
//! BMP and PGM).

use std::{fmt, io::Cursor};

use image::{
    ColorType, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits,
    codecs::{bmp::BmpDecoder, pnm::PnmDecoder, tiff::TiffDecoder},
};

use super::frame::FrameRejected;
use crate::scanner::image::{ByteOrder, PixelFormat};

/// Byte order of the 16-bit samples from a decoder.
const NATIVE: ByteOrder =
    if cfg!(target_endian = "big") { ByteOrder::Big } else { ByteOrder::Little };

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
        if begins_with(&[b"\x89PNG\r\n\x1a\n"]) {
            Some(Self::Png)
        } else if begins_with(&[b"\xff\xd8\xff"]) {
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

    /// Columns and rows according to the header of a file of this kind.
    ///
    /// # Errors
    /// The header is damaged.
    pub(crate) fn size_px(self, file: &[u8]) -> Result<[u32; 2], ImageError> {
        let format = match self {
            Self::Png => ImageFormat::Png,
            Self::Jpeg => ImageFormat::Jpeg,
            Self::Tiff => ImageFormat::Tiff,
            Self::Bmp => ImageFormat::Bmp,
            Self::Pnm => ImageFormat::Pnm,
        };
        let (width, height) =
            ImageReader::with_format(Cursor::new(file), format).into_dimensions()?;
        Ok([width, height])
    }
}

/// Pixels of a file.
pub(super) struct Decoded {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) format: PixelFormat,
}

/// Decodes a TIFF, BMP or PGM file into `pixels`; `None` for other files.
///
/// Allocates no pixels before the size in the file's header is checked against `max_frame_bytes`.
///
/// # Errors
/// A size above the limit, pixels that are not supported, or a damaged file.
pub(super) fn decode(
    file: &[u8],
    max_frame_bytes: u64,
    pixels: &mut Vec<u8>,
) -> Option<Result<Decoded, FrameRejected>> {
    let kind = FileKind::of(file)?;
    let reader = Cursor::new(file);
    let task = Task { kind, length: file.len(), max_frame_bytes };
    let decoded = match kind {
        FileKind::Png | FileKind::Jpeg => return None,
        FileKind::Tiff => task.decode(TiffDecoder::new(reader), pixels),
        FileKind::Bmp => task.decode(BmpDecoder::new(reader), pixels),
        FileKind::Pnm => task.decode(PnmDecoder::new(reader), pixels),
    };
    Some(decoded.map(|mut decoded| {
        if kind == FileKind::Bmp && decoded.format == PixelFormat::Rgb8 && has_grey_palette(file) {
            keep_samples(pixels, 3, 1);
            decoded.format = PixelFormat::Mono8;
        }
        decoded
    }))
}

struct Task {
    kind: FileKind,
    length: usize,
    max_frame_bytes: u64,
}

impl Task {
    fn decode<D: ImageDecoder>(
        &self,
        decoder: Result<D, ImageError>,
        pixels: &mut Vec<u8>,
    ) -> Result<Decoded, FrameRejected> {
        let &Self { kind, length, max_frame_bytes } = self;
        let broken = |reason| FrameRejected::File { kind, length, reason };
        let mut decoder = decoder.map_err(broken)?;
        let (width, height) = decoder.dimensions();
        let color = decoder.color_type();
        let bytes = decoder.total_bytes();
        if bytes > max_frame_bytes {
            return Err(FrameRejected::TooLarge { width, height, bytes, max_frame_bytes });
        }
        let mut limits = Limits::no_limits();
        // The decoder holds a strip or tile beside the pixels.
        limits.max_alloc = Some(max_frame_bytes.saturating_mul(2));
        decoder.set_limits(limits).map_err(broken)?;
        // Zeroed, so that a partial frame contains no pixels of an earlier one.
        pixels.clear();
        pixels.resize(bytes as usize, 0);
        decoder.read_image(pixels).map_err(broken)?;
        let format = match color {
            ColorType::L8 => PixelFormat::Mono8,
            ColorType::L16 => PixelFormat::Mono16(NATIVE),
            ColorType::La8 => {
                keep_samples(pixels, 2, 1);
                PixelFormat::Mono8
            }
            ColorType::La16 => {
                keep_samples(pixels, 4, 2);
                PixelFormat::Mono16(NATIVE)
            }
            ColorType::Rgb8 => PixelFormat::Rgb8,
            ColorType::Rgba8 => PixelFormat::Rgba8,
            ColorType::Rgb16 => PixelFormat::Rgb16(NATIVE),
            ColorType::Rgba16 => PixelFormat::Rgba16(NATIVE),
            _ => return Err(FrameRejected::FileColor { kind, color }),
        };
        Ok(Decoded { width, height, format })
    }
}

/// Keeps the first bytes of every pixel.
fn keep_samples(pixels: &mut Vec<u8>, bytes_per_pixel: usize, kept: usize) {
    let num_pixels = pixels.len() / bytes_per_pixel;
    for pixel in 0..num_pixels {
        let from = pixel * bytes_per_pixel;
        pixels.copy_within(from..from + kept, pixel * kept);
    }
    pixels.truncate(num_pixels * kept);
}

/// True for a bitmap with a palette of grey levels, which the decoder expands to colours.
fn has_grey_palette(file: &[u8]) -> bool {
    let u16_at = |at: usize| Some(u16::from_le_bytes(*file.get(at..)?.first_chunk()?));
    let u32_at = |at: usize| Some(u32::from_le_bytes(*file.get(at..)?.first_chunk()?));
    let palette = || {
        // The file header has 14 bytes; the information header begins with its length.
        let (data_at, header_bytes, bits) = (u32_at(10)?, u32_at(14)?, u16_at(28)?);
        let palette = file.get(14_usize.checked_add(header_bytes as usize)?..data_at as usize)?;
        (bits <= 8 && header_bytes >= 40).then_some(palette)
    };
    palette().is_some_and(|palette| {
        let mut colors = palette.chunks_exact(4).peekable();
        colors.peek().is_some()
            && colors.all(
                |color| matches!(color, [blue, green, red, _] if blue == green && green == red),
            )
    })
}

#[cfg(test)]
mod tests {
    use image::{DynamicImage, GrayImage, ImageBuffer, Luma, Rgb, RgbImage, Rgba, RgbaImage};

    use super::*;

    const LIMIT: u64 = 1 << 20;

    fn file(picture: &DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        picture.write_to(&mut file, format).unwrap();
        file.into_inner()
    }

    fn grey() -> DynamicImage {
        GrayImage::from_fn(5, 3, |x, y| Luma([(40 * x + 9 * y) as u8])).into()
    }

    fn deep() -> DynamicImage {
        ImageBuffer::from_fn(5, 3, |x, y| Luma([(9000 * x + 77 * y) as u16])).into()
    }

    fn colored() -> DynamicImage {
        RgbImage::from_fn(5, 3, |x, y| Rgb([x as u8, 100 + y as u8, 255])).into()
    }

    fn decoded(file: &[u8]) -> Result<(PixelFormat, Vec<u8>), FrameRejected> {
        let mut pixels = vec![9; 70];
        let Decoded { width, height, format } = decode(file, LIMIT, &mut pixels).unwrap()?;
        assert_eq!((width, height), (5, 3));
        Ok((format, pixels))
    }

    #[test]
    fn files_decode_exactly() {
        let kinds = [
            (ImageFormat::Tiff, FileKind::Tiff),
            (ImageFormat::Bmp, FileKind::Bmp),
            (ImageFormat::Pnm, FileKind::Pnm),
        ];
        for (format, kind) in kinds {
            for (picture, expected) in [
                (grey(), PixelFormat::Mono8),
                (deep(), PixelFormat::Mono16(NATIVE)),
                (colored(), PixelFormat::Rgb8),
            ] {
                if kind == FileKind::Bmp && expected == PixelFormat::Mono16(NATIVE) {
                    continue;
                }
                let file = file(&picture, format);
                assert_eq!(FileKind::of(&file), Some(kind));
                assert_eq!(kind.size_px(&file).unwrap(), [5, 3]);
                let (found, pixels) = decoded(&file).unwrap();
                assert_eq!(found, expected, "{kind}");
                assert_eq!(pixels, picture.as_bytes(), "{kind} {expected:?}");
            }
        }
    }

    #[test]
    fn alpha_is_dropped_or_kept_as_such() {
        let alpha: DynamicImage =
            RgbaImage::from_fn(5, 3, |x, y| Rgba([x as u8, y as u8, 7, 200])).into();
        let (format, pixels) = decoded(&file(&alpha, ImageFormat::Tiff)).unwrap();
        assert_eq!((format, &*pixels), (PixelFormat::Rgba8, alpha.as_bytes()));
        // A PAM file of grey with alpha.
        let mut pam =
            b"P7\nWIDTH 5\nHEIGHT 3\nDEPTH 2\nMAXVAL 255\nTUPLTYPE GRAYSCALE_ALPHA\nENDHDR\n"
                .to_vec();
        pam.extend((0..15).flat_map(|level| [level * 10, 255]));
        let (format, pixels) = decoded(&pam).unwrap();
        assert_eq!(format, PixelFormat::Mono8);
        assert_eq!(pixels, (0..15).map(|level| level * 10).collect::<Vec<u8>>());
    }

    #[test]
    fn text_and_other_scales_are_read() {
        let (format, pixels) =
            decoded(b"P2\n# of a camera\n5 3\n255\n0 1 2 3 4 5 6 7 8 9 10 11 12 13 255\n").unwrap();
        assert_eq!((format, pixels[14]), (PixelFormat::Mono8, 255));
        let mut twelve_bit = b"P5 5 3 4095\n".to_vec();
        twelve_bit.extend([0x0f, 0xff].repeat(15));
        let (format, pixels) = decoded(&twelve_bit).unwrap();
        assert_eq!(
            (format, pixels),
            (PixelFormat::Mono16(NATIVE), vec![0xff; 30]),
            "white is white"
        );
    }

    #[test]
    fn other_files_are_told_apart() {
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
        assert!(
            decode(b"\xff\xd8\xff", LIMIT, &mut Vec::new()).is_none(),
            "left to its own decoder"
        );
    }

    #[test]
    fn damaged_and_false_files_are_rejected() {
        for format in [ImageFormat::Tiff, ImageFormat::Bmp, ImageFormat::Pnm] {
            let whole = file(&grey(), format);
            for length in [8, whole.len() / 2, whole.len() - 1] {
                let rejected = decode(&whole[..length], LIMIT, &mut Vec::new());
                // The directory of a TIFF file may lie before its last byte.
                let is_whole = format == ImageFormat::Tiff && length == whole.len() - 1;
                assert!(
                    is_whole || rejected.is_none_or(|result| result.is_err()),
                    "{format:?} {length}"
                );
            }
        }
        let mut pixels = Vec::new();
        let error = decode(b"P5 60000 60000 255\n", LIMIT, &mut pixels).unwrap().err().unwrap();
        assert!(matches!(error, FrameRejected::TooLarge { width: 60_000, .. }), "{error}");
        assert_eq!(pixels.capacity(), 0);
        let float = ImageBuffer::<Rgb<f32>, _>::from_fn(5, 3, |_, _| Rgb([0.5_f32; 3]));
        let error = decoded(&file(&float.into(), ImageFormat::Tiff)).unwrap_err();
        assert!(error.to_string().starts_with("TIFF image has Rgb32F pixels"), "{error}");
    }
}
